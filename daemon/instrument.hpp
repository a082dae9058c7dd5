// The whole instrument: a digitizer, the pipeline behind it and the recorder beside it, as configured. The
// daemon serves one; `replay` and `simulate` run one offline.
//
// Thread rule: start(), stop(), wait() from one thread at a time; the controls from one control thread (the
// I/O thread of the daemon), during stop() only cancel_free() and set_spectrum_rate(); status() from any.
// Controls do not wait for the stream.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "config/configuration.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/record/recorder.hpp"
#include "drivers/digitizer.hpp"

namespace combforce {

using FreeDone = std::function<void(std::optional<FreeResponse>, std::string)>;

struct InstrumentStatus {
  StreamStatus stream;
  PipelineStatus pipeline;
  bool recording = false;
  RecordingSummary record;  // of the running or the last recording
  std::uint64_t dropped_extraction = 0, dropped_recorder = 0;
  std::string utc;  // wall clock of `sample`, ISO 8601
  std::uint64_t sample = 0;
  double uncertainty_s = 0.0;
};

class Instrument {
 public:
  // Opens the digitizer. Throws std::invalid_argument or InputError. Outputs as of the pipeline; `event` also
  // carries the recorder's and may then come from its thread.
  Instrument(const Configuration& configuration, PipelineOutputs outputs);
  ~Instrument();
  Instrument(const Instrument&) = delete;
  Instrument& operator=(const Instrument&) = delete;

  void start();
  void wait();  // for a stream that ends: until its last pixel is out
  // Ends the acquisition, analyses and puts out what was acquired (for ten seconds at most, as of
  // Pipeline::stop()), closes the recording. Idempotent.
  void stop();

  const StreamInfo& info() const;
  InstrumentStatus status() const;
  Description description() const;  // as last set
  std::optional<ScanLayout> configured_scan() const;

  // Controls. std::logic_error when the instrument cannot (no scanner, already recording);
  // std::invalid_argument or InputError on bad values; nothing has changed then.
  void start_scan(std::optional<ScanLayout> layout, std::uint32_t frames);  // layout: absent = configured
  void stop_scan();
  void mark_line(const LineMark& mark);
  std::string start_recording(const std::string& name);  // "": a name from the time; returns the meta's path
  RecordingSummary stop_recording();
  // `done` is called from the output thread; the captured response is in force from the next pixel on. With a
  // response it also gets why it is incoherent, if it is: pixels are flagged then, until a better one is
  // captured.
  // `lifted`: just above the surface, for fits that remove a background (free_response.hpp); needs a free
  // response, and is refused when it drifts.
  enum class Height : std::uint8_t { far, lifted };
  void capture_free(std::uint32_t windows, Height height, FreeDone done);
  void cancel_free();  // the capture under way, if there is one: its `done` says so
  Drive drive() const;
  void set_drive(const Drive& drive);
  void set_fit(const FitSettings& fit);
  void set_spectrum_rate(double hz);  // as of the pipeline

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
