// The digitizer contract: every source of samples keeps it, and one contract test runs against all of them.
//
// Life: construct (throws std::invalid_argument or InputError on a bad setting) -> start() -> blocks are
// pushed into the sink from the digitizer's own thread -> the stream ends by itself (recording over, device
// gone) or by stop(). The stream itself never throws: loss is lost_before or a new epoch, the end is a state
// with a reason. After the last block the digitizer calls sink.close(). A digitizer runs once.
//
// Thread rule: start(), stop() and the controls from one control thread; status() from any.
#pragma once

#include <cstdint>
#include <string>

#include "drivers/block_sink.hpp"
#include "dsp/channel.hpp"
#include "dsp/sample_block.hpp"
#include "dsp/scan.hpp"
#include "fit/drive.hpp"

namespace combforce {

inline constexpr std::uint32_t most_block_frames = 1u << 20;  // where an option sets it

struct StreamInfo {
  double sample_rate_hz = 0.0;
  SampleFormat format = SampleFormat::i16;
  Channels channels;               // one entry a channel, channel 0 is the deflection
  std::uint32_t block_frames = 0;  // no block is longer
  WhenFull when_full = WhenFull::drop;
  bool marks_lines = false;   // line marks come with the stream; otherwise the client marks lines (scan.line)
  bool is_recording = false;  // a finished measurement: without line marks its pixels are consecutive windows
  bool has_scanner = false;   // start_scan(), stop_scan() work
  bool has_drive = false;     // set_drive() works
  bool continuity_verifiable = true;  // false: samples may be lost without the source noticing
  std::string name;                   // for people: "simulated", "replay of FILE"
};

enum class StreamState : std::uint8_t { idle, running, ended, failed };

struct StreamStatus {
  StreamState state = StreamState::idle;
  std::string reason;             // why it ended or failed, for people
  std::uint64_t next_sample = 0;  // one past the last frame delivered
  std::uint32_t epoch = 0;
  std::uint64_t lost_frames = 0;  // known losses of the source itself
  double realtime_factor = 0.0;   // stream seconds per wall second since start; 0 when not known
  bool scanning = false;
};

class Digitizer {
 public:
  virtual ~Digitizer() = default;
  Digitizer(const Digitizer&) = delete;
  Digitizer& operator=(const Digitizer&) = delete;

  virtual const StreamInfo& info() const = 0;
  virtual void start(BlockSink& sink) = 0;
  virtual void stop() = 0;  // idempotent; returns when no more block will come and the sink is closed
  virtual StreamStatus status() const = 0;

  // Controls, present where info() says so; elsewhere they throw std::logic_error.
  // Does of start_scan() what may fail or take time: one that follows with this layout throws no more, unless
  // a scan runs. No scan begins, and nothing that can be seen changes.
  virtual void prepare_scan(const ScanLayout& layout);
  // Scans `frames` frames (0: until stopped); lines are marked in the stream. A change takes effect at the
  // next pixel boundary, or at the next block when not scanning.
  virtual void start_scan(const ScanLayout& layout, std::uint32_t frames);
  virtual void stop_scan();
  virtual void set_drive(const Drive& drive);
  virtual Drive drive() const;

 protected:
  Digitizer() = default;
};

}  // namespace combforce
