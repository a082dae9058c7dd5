// The trench of the error: its minima are extended along one direction, and second minima lie there.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "fit/fit_result.hpp"

namespace combforce {

// A solution of a fit with its standard errors and correlations in a FitResult. Reentrant.
template <std::size_t Count>
class Trench {
 public:
  using Parameters = std::array<double, Count>;

  Trench(const Parameters& p, const FitResult& result) : p_(p), result_(&result) {
    // The surface position has no scale of its own: its zero is arbitrary.
    for (std::size_t k = 2; k < Count; ++k)
      if (!(relative_error(k) <= relative_error(worst_))) worst_ = k;
  }

  // Whether the parameter known worst is known so badly that second minima must be reckoned with. False
  // without a noise model.
  bool is_long() const { return relative_error(worst_) > long_error; }

  // A standard error away (at most half the value) along that parameter, the others following by their
  // correlations.
  Parameters start(double sign) const {
    const double length = sign * std::min(1.0, 0.5 / relative_error(worst_));
    Parameters start = p_;
    std::size_t pair = 0;
    for (std::size_t i = 0; i < Count; ++i)
      for (std::size_t j = i + 1; j < Count; ++j, ++pair) {
        if (i != worst_ && j != worst_) continue;
        const std::size_t follower = i == worst_ ? j : i;
        const double step = length * result_->correlation[pair] * result_->std_errors[follower];
        if (std::isfinite(step)) start[follower] += step;
      }
    start[worst_] += length * result_->std_errors[worst_];
    return start;
  }

 private:
  // Judged: a search ended at a minimum known to 12 % while the true one, known to 5 %, lay a standard error
  // and a half away.
  static constexpr double long_error = 0.05;

  double relative_error(std::size_t k) const { return result_->std_errors[k] / std::abs(p_[k]); }

  Parameters p_;
  const FitResult* result_;
  std::size_t worst_ = 1;
};

}  // namespace combforce
