// From sample blocks to fitted pixels in order: extraction thread, fit pool, output thread.
//
//     sink -> [extraction thread] -> pixel slots -> [fit workers] -> [output thread] -> PipelineOutputs
//
// Pixels wait in a ring of slots in stream order. The extraction fills the next slot and wakes one worker;
// the output thread retires slots strictly in order, whichever worker was first. When no worker has room, a
// live source's pixel goes out `not_fitted`; a source that can wait, waits.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <complex>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/pipeline/analysis.hpp"
#include "daemon/pipeline/spectrum_monitor.hpp"
#include "drivers/digitizer.hpp"
#include "dsp/pixel.hpp"
#include "fit/fit_result.hpp"
#include "fit/pixel_fitter.hpp"
#include "proto/description.hpp"

namespace combforce {

// A pixel on its way out. References are valid during the call.
struct RetiredPixel {
  const Pixel& pixel;
  std::span<const std::complex<double>> tip_nm;
  const FitResult& fit;
  const Analysis& analysis;
  double settling_residual;  // exp(-t/tau) of the pixel's own step, largest tau; 0 when tau is not known
};

// Counts over a line or a frame.
struct PixelCounts {
  std::uint64_t pixels = 0;
  // Indexed by FitStatus, of which `ambiguous` is the last.
  std::array<std::uint64_t, static_cast<std::size_t>(FitStatus::ambiguous) + 1> by_status{};
  double settling_residual = 0.0;  // greatest
};

struct LineDone {
  LineMark mark;
  PixelCounts counts;
};

struct FrameDone {
  std::uint32_t frame = 0;
  PixelCounts counts;
  // To the end of its last line; else the scan or the stream ended, or another frame began.
  bool whole = false;
};

// Something a person should hear of. `kind`: gap, epoch, incoherent (the free response drifted), record_gap,
// record_failed, scan_ended, stream_ended, warning.
struct Event {
  std::string kind;
  std::uint64_t first_sample = 0;
  std::uint64_t count = 0;  // frames lost, for gap and record_gap; not analysed, for stream_ended
  std::string text;
};

// Called from the output thread, one at a time, in stream order; `spectrum` from a thread of its own. Empty
// functions are not called.
struct PipelineOutputs {
  std::function<void(const RetiredPixel&)> pixel;
  std::function<void(const LineDone&)> line;
  std::function<void(const FrameDone&)> frame;
  std::function<void(const Event&)> event;
  std::function<void(const Spectrum&)> spectrum;
  // A new analysis is in force from this stream sample on (not called for the first).
  std::function<void(std::uint64_t first_sample, const Analysis&)> change;
};

// A change known beforehand (captures of a recording that carry afm: objects).
struct ScheduledChange {
  std::uint64_t first_sample = 0;
  Description description;  // whole, not a difference
};

struct PipelineStatus {
  std::uint64_t pixels_extracted = 0, pixels_retired = 0, not_fitted = 0;
  std::uint64_t next_sample = 0;  // one past the last frame extraction has seen
  std::uint32_t epoch = 0;
  double extraction_busy = 0.0;  // share of wall time, since start
  unsigned threads = 0;
};

class Extraction;
class FitPool;
class OutputSlots;
struct OutputSlot;

class Pipeline {
 public:
  // Throws std::invalid_argument on a description that cannot be analysed (no comb, scan that does not fit,
  // …). `info` and `sink` are of the digitizer that will be started after start().
  Pipeline(const StreamInfo& info, BlockSink& sink, const PipelineSettings& settings, Description description,
           std::vector<ScheduledChange> changes, PipelineOutputs outputs);
  ~Pipeline();  // stops
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  void start();
  void wait();  // until the stream has ended and every pixel is retired
  // Once the stream has ended: analyses what the ring still holds, but takes up nothing more after `drain`
  // (the fits under way then are finished, at most FitPool::queue_depth a worker); `stream_ended` counts what
  // is left. Before its end: cancels the sink. Idempotent.
  void stop(std::chrono::milliseconds drain = {});

  // Controls, from any thread (the bodies of `done` included). They take effect at the next pixel boundary.
  void change(Description description);
  std::shared_ptr<const Analysis> analysis() const;  // last one asked for
  // Line begins at mark.first_sample; for digitizers that do not mark lines. False: too many pending marks.
  bool mark_line(const LineMark& mark);
  // Averages the next `windows` free windows and calls `done` from the output thread: the response, with why
  // it is incoherent if it is, or why there is none (a gap). One at a time: throws std::logic_error while
  // another is under way.
  void capture_free(std::uint32_t windows,
                    std::function<void(std::optional<FreeResponse>, std::string)> done);
  // Gives up the capture under way, if there is one: `done` says so.
  void cancel_free();
  // As of SpectrumMonitor; 0 at first.
  void set_spectrum_rate(double hz);

  PipelineStatus status() const;

 private:
  void run_extraction();
  void run_output();
  void put_out(const OutputSlot& slot);
  void put_event(const char* kind, const OutputSlot& slot, std::string text) const;
  void put_change(const OutputSlot& slot) const;

  const StreamInfo info_;
  BlockSink& sink_;
  const PipelineSettings settings_;
  const unsigned workers_;
  const unsigned fitters_;  // one a worker, or none
  PipelineOutputs outputs_;
  mutable std::mutex mutex_;  // of analysis_, the order of change(), and cancel_capture_
  std::shared_ptr<const Analysis> analysis_;
  std::shared_ptr<std::atomic<bool>> cancel_capture_;  // of the last capture
  std::unique_ptr<OutputSlots> slots_;
  std::unique_ptr<FitPool> pool_;
  std::unique_ptr<Extraction> extraction_;
  std::unique_ptr<SpectrumMonitor> spectra_;
  PixelCounts line_counts_, frame_counts_;  // output thread
  std::atomic<std::uint64_t> retired_{0};
  std::atomic<std::chrono::steady_clock::rep> busy_{0};
  std::chrono::steady_clock::time_point started_;
  std::thread extraction_thread_, output_thread_;
};

}  // namespace combforce
