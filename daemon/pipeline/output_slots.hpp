// The ordered way out: a ring of slots in stream order, filled by the extraction, completed by whichever fit
// worker, and retired strictly in order by the output thread. Besides pixels it carries everything that must
// keep its place among them (lines, frames, gaps, changes).
//
// Thread rule: acquire() and commit…() by the extraction thread, complete() by the worker that was given the
// slot, front() and retire() by the output thread. No call but wait_…() waits; none allocates.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/pipeline/analysis.hpp"
#include "dsp/pixel.hpp"
#include "dsp/sample_block.hpp"
#include "fit/fit_result.hpp"

namespace combforce {

class FreeCapture;

struct OutputSlot {
  enum class Kind : std::uint8_t {
    pixel,
    line_done,
    frame_done,
    gap,
    epoch,
    change,
    free_capture,
    scan_ended,
    end
  };

  Kind kind = Kind::pixel;
  std::uint64_t first_sample = 0;
  std::uint64_t count = 0;  // gap: frames lost; end: frames not seen
  EpochReason epoch_reason = EpochReason::start;
  LineMark line;            // line_done
  std::uint32_t frame = 0;  // frame_done
  bool whole_frame = false;

  Pixel pixel;
  std::vector<std::complex<double>> tip_nm;
  FitResult fit;
  double settling_residual = 0.0;
  AnalysisStage* stage = nullptr;       // pixel: by which it is analysed; change: the new one
  AnalysisStage* superseded = nullptr;  // change: no longer referred to by anything behind this slot
  bool reference_held = false;          // change: the superseded free response was of this epoch
  FreeCapture* capture = nullptr;

  // Of the pixel's tones; the storage is sized for the largest comb.
  std::span<const std::complex<double>> tones() const {
    return {tip_nm.data(), stage->analysis->tip_per_volt.size()};
  }
};

class OutputSlots {
 public:
  OutputSlots(std::size_t slots, std::size_t max_tones, std::size_t channels);

  // The next slot in order, or null when all are taken.
  OutputSlot* acquire();
  // The acquired slot takes its place in the order: still to be completed, or complete already. Returns its
  // index.
  std::uint32_t commit_pending();
  void commit_complete();

  OutputSlot& at(std::uint32_t index) { return entries_[index].slot; }
  void complete(std::uint32_t index);

  // The oldest slot when it is complete, else null.
  OutputSlot* front();
  void retire();
  void wait_front();    // output thread: until front() is not null
  void wait_room();     // extraction: until acquire() is not null
  void wait_retired();  // extraction: until everything committed is retired

 private:
  enum class State : std::uint32_t { empty, pending, complete };
  struct Entry {
    OutputSlot slot;
    std::atomic<State> state{State::empty};
  };

  void wait_empty(std::size_t index);

  std::unique_ptr<Entry[]> entries_;
  std::size_t size_;
  std::size_t head_ = 0, tail_ = 0;  // indices of the extraction and of the output thread
};

}  // namespace combforce
