// Bounds by transformation: a solver without bounds works on x, the parameter stays within [lower, upper].
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace combforce {

// y = (low + high)/2 + (high - low)/2 sin(x), with y = p, or y = ln p when the lower bound is positive:
// strengths and lengths range over decades.
class Bounded {
 public:
  Bounded() = default;
  Bounded(double lower, double upper)
      : lower_(lower),
        upper_(upper),
        logarithmic_(lower > 0.0),
        middle_(0.5 * (scaled(upper) + scaled(lower))),
        half_(0.5 * (scaled(upper) - scaled(lower))) {}

  double value(double x) const {
    const double y = middle_ + half_ * std::sin(x);
    return std::clamp(logarithmic_ ? std::exp(y) : y, lower_, upper_);
  }
  // dp/dx at x, where p = value(x).
  double slope(double x, double p) const { return half_ * std::cos(x) * (logarithmic_ ? p : 1.0); }

  // Values at or beyond a bound become start points just inside it, where the slope is not 0.
  double inverse(double p) const {
    if (logarithmic_ && !(p > 0.0)) return std::asin(-edge);
    return std::asin(std::clamp((scaled(p) - middle_) / half_, -edge, edge));
  }

  bool at_bound(double x) const { return std::abs(std::sin(x)) > 1.0 - 1e-6; }
  // Closer to a bound than any start point; and the x of that bound.
  bool at_edge(double x) const { return std::abs(std::sin(x)) > edge; }
  double bound(double x) const { return std::copysign(0.5 * std::numbers::pi, std::sin(x)); }

 private:
  static constexpr double edge = 1.0 - 1e-3;
  double scaled(double p) const { return logarithmic_ ? std::log(p) : p; }

  double lower_ = 0.0, upper_ = 0.0;
  bool logarithmic_ = false;
  double middle_ = 0.0, half_ = 1.0;
};

}  // namespace combforce
