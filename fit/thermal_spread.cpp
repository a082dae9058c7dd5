#include "fit/thermal_spread.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

#include "fit/units.hpp"

namespace combforce {
namespace {

// So much greater than the free variance is that of a motion that grows without end.
constexpr double unstable = 100.0;
// Of the variance: how far from the periodic one it may end.
constexpr double settled = 2e-3;

}  // namespace

ThermalSpread::ThermalSpread(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k)
    : size_(quick_fft_size(3 * harmonics.band() + 2)),
      band_(harmonics.band()),
      step_s_(1.0 / (harmonics.spacing_hz() * static_cast<double>(size_))),
      // The variance relaxes twice as fast as the amplitude: within a thousandth after 3.5 ring-down times,
      // if the surface takes away no damping.
      relaxation_periods_(0.5 * longest_ring_down_s(cantilever) * harmonics.spacing_hz()),
      most_periods_(4 + static_cast<std::size_t>(8.0 * relaxation_periods_)),
      order_(2 * cantilever.modes.size()),
      covariance_(order_ * order_),
      moved_(order_) {
  for (const Mode& mode : cantilever.modes) {
    const double w = 2.0 * std::numbers::pi * mode.frequency_hz;
    const double decay = 0.5 * w / mode.quality_factor;
    // exp of ((0, 1), (-w^2, -2 decay)) over the step, from its eigenvalues -decay -+ root.
    const std::complex<double> root = std::sqrt(std::complex<double>(decay * decay - w * w)) +
                                      std::complex<double>(1e-9 * w);  // never a double one
    const std::complex<double> grown = root * step_s_;
    const double shrunk = std::exp(-decay * step_s_);
    const double even = shrunk * std::cosh(grown).real(), odd = shrunk * (std::sinh(grown) / root).real();
    FreeMode free{};
    free.qq = even + decay * odd;
    free.qv = odd;
    free.vq = -w * w * odd;
    free.vv = even - decay * odd;
    free.variance = boltzmann_nn_nm_per_k * temperature_k / mode.stiffness_n_per_m;
    free.variance_v = w * w * free.variance;
    free.heat_qq = free.variance * (1.0 - free.qq * free.qq) - free.variance_v * free.qv * free.qv;
    free.heat_qv = -free.variance * free.qq * free.vq - free.variance_v * free.qv * free.vv;
    free.heat_vv = free.variance_v * (1.0 - free.vv * free.vv) - free.variance * free.vq * free.vq;
    free.kick = w * w / mode.stiffness_n_per_m;
    free_variance_ += free.variance;
    modes_.push_back(free);
  }
  stiffness_.reset(fftw_alloc_real(size_));
  damping_.reset(fftw_alloc_real(size_));
  variance_.reset(fftw_alloc_real(size_));
  bins_.reset(fftw_alloc_complex(size_ / 2 + 1));
  const int size = static_cast<int>(size_);
  const std::scoped_lock lock(fftw_planner_mutex());
  to_stiffness_.reset(fftw_plan_dft_c2r_1d(size, bins_.get(), stiffness_.get(), FFTW_ESTIMATE));
  to_damping_.reset(fftw_plan_dft_c2r_1d(size, bins_.get(), damping_.get(), FFTW_ESTIMATE));
  from_variance_.reset(fftw_plan_dft_r2c_1d(size, variance_.get(), bins_.get(), FFTW_ESTIMATE));
}

// Puts phasors where the inverse transforms read.
void ThermalSpread::set_bins(std::span<const std::complex<double>> phasors) {
  auto* bins = reinterpret_cast<std::complex<double>*>(bins_.get());
  std::fill_n(bins, size_ / 2 + 1, 0.0);
  const std::size_t count = std::min(phasors.size(), band_ + 1);
  for (std::size_t n = 0; n < count; ++n) bins[n] = n == 0 ? phasors[0].real() : 0.5 * phasors[n];
}

bool ThermalSpread::standard_deviation(const ForceGradient& gradient, double seen,
                                       std::span<std::complex<double>> phasors) {
  set_bins(gradient.by_surface);
  fftw_execute(to_stiffness_.get());
  const bool viscous = !gradient.by_velocity.empty();
  if (viscous) {
    set_bins(gradient.by_velocity);
    fftw_execute(to_damping_.get());
  }
  std::ranges::fill(covariance_, 0.0);
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    at(2 * m, 2 * m) = modes_[m].variance;
    at(2 * m + 1, 2 * m + 1) = modes_[m].variance_v;
  }
  double mean = free_variance_;
  bool periodic = false;
  for (std::size_t period = 0; period < most_periods_ && !periodic; ++period) {
    double sum = 0.0;
    for (std::size_t i = 0; i < size_; ++i) {
      kick(-stiffness_.get()[i], viscous ? damping_.get()[i] : 0.0);
      variance_.get()[i] = tip_variance();
      sum += variance_.get()[i];
      step_free();
    }
    const double before = mean;
    mean = sum / static_cast<double>(size_);
    if (!(mean < unstable * free_variance_)) return false;
    // What is still to come is the last change times the periods that relaxation takes.
    periodic = period > 0 && std::abs(mean - before) * (1.0 + relaxation_periods_) <= settled * mean;
  }
  if (!periodic) return false;
  const double unseen = std::max(0.0, 1.0 - seen / mean);
  for (std::size_t i = 0; i < size_; ++i)
    variance_.get()[i] = std::sqrt(unseen * std::max(0.0, variance_.get()[i]));
  fftw_execute(from_variance_.get());
  const auto* bins = reinterpret_cast<const std::complex<double>*>(bins_.get());
  for (std::size_t n = 0; n < phasors.size(); ++n)
    phasors[n] = (n == 0 ? 1.0 : 2.0) / static_cast<double>(size_) * bins[n];
  return true;
}

// P to Phi P Phi' + heat, Phi of 2 x 2 blocks.
void ThermalSpread::step_free() {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const FreeMode& row = modes_[m];
    for (std::size_t l = 0; l < modes_.size(); ++l) {
      const FreeMode& column = modes_[l];
      double &qq = at(2 * m, 2 * l), &qv = at(2 * m, 2 * l + 1), &vq = at(2 * m + 1, 2 * l),
             &vv = at(2 * m + 1, 2 * l + 1);
      const double a = row.qq * qq + row.qv * vq, b = row.qq * qv + row.qv * vv;
      const double c = row.vq * qq + row.vv * vq, d = row.vq * qv + row.vv * vv;
      qq = a * column.qq + b * column.qv;
      qv = a * column.vq + b * column.vv;
      vq = c * column.qq + d * column.qv;
      vv = c * column.vq + d * column.vv;
    }
    at(2 * m, 2 * m) += row.heat_qq;
    at(2 * m, 2 * m + 1) += row.heat_qv;
    at(2 * m + 1, 2 * m) += row.heat_qv;
    at(2 * m + 1, 2 * m + 1) += row.heat_vv;
  }
}

// The surface acts for a step: v_m += kick_m (stiffness q + damping v) of the tip, the damping as long as it
// takes.
void ThermalSpread::kick(double stiffness, double damping) {
  double push = 0.0;
  for (const FreeMode& mode : modes_) push += mode.kick;
  const double rate = damping * push;
  const double duration = rate != 0.0 ? std::expm1(rate * step_s_) / rate : step_s_;
  double inner = 0.0;
  for (std::size_t row = 0; row < order_; ++row) {
    double sum = 0.0;
    for (std::size_t m = 0; m < modes_.size(); ++m)
      sum += stiffness * at(row, 2 * m) + damping * at(row, 2 * m + 1);
    moved_[row] = sum;
  }
  for (std::size_t m = 0; m < modes_.size(); ++m)
    inner += stiffness * moved_[2 * m] + damping * moved_[2 * m + 1];
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const double gain = duration * modes_[m].kick;
    for (std::size_t row = 0; row < order_; ++row) {
      at(row, 2 * m + 1) += gain * moved_[row];
      at(2 * m + 1, row) += gain * moved_[row];
    }
    for (std::size_t l = 0; l < modes_.size(); ++l)
      at(2 * m + 1, 2 * l + 1) += gain * duration * modes_[l].kick * inner;
  }
}

double ThermalSpread::tip_variance() const {
  double sum = 0.0;
  for (std::size_t m = 0; m < modes_.size(); ++m)
    for (std::size_t l = 0; l < modes_.size(); ++l) sum += covariance_[2 * m * order_ + 2 * l];
  return sum;
}

}  // namespace combforce
