// One capture of the free response: windows of the stream averaged while nothing touches the surface.
#pragma once

#include <atomic>
#include <complex>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/pipeline/drift.hpp"
#include "fit/free_response.hpp"

namespace combforce {

// Made by the control thread, filled by the extraction thread, ended by the output thread.
class FreeCapture {
 public:
  // The response, and "" or why it is incoherent; without a response why there is none.
  using Done = std::function<void(std::optional<FreeResponse>, std::string)>;

  // `windows` >= 1 of `comb`. The response is incoherent when a driven tone turns by more than
  // `drift_tolerance` (drift.hpp). Allocates all it will need.
  FreeCapture(std::uint32_t windows, const Comb& comb, double drift_tolerance, Done done);

  // Adds a window that starts at `first_sample`: tip deflection, nm. True when it was the last. Does not
  // allocate.
  bool add(std::uint64_t first_sample, std::span<const std::complex<double>> tip_nm);
  void begin_again();  // what was added counts no more: the motion is another one now
  void fail(const char* why) { failure_ = why; }

  // Whoever holds it may ask for the capture to be given up, at any time and from any thread.
  using Cancellation = std::shared_ptr<std::atomic<bool>>;
  const Cancellation& cancellation() const { return cancelled_; }
  bool cancelled() const { return cancelled_->load(std::memory_order_relaxed); }

  // Calls `done` with the mean and its covariance (scatter of the windows over their number; absent with
  // fewer than two), or with the reason why there is none.
  void finish() const;

 private:
  std::uint32_t windows_;
  double drift_tolerance_;
  std::uint32_t added_ = 0;
  std::uint64_t first_sample_ = 0;
  std::vector<double> mean_, deviation_, scatter_;  // over [re_0, im_0, …]; Welford's recurrence
  TurnMeter turns_;
  const char* failure_ = nullptr;
  Cancellation cancelled_ = std::make_shared<std::atomic<bool>>(false);
  Done done_;
};

}  // namespace combforce
