#include "fit/start_values.hpp"

#include <algorithm>
#include <cmath>

namespace combforce {

StartValues::StartValues(std::size_t tones)
    : d_(bins),
      histogram_(static_cast<Eigen::Index>(2 * tones), bins),
      basis_(static_cast<Eigen::Index>(2 * tones), 8),
      phases_(tones),
      node_(tones) {}

// Depths grow geometrically from 0.1 % of the motion's span to half of it.
double StartValues::depth(std::size_t index) const {
  const double share = static_cast<double>(index) / (depths - 1);
  return span_ * 1e-3 * std::pow(500.0, share);
}

void StartValues::set_motion(const Motion& motion) {
  constexpr double last = bins - 1;
  lowest_ = motion.lowest_nm();
  span_ = motion.highest_nm() - lowest_;
  for (std::size_t bin = 0; bin < bins; ++bin)
    d_[bin] = lowest_ + span_ * std::pow(static_cast<double>(bin) / last, 2.0);
  histogram_.setZero();
  const auto tones = static_cast<std::size_t>(histogram_.rows()) / 2;
  for (std::size_t cell = 0; cell < motion.cells(); ++cell) {
    const Motion::Polynomial& c = motion.polynomial(cell);
    const bool close = c[0] - spread(c) < lowest_ + 0.2 * span_;
    const int samples = close ? 8 : 2;
    const double weight = motion.cell_weight() * 2.0 / samples;
    for (int sample = 0; sample < samples; ++sample) {
      const double s = -1.0 + (2.0 * sample + 1.0) / samples;
      const double d = value_at(c, s);
      const double place = last * std::sqrt(std::clamp((d - lowest_) / span_, 0.0, 1.0));
      const auto bin = std::min(static_cast<std::size_t>(place), bins - 2);
      const double share = std::clamp((d - d_[bin]) / (d_[bin + 1] - d_[bin]), 0.0, 1.0);
      for (std::size_t i = 0; i < tones; ++i) {
        const std::complex<double> phase = motion.centre_phase(cell, i) * motion.local_phase(i, s);
        const auto row = static_cast<Eigen::Index>(2 * i), column = static_cast<Eigen::Index>(bin);
        histogram_(row, column) += (1.0 - share) * weight * phase.real();
        histogram_(row + 1, column) -= (1.0 - share) * weight * phase.imag();
        histogram_(row, column + 1) += share * weight * phase.real();
        histogram_(row + 1, column + 1) -= share * weight * phase.imag();
      }
    }
  }
}

}  // namespace combforce
