// Takes the windows of a free capture out of the stream between lines.
#pragma once

#include <atomic>
#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/pipeline/analysis.hpp"
#include "daemon/pipeline/free_capture.hpp"
#include "dsp/sample_block.hpp"

namespace combforce {

// Thread rule: request() by the control thread, the rest by the extraction thread, without allocating or
// locking.
class FreeWindows {
 public:
  // Room for the largest comb and all channels.
  FreeWindows(std::size_t most_tones, std::size_t channels) : tones_(most_tones), means_(channels) {}
  ~FreeWindows();
  FreeWindows(const FreeWindows&) = delete;
  FreeWindows& operator=(const FreeWindows&) = delete;

  // False when a capture is under way.
  bool request(std::unique_ptr<FreeCapture> capture);

  // Whether a capture is under way; takes up a request.
  bool wanted();
  // Takes what it needs of the block's frames [from, until), nothing before `settled`. Returns the next
  // sample to look at: `until`, or less where a window ended.
  std::uint64_t consume(AnalysisStage& stage, const SampleBlock& block, std::uint64_t from,
                        std::uint64_t until, std::uint64_t settled);
  bool complete() const { return complete_; }
  bool cancelled() const { return capture_ != nullptr && capture_->cancelled(); }
  void restart() { window_ = never; }  // the window in progress is void: another analysis took over
  void begin_again() {                 // a step was commanded: windows before it and after do not mix
    restart();
    if (capture_ != nullptr) capture_->begin_again();
  }

  // Ends the capture, with a reason when it is not complete; null when none was under way.
  std::unique_ptr<FreeCapture> end(const char* failure);

 private:
  static constexpr std::uint64_t never = ~std::uint64_t{0};

  std::atomic<FreeCapture*> requested_{nullptr};
  std::atomic<bool> busy_{false};
  std::unique_ptr<FreeCapture> capture_;
  std::uint64_t window_ = never;  // first sample of the window in progress
  bool complete_ = false;
  std::vector<std::complex<double>> tones_;
  std::vector<double> means_;
};

}  // namespace combforce
