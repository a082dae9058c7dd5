#include "fit/coupled_motion.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace combforce {
namespace {

// Of the static one, of harmonics that are coupled. At 0.06, 4 times the frequency of a lone mode, 5 of 14
// pixels of products about one mode on stiff contacts did not settle; at 0.02, 7 times, 2, as at 0.003.
constexpr double least_compliance = 0.02;

std::size_t count_coupled(const Harmonics& harmonics) {
  const auto& chi = harmonics.response();
  std::size_t last = harmonics.highest_tone();
  for (std::size_t n = 0; n < chi.size(); ++n)
    if (std::abs(chi[n]) >= least_compliance * std::abs(chi[0])) last = std::max(last, n);
  return last + 1;
}

}  // namespace

CoupledMotion::CoupledMotion(const Harmonics& harmonics)
    : harmonics_(&harmonics),
      coupled_(count_coupled(harmonics)),
      transform_(quick_fft_size(4 * coupled_)),
      matrix_(index(2 * harmonics.strong().size()), index(2 * harmonics.strong().size())),
      factor_(matrix_.rows()),
      strong_(matrix_.rows()),
      strong_solved_(matrix_.rows()),
      directions_(most_directions + 1, Eigen::VectorXd(index(2 * coupled_))),
      hessenberg_(index(most_directions + 1), index(most_directions)),
      cosines_(index(most_directions)),
      sines_(index(most_directions)),
      rotated_(index(most_directions + 1)),
      right_(index(2 * coupled_)),
      image_(index(2 * coupled_)),
      moved_(index(2 * coupled_)) {
  for (auto* values : {&by_surface_, &by_velocity_, &resistance_}) values->resize(transform_.signal().size());
  phasors_.resize(coupled_);
}

void CoupledMotion::set_gradient(const ForceGradient& gradient) {
  const auto strong = harmonics_->strong();
  const auto& chi = harmonics_->response();
  for (std::size_t column = 0; column < strong.size(); ++column)
    for (std::size_t row = 0; row < strong.size(); ++row) {
      const auto [re, im] = gradient.coupling(strong[row], strong[column]);
      const Complex x = -chi[strong[row]] * re, y = -chi[strong[row]] * im;
      const double one = row == column ? 1.0 : 0.0;
      matrix_(index(2 * row), index(2 * column)) = one + x.real();
      matrix_(index(2 * row + 1), index(2 * column)) = x.imag();
      matrix_(index(2 * row), index(2 * column + 1)) = y.real();
      matrix_(index(2 * row + 1), index(2 * column + 1)) = one + y.imag();
    }
  factor_.compute(matrix_);
  // Of the harmonics that couple the coupled ones.
  const auto over_time = [&](std::span<const Complex> derivative, std::vector<double>& values) {
    transform_.to_signal(derivative.first(std::min(derivative.size(), 2 * coupled_)));
    std::ranges::copy(transform_.signal(), values.begin());
  };
  over_time(gradient.by_surface, by_surface_);
  viscous_ = !gradient.by_velocity.empty();
  if (viscous_) over_time(gradient.by_velocity, by_velocity_);
  spacing_ = gradient.spacing;
}

// Leaves in phasors_ those of the force.
void CoupledMotion::feel(std::span<const Complex> motion) {
  const std::span<double> signal = transform_.signal();
  if (viscous_) {
    for (std::size_t n = 0; n < coupled_; ++n)
      phasors_[n] = Complex(0.0, spacing_ * static_cast<double>(n)) * motion[n];
    transform_.to_signal(phasors_);
    std::ranges::transform(by_velocity_, signal, resistance_.begin(), std::multiplies{});
  }
  transform_.to_signal(motion.first(coupled_));
  for (std::size_t i = 0; i < signal.size(); ++i)
    signal[i] = (viscous_ ? resistance_[i] : 0.0) - by_surface_[i] * signal[i];
  transform_.to_phasors(phasors_);
}

void CoupledMotion::force(std::span<const Complex> motion, std::span<Complex> at_tones) {
  feel(motion);
  for (std::size_t i = 0; i < at_tones.size(); ++i) at_tones[i] = phasors_[harmonics_->tones()[i]];
}

void CoupledMotion::respond(std::span<Complex> motion) {
  feel(motion);
  std::ranges::fill(motion, 0.0);
  for (std::size_t n = 0; n < coupled_; ++n)
    if (!harmonics_->is_tone(n)) motion[n] = harmonics_->response()[n] * phasors_[n];
}

// (1 - chi G) in.
void CoupledMotion::apply(const Eigen::VectorXd& in, Eigen::VectorXd& out) {
  feel(std::span(reinterpret_cast<const Complex*>(in.data()), coupled_));
  auto* values = reinterpret_cast<Complex*>(out.data());
  out = in;
  for (std::size_t n = 0; n < coupled_; ++n)
    if (!harmonics_->is_tone(n)) values[n] -= harmonics_->response()[n] * phasors_[n];
}

void CoupledMotion::precondition(const Eigen::VectorXd& in, Eigen::VectorXd& out) {
  const auto strong = harmonics_->strong();
  for (std::size_t s = 0; s < strong.size(); ++s)
    for (std::size_t part = 0; part < 2; ++part)
      strong_(index(2 * s + part)) = strong[s] < coupled_ ? in(index(2 * strong[s] + part)) : 0.0;
  strong_solved_ = factor_.solve(strong_);
  out = in;
  for (std::size_t s = 0; s < strong.size(); ++s)
    for (std::size_t part = 0; part < 2; ++part)
      if (strong[s] < coupled_) out(index(2 * strong[s] + part)) = strong_solved_(index(2 * s + part));
  out(1) = 0.0;  // the mean
}

double CoupledMotion::solve(std::span<Complex> motion, double tolerance) {
  for (const std::size_t tone : harmonics_->tones()) motion[tone] = 0.0;
  motion[0] = motion[0].real();
  auto* right = reinterpret_cast<Complex*>(right_.data());
  std::copy_n(motion.begin(), coupled_, right);
  const Eigen::Index used = minimize(right_, tolerance);
  image_.setZero();
  for (Eigen::Index j = 0; j < used; ++j) image_ += rotated_(j) * directions_[static_cast<std::size_t>(j)];
  precondition(image_, moved_);
  std::copy_n(reinterpret_cast<const Complex*>(moved_.data()), coupled_, motion.begin());
  return std::abs(rotated_(used));
}

// GMRES: leaves in rotated_ the coefficients of so many directions_.
Eigen::Index CoupledMotion::minimize(const Eigen::VectorXd& right, double tolerance) {
  const double norm = right.norm();
  rotated_.setZero();
  rotated_(0) = norm;
  if (!(norm > 0.0) || !std::isfinite(norm)) return 0;
  directions_[0] = right / norm;
  Eigen::Index j = 0;
  while (j < index(most_directions) && std::abs(rotated_(j)) > tolerance * norm) {
    precondition(directions_[static_cast<std::size_t>(j)], moved_);
    apply(moved_, image_);
    for (Eigen::Index i = 0; i <= j; ++i) {
      hessenberg_(i, j) = directions_[static_cast<std::size_t>(i)].dot(image_);
      image_ -= hessenberg_(i, j) * directions_[static_cast<std::size_t>(i)];
    }
    const double rest = image_.norm();
    for (Eigen::Index i = 0; i < j; ++i) {  // the rotations so far
      const double upper = hessenberg_(i, j), lower = hessenberg_(i + 1, j);
      hessenberg_(i, j) = cosines_(i) * upper + sines_(i) * lower;
      hessenberg_(i + 1, j) = cosines_(i) * lower - sines_(i) * upper;
    }
    const double length = std::hypot(hessenberg_(j, j), rest);
    if (!(length > 0.0) || !std::isfinite(length)) break;
    cosines_(j) = hessenberg_(j, j) / length;
    sines_(j) = rest / length;
    hessenberg_(j, j) = length;
    rotated_(j + 1) = -sines_(j) * rotated_(j);
    rotated_(j) *= cosines_(j);
    ++j;
    if (!(rest > 0.0)) break;
    directions_[static_cast<std::size_t>(j)] = image_ / rest;
  }
  for (Eigen::Index i = j; i-- > 0;) {
    for (Eigen::Index k = i + 1; k < j; ++k) rotated_(i) -= hessenberg_(i, k) * rotated_(k);
    rotated_(i) /= hessenberg_(i, i);
  }
  return j;
}

}  // namespace combforce
