#include "fit/start_values.hpp"

#include <algorithm>
#include <cmath>

namespace combforce {

StartValues::StartValues(const Motion& motion, Kind kind, double velocity_per_slope)
    : kind_(kind),
      velocity_per_slope_(velocity_per_slope),
      bins_(kind == Kind::velocity  ? 160
            : kind == Kind::history ? 320
                                    : 640),
      d_(histograms() * bins_),
      histogram_(static_cast<Eigen::Index>(2 * motion.tones()), static_cast<Eigen::Index>(d_.size())),
      excursion_(2 * motion.highest_harmonic()),
      velocity_(d_.size()),
      time_(d_.size()),
      basis_(static_cast<Eigen::Index>(2 * motion.tones()), max_parameters),
      centre_(motion.tones()),
      fine_(equidistant(motion, 24)),
      medium_(equidistant(motion, 8)),
      coarse_(equidistant(motion, 2)) {}

void StartValues::set_motion(const Motion& motion) {
  const auto last = static_cast<double>(bins_ - 1);
  lowest_ = motion.lowest_nm();
  span_ = motion.highest_nm() - lowest_;
  for (std::size_t bin = 0; bin < d_.size(); ++bin)
    d_[bin] = lowest_ + span_ * std::pow(static_cast<double>(bin % bins_) / last, 3.0);
  histogram_.setZero();
  std::ranges::fill(velocity_, 0.0);
  std::ranges::fill(time_, 0.0);
  steepest_ = 0.0;
  for (std::size_t cell = 0; cell < motion.cells(); ++cell)
    steepest_ = std::max(steepest_, std::abs(motion.polynomial(cell)[1]));
  // What the period's end leaves behind is there at its begin.
  excursion_.begin(0.0);
  if (kind_ == Kind::history)
    for (std::size_t cell = 0; cell < motion.cells(); ++cell)
      for (const double s : medium_.places) excursion_.advance(value_at(motion.polynomial(cell), s));
  for (std::size_t cell = 0; cell < motion.cells(); ++cell) {
    const Motion::Polynomial& c = motion.polynomial(cell);
    for (std::size_t i = 0; i < centre_.size(); ++i)
      centre_[i] = motion.cell_weight() * motion.centre_phase(cell, i);
    const double height = (c[0] - spread(c) - lowest_) / span_;
    add_samples(c, height < 0.08 ? fine_ : height < 0.25 ? medium_ : coarse_);
  }
  // A tip that has been below one surface position has been so below all that are higher.
  if (kind_ == Kind::history)
    for (std::size_t bin = bins_; bin < d_.size(); ++bin)
      histogram_.col(static_cast<Eigen::Index>(bin)) +=
          histogram_.col(static_cast<Eigen::Index>(bin - bins_));
  for (std::size_t bin = 0; bin < d_.size(); ++bin)
    if (time_[bin] > 0.0) velocity_[bin] *= velocity_per_slope_ / time_[bin];
}

StartValues::Samples StartValues::equidistant(const Motion& motion, std::size_t count) {
  Samples samples;
  for (std::size_t j = 0; j < count; ++j) {
    samples.places.push_back(-1.0 + (2.0 * static_cast<double>(j) + 1.0) / static_cast<double>(count));
    for (std::size_t i = 0; i < motion.tones(); ++i)
      samples.phases.push_back(2.0 / static_cast<double>(count) *
                               motion.local_phase(i, samples.places.back()));
  }
  return samples;
}

std::size_t StartValues::histograms() const {
  return kind_ == Kind::velocity ? 2 * speeds : kind_ == Kind::history ? depths : 1;
}

// That of the sample after the last; histograms() for none.
std::size_t StartValues::histogram_of(double d, double slope) {
  if (kind_ == Kind::history) return first_surface_above(excursion_.advance(d));
  if (kind_ == Kind::deflection) return 0;
  const double speed = static_cast<double>(speeds) * std::sqrt(std::abs(slope) / steepest_);
  return (slope > 0.0 ? speeds : 0) + std::min(static_cast<std::size_t>(speed), speeds - 1);
}

std::size_t StartValues::first_surface_above(double d) const {
  const double share = (d - lowest_) / (span_ * least_depth);
  if (share < 1.0) return 0;
  const double place = std::log(share) / std::log(0.5 / least_depth) * static_cast<double>(depths - 1);
  return std::min(static_cast<std::size_t>(place) + 1, depths);
}

void StartValues::add_samples(const Motion::Polynomial& c, const Samples& samples) {
  const std::complex<double>* local = samples.phases.data();
  for (const double s : samples.places) {
    const auto [d, slope] = value_and_slope_at(c, s);
    const double place =
        static_cast<double>(bins_ - 1) * std::cbrt(std::clamp((d - lowest_) / span_, 0.0, 1.0));
    const std::size_t histogram = histogram_of(d, slope);
    if (histogram == histograms()) {
      local += centre_.size();
      continue;
    }
    const std::size_t bin = histogram * bins_ + std::min(static_cast<std::size_t>(place), bins_ - 2);
    const double share = std::clamp((d - d_[bin]) / (d_[bin + 1] - d_[bin]), 0.0, 1.0);
    const double time = 1.0 / static_cast<double>(samples.places.size());
    time_[bin] += (1.0 - share) * time;
    time_[bin + 1] += share * time;
    velocity_[bin] += (1.0 - share) * time * slope;
    velocity_[bin + 1] += share * time * slope;
    double* lower = histogram_.col(static_cast<Eigen::Index>(bin)).data();
    double* upper = histogram_.col(static_cast<Eigen::Index>(bin + 1)).data();
    for (std::size_t i = 0; i < centre_.size(); ++i, ++local) {
      const double re = local->real() * centre_[i].real() - local->imag() * centre_[i].imag();
      const double im = local->real() * centre_[i].imag() + local->imag() * centre_[i].real();
      lower[2 * i] += (1.0 - share) * re;
      lower[2 * i + 1] -= (1.0 - share) * im;
      upper[2 * i] += share * re;
      upper[2 * i + 1] -= share * im;
    }
  }
}

}  // namespace combforce
