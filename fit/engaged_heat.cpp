#include "fit/engaged_heat.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "fit/units.hpp"

namespace combforce {
namespace {

// Squares of what a kick adds to turns and to decay, in radians: a tenth of it the surface acts amiss.
constexpr double most_kick = 0.05;
constexpr std::size_t most_kicks = 64;
// Of squares: nothing of the beginning is left.
constexpr double forgotten = 1e-24;
// Of Phi: so many windows a motion may last, and still be told from one that does not end.
constexpr int most_doublings = 30;
constexpr std::size_t looks = 64;  // a period, for what is forgotten: numbers should not become denormal

}  // namespace

EngagedHeat::FreeMode EngagedHeat::free_mode(const Mode& mode, double temperature_k, double duration_s) {
  const double w = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double decay = 0.5 * w / mode.quality_factor;
  // exp of ((0, w), (-w, -2 decay)) over the time, from its eigenvalues -decay -+ root.
  const std::complex<double> root = std::sqrt(std::complex<double>(decay * decay - w * w)) +
                                    std::complex<double>(1e-9 * w);  // never a double one
  const std::complex<double> grown = root * duration_s;
  const double shrunk = std::exp(-decay * duration_s);
  const double even = shrunk * std::cosh(grown).real(), odd = shrunk * (std::sinh(grown) / root).real();
  FreeMode free{};
  free.qq = even + decay * odd;
  free.qv = w * odd;
  free.vq = -w * odd;
  free.vv = even - decay * odd;
  // The free covariance, which stays, is this times the unit matrix.
  const double variance = boltzmann_nn_nm_per_k * temperature_k / mode.stiffness_n_per_m;
  free.heat_qq = variance * (1.0 - free.qq * free.qq - free.qv * free.qv);
  free.heat_qv = -variance * (free.qq * free.vq + free.qv * free.vv);
  free.heat_vv = variance * (1.0 - free.vq * free.vq - free.vv * free.vv);
  return free;
}

EngagedHeat::EngagedHeat(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k,
                         unsigned windows)
    : windows_(windows),
      periods_(harmonics.periods()),
      transform_(quick_fft_size(3 * harmonics.band() + 2)),
      size_(transform_.signal().size()),
      step_s_(1.0 / (harmonics.spacing_hz() * static_cast<double>(size_))),
      tones_(harmonics.tones().begin(), harmonics.tones().end()),
      by_surface_(size_),
      by_velocity_(size_),
      order_(index(2 * cantilever.modes.size())),
      heated_(order_, order_),
      carried_(order_, order_ + index(2 * tones_.size())),
      seen_(index(2 * tones_.size()), carried_.cols()),
      force_(order_),
      felt_(order_),
      displacement_(order_),
      velocity_(order_),
      tip_(carried_.cols()),
      moved_(carried_.cols()),
      weight_(seen_.rows()),
      variance_(size_),
      tip_rows_(index(size_), order_),
      power_(order_, order_),
      squared_(order_, order_),
      beginning_(order_, order_),
      correlated_(order_, seen_.rows()),
      later_(order_, seen_.rows()),
      covariance_(seen_.rows(), seen_.rows()) {
  for (const Mode& mode : cantilever.modes) {
    const double w = 2.0 * std::numbers::pi * mode.frequency_hz;
    displacement_.segment<2>(index(2 * kicks_.size())) << 1.0, 0.0;
    velocity_.segment<2>(index(2 * kicks_.size())) << 0.0, w;
    kicks_.push_back(w / mode.stiffness_n_per_m);
    push_ += w * kicks_.back();
    free_variance_ += boltzmann_nn_nm_per_k * temperature_k / mode.stiffness_n_per_m;
  }
  for (std::size_t kicks = 1; kicks <= most_kicks; kicks *= 2) {
    Pace pace{kicks, 0.5 * step_s_ / static_cast<double>(kicks), {}};
    for (const Mode& mode : cantilever.modes)
      pace.modes.push_back(free_mode(mode, temperature_k, pace.between_s));
    paces_.push_back(std::move(pace));
  }
  for (std::size_t j = 0; j < size_; ++j)
    weights_.push_back(
        std::polar(2.0 / static_cast<double>(size_ * periods_),
                   -2.0 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(size_)));
}

bool EngagedHeat::engage(const ForceGradient& gradient) {
  const auto over_time = [&](std::span<const std::complex<double>> derivative, std::vector<double>& values) {
    transform_.to_signal(derivative.first(std::min(derivative.size(), size_ / 2)));
    std::ranges::copy(transform_.signal(), values.begin());
  };
  over_time(gradient.by_surface, by_surface_);
  over_time(gradient.by_velocity, by_velocity_);
  integrate();
  if (!find_beginning()) return false;
  average_windows();
  return true;
}

// From a tip at rest and a window's beginning to its end. The window begins and ends amid a step; its
// integrals are sums, by Euler and Maclaurin's formula corrected for what the ends differ by.
void EngagedHeat::integrate() {
  heated_.setZero();
  carried_.setZero();
  carried_.leftCols(order_).setIdentity();
  seen_.setZero();
  see_end(1.0);
  record(0);
  half_step(0);
  for (std::size_t i = 1; i < size_ * periods_; ++i) {
    const std::size_t step = i % size_;
    half_step(step);
    for (std::size_t c = 0; c < tones_.size(); ++c) set_weight(c, weights_[tones_[c] * step % size_]);
    see(displacement_);
    if (i < size_) record(step);
    half_step(step);
    if (step % (size_ / looks + 1) == 0 && carried_.leftCols(order_).squaredNorm() < forgotten)
      carried_.leftCols(order_).setZero();
  }
  half_step(0);
  see_end(-1.0);
}

const EngagedHeat::Pace& EngagedHeat::pace(std::size_t step) const {
  const double turn = std::abs(by_surface_[step]) * push_, decay = by_velocity_[step] * push_;
  for (const Pace& pace : paces_)
    if (std::max(turn, decay * decay) * pace.between_s * pace.between_s <= most_kick) return pace;
  return paces_.back();
}

// The surface, as it is at the step, acts for half of one.
void EngagedHeat::half_step(std::size_t step) {
  const Pace& at = pace(step);
  const double stiffness = -by_surface_[step], damping = by_velocity_[step];
  kick(stiffness, damping, 0.5 * at.between_s);
  for (std::size_t i = 1; i <= at.kicks; ++i) {
    move_freely(at.modes);
    kick(stiffness, damping, i < at.kicks ? at.between_s : 0.5 * at.between_s);
  }
}

// Acts on every mode's velocity, by the tip's motion; a damping as long as it lasts.
void EngagedHeat::kick(double stiffness, double damping, double duration_s) {
  const double rate = damping * push_;
  if (rate != 0.0) duration_s = std::expm1(rate * duration_s) / rate;
  force_ = stiffness * displacement_ + damping * velocity_;
  moved_.noalias() = force_.transpose().lazyProduct(carried_);
  felt_.noalias() = heated_.lazyProduct(force_);
  const double square = force_.dot(felt_);
  for (std::size_t m = 0; m < kicks_.size(); ++m) {
    const Eigen::Index v = index(2 * m + 1);
    const double gain = duration_s * kicks_[m];
    carried_.row(v) += gain * moved_;
    heated_.row(v) += gain * felt_.transpose();
    heated_.col(v) += gain * felt_;
    for (std::size_t l = 0; l < kicks_.size(); ++l)
      heated_(v, index(2 * l + 1)) += gain * duration_s * kicks_[l] * square;
  }
}

void EngagedHeat::set_weight(std::size_t tone, std::complex<double> weight) {
  weight_(index(2 * tone)) = weight.real();
  weight_(index(2 * tone + 1)) = weight.imag();
}

// What the tones see of the displacement, or of the velocity, with the weights that are set.
void EngagedHeat::see(const Eigen::VectorXd& of) {
  tip_.noalias() = of.transpose().lazyProduct(carried_);
  felt_.noalias() = heated_.lazyProduct(of);
  tip_variance_ = of.dot(felt_);
  moved_ = tip_;
  moved_.tail(weight_.size()) += 0.5 * tip_variance_ * weight_.transpose();
  seen_.noalias() += weight_ * moved_;
  carried_.rightCols(weight_.size()).noalias() += felt_ * weight_.transpose();
}

// sign: 1 at the window's beginning, -1 at its end.
void EngagedHeat::see_end(double sign) {
  const std::complex<double> whole = weights_[0];
  for (std::size_t c = 0; c < tones_.size(); ++c) set_weight(c, sign * step_s_ / 12.0 * whole);
  see(velocity_);
  for (std::size_t c = 0; c < tones_.size(); ++c) {
    const double turn = 2.0 * std::numbers::pi * static_cast<double>(tones_[c]) / static_cast<double>(size_);
    set_weight(c, whole * std::complex<double>(0.5, -sign * turn / 12.0));
  }
  see(displacement_);
}

void EngagedHeat::move_freely(const std::vector<FreeMode>& modes) {
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const FreeMode& mode = modes[m];
    auto q = carried_.row(index(2 * m)), v = carried_.row(index(2 * m + 1));
    moved_ = mode.qq * q + mode.qv * v;
    v = mode.vq * q + mode.vv * v;
    q = moved_;
  }
  for (std::size_t m = 0; m < modes.size(); ++m)
    for (std::size_t l = 0; l < modes.size(); ++l) {
      const FreeMode &row = modes[m], &column = modes[l];
      double &qq = heated_(index(2 * m), index(2 * l)), &qv = heated_(index(2 * m), index(2 * l + 1)),
             &vq = heated_(index(2 * m + 1), index(2 * l)), &vv = heated_(index(2 * m + 1), index(2 * l + 1));
      const double a = row.qq * qq + row.qv * vq, b = row.qq * qv + row.qv * vv;
      const double c = row.vq * qq + row.vv * vq, d = row.vq * qv + row.vv * vv;
      qq = a * column.qq + b * column.qv;
      qv = a * column.vq + b * column.vv;
      vq = c * column.qq + d * column.qv;
      vv = c * column.vq + d * column.vv;
    }
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const FreeMode& mode = modes[m];
    heated_(index(2 * m), index(2 * m)) += mode.heat_qq;
    heated_(index(2 * m), index(2 * m + 1)) += mode.heat_qv;
    heated_(index(2 * m + 1), index(2 * m)) += mode.heat_qv;
    heated_(index(2 * m + 1), index(2 * m + 1)) += mode.heat_vv;
  }
}

void EngagedHeat::record(std::size_t step) {
  tip_rows_.row(index(step)) = tip_.head(order_);
  variance_[step] = tip_variance_;
}

// P, the sum of Phi^j <n n'> Phi'^j over j = 0, 1, …, by doubling the number of its terms.
bool EngagedHeat::find_beginning() {
  beginning_ = heated_;
  power_ = carried_.leftCols(order_);
  for (int i = 0; i < most_doublings && power_.squaredNorm() > forgotten; ++i) {
    squared_.noalias() = power_.lazyProduct(beginning_);
    beginning_ += squared_.lazyProduct(power_.transpose());
    squared_.noalias() = power_.lazyProduct(power_);
    power_ = squared_;
  }
  if (!(power_.squaredNorm() <= forgotten) || !beginning_.allFinite()) return false;
  double sum = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    felt_.noalias() = beginning_.lazyProduct(tip_rows_.row(index(i)).transpose());
    variance_[i] += tip_rows_.row(index(i)).dot(felt_);
    sum += variance_[i];
  }
  mean_variance_ = sum / static_cast<double>(size_);
  return true;
}

// <D D'> of the mean of windows that follow each other: <D_k D_0'> = C Phi^(k-1) <x_1 D_0'>.
void EngagedHeat::average_windows() {
  const auto of_beginning = seen_.leftCols(order_);  // C
  covariance_ = seen_.rightCols(seen_.rows());
  covariance_ += seen_.rightCols(seen_.rows()).transpose();
  later_.noalias() = beginning_.lazyProduct(of_beginning.transpose());
  covariance_ += of_beginning.lazyProduct(later_);
  correlated_.noalias() = carried_.leftCols(order_).lazyProduct(later_);
  correlated_ += carried_.rightCols(seen_.rows());
  covariance_ /= static_cast<double>(windows_);
  for (unsigned k = 1; k < windows_ && correlated_.squaredNorm() > forgotten * covariance_.squaredNorm();
       ++k) {
    const double share = static_cast<double>(windows_ - k) / (static_cast<double>(windows_) * windows_);
    covariance_ += share * of_beginning.lazyProduct(correlated_);
    covariance_ += share * correlated_.transpose().lazyProduct(of_beginning.transpose());
    later_.noalias() = carried_.leftCols(order_).lazyProduct(correlated_);
    correlated_ = later_;
  }
}

void EngagedHeat::standard_deviation(double seen, std::span<std::complex<double>> phasors) {
  const double unseen = std::max(0.0, 1.0 - seen / mean_variance_);
  std::ranges::transform(variance_, transform_.signal().begin(),
                         [&](double value) { return std::sqrt(unseen * std::max(0.0, value)); });
  transform_.to_phasors(phasors);
}

}  // namespace combforce
