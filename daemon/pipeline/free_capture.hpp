// One capture of the free response: windows of the stream averaged while nothing touches the surface.
#pragma once

#include <complex>
#include <cstdint>
#include <functional>
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
  void fail(const char* why) { failure_ = why; }

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
  Done done_;
};

}  // namespace combforce
