// From sample blocks to pixels: follows the pixel clock through the stream, extracts the tones of every
// pixel, and accounts for everything that befalls the stream.
//
// Runs in the extraction thread: no allocation, no lock; it sleeps only for room in the output slots (and,
// behind a source that can wait, in the fit queues), and it wakes one worker a pixel.
//
// What it emits, in stream order, into the output slots: every pixel of a line that has begun, a line's and a
// frame's end, gaps, epochs, changes of the analysis, the end.
#pragma once

#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/pipeline/analysis.hpp"
#include "daemon/pipeline/fit_pool.hpp"
#include "daemon/pipeline/free_windows.hpp"
#include "daemon/pipeline/output_slots.hpp"
#include "daemon/pipeline/stage_queue.hpp"
#include "dsp/sample_block.hpp"

namespace combforce {

class Extraction {
 public:
  using Clock = std::chrono::steady_clock;

  // `scheduled` is ordered by first_sample.
  Extraction(const StreamInfo& info, std::unique_ptr<AnalysisStage> first,
             std::vector<ScheduledStage> scheduled, OutputSlots& slots, FitPool& pool);
  ~Extraction();
  Extraction(const Extraction&) = delete;
  Extraction& operator=(const Extraction&) = delete;

  // Extraction thread.
  void process(const SampleBlock& block);
  // The stream is over: ends the pixel in progress and emits `end`, which counts the samples up to
  // `stream_end` that were not seen.
  void finish(std::uint64_t stream_end = 0);
  bool out_of_time() const;  // to drain what is left

  // Control thread: takes over at the next pixel boundary; a stage not yet taken over is replaced.
  void change(std::unique_ptr<AnalysisStage> stage) { stages_.post(std::move(stage)); }
  // Control thread: false when one is under way.
  bool capture(std::unique_ptr<FreeCapture> capture) { return free_windows_.request(std::move(capture)); }
  // Control thread: a line that the stream itself does not mark. False: too many wait already.
  bool mark_line(const LineMark& mark) { return client_marks_.push(mark); }

  // Control thread: the stream has ended and there is nothing to keep up with. Pixels wait for a worker,
  // whatever the source, but not beyond `until`.
  void drain(Clock::time_point until) {
    drain_until_.store(until.time_since_epoch().count(), std::memory_order_relaxed);
  }

  // Any thread.
  std::uint64_t next_sample() const { return next_sample_.load(std::memory_order_relaxed); }
  std::uint32_t epoch() const { return epoch_.load(std::memory_order_relaxed); }
  std::uint64_t pixels() const { return pixels_.load(std::memory_order_relaxed); }
  std::uint64_t not_fitted() const { return not_fitted_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint64_t never = ~std::uint64_t{0};

  void begin_epoch(const BlockHeader& header);
  void skip_lost(std::uint64_t until);
  void miss(std::uint64_t until, PixelFlag why);  // [cursor, until) is not there
  void consume(const SampleBlock& block, std::uint64_t until);
  void consume_pixel(const SampleBlock& block, std::uint64_t until);
  void consume_free(const SampleBlock& block, std::uint64_t until);
  void apply(const StreamMark& mark);
  void begin_line(const LineMark& mark, PixelFlag if_late);
  void cut_line();  // the line in progress ends here: its pixel in progress is incomplete
  void end_line(bool whole);
  void end_frame(bool whole);
  void begin_pixel();
  void place_pixel();
  void emit_pixel();
  void measure(OutputSlot& slot);
  void dispatch(OutputSlot& slot, std::size_t parameters);
  void take_over(std::uint64_t boundary);
  void install(std::unique_ptr<AnalysisStage> stage, std::uint64_t boundary);
  void end_capture(const char* failure);  // null: complete
  bool may_wait_for_fits() const;
  OutputSlot& next_slot(OutputSlot::Kind kind, std::uint64_t first_sample);
  bool in_pixel() const { return line_.has_value() || !marked_; }
  bool valid(const std::optional<FreeResponse>& reference) const {
    return reference && reference->first_sample >= epoch_first_;
  }
  std::uint64_t settled_from() const;

  const StreamInfo info_;
  const bool marked_;  // pixels lie in marked lines; otherwise the stream is one row of pixels
  OutputSlots& slots_;
  FitPool& pool_;
  FreeWindows free_windows_;
  StageQueue stages_;
  std::unique_ptr<AnalysisStage> stage_;  // once superseded, the change slot's

  std::uint64_t cursor_ = 0;  // next sample to look at
  bool started_ = false;
  std::uint64_t epoch_first_ = 0;    // where this epoch began; a reference from before it is void
  std::uint64_t last_step_ = never;  // latest commanded step
  std::optional<LineMark> line_;
  std::uint32_t frame_pixels_ = 0;  // since the last frame ended
  std::uint32_t frame_ = 0;
  std::uint64_t unmarked_first_ = 0;   // where the row of unmarked pixels begins in this epoch
  std::uint32_t unmarked_column_ = 0;  // its first column
  std::uint32_t pixel_index_ = 0;      // in time, within the line
  PixelSpan span_;
  PixelFlags flags_;
  bool analysing_ = false;  // the extractor holds part of span_

  boost::lockfree::spsc_queue<LineMark, boost::lockfree::capacity<64>> client_marks_;
  std::atomic<std::uint64_t> next_sample_{0}, pixels_{0}, not_fitted_{0};
  std::atomic<std::uint32_t> epoch_{0};
  std::atomic<Clock::rep> drain_until_{Clock::time_point::max().time_since_epoch().count()};
};

}  // namespace combforce
