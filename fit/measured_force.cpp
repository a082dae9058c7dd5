#include "fit/measured_force.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fit/pixel_fitter.hpp"

namespace combforce {
namespace {

constexpr double drive_resolution = 1e-6;

// Quantile of chi^2 that a normal deviate exceeds as rarely as `deviate` (Wilson and Hilferty 1931).
double chi2_quantile(double degrees, double deviate) {
  const double spread = 2.0 / (9.0 * degrees);
  return degrees * std::pow(1.0 - spread + deviate * std::sqrt(spread), 3.0);
}

}  // namespace

MeasuredForce::MeasuredForce(const FitConditions& conditions)
    : free_nm_(conditions.free_response->mean_nm), noise_known_(conditions.noise.has_value()) {
  const std::size_t tones = conditions.comb.tones.size();
  const double delta_f_hz = conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
  const auto free_windows = static_cast<double>(conditions.free_response->windows);
  const double free_share = free_windows > 0.0 ? conditions.windows / free_windows : 0.0;
  double drive = 0.0;
  for (std::size_t i = 0; i < tones; ++i) {
    const double frequency_hz = static_cast<double>(conditions.comb.tones[i].bin) * delta_f_hz;
    inverse_response_.push_back(1.0 / tip_response(conditions.cantilever, frequency_hz));
    angular_frequencies_.push_back(2.0 * std::numbers::pi * frequency_hz);
    variances_.push_back(noise_known_
                             ? force_quadrature_variance(conditions.cantilever, *conditions.noise, i,
                                                         frequency_hz, delta_f_hz, conditions.windows)
                             : 0.0);
    drive += std::norm(inverse_response_[i] * free_nm_[i]);
  }
  for (const double variance : variances_)
    contact_variances_.push_back(variance * (1.0 + free_share) + drive_resolution * drive_resolution * drive);
  contact_threshold_ = chi2_quantile(2.0 * static_cast<double>(tones), 5.0);
  tip_nm_.resize(tones);
  forces_.resize(tones);
}

void MeasuredForce::set(std::span<const std::complex<double>> tip_nm) {
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    tip_nm_[i] = tip_nm[i];
    forces_[i] = inverse_response_[i] * (tip_nm[i] - free_nm_[i]);
  }
}

bool MeasuredForce::contact() const {
  double chi2 = 0.0;
  for (std::size_t i = 0; i < forces_.size(); ++i) chi2 += std::norm(forces_[i]) / contact_variances_[i];
  return chi2 > contact_threshold_;
}

bool MeasuredForce::misfit(double chi2_reduced, std::size_t parameters, double deviate) const {
  const auto degrees = static_cast<double>(2 * forces_.size()) - static_cast<double>(parameters);
  return noise_known_ && degrees > 0.0 && chi2_reduced * degrees > chi2_quantile(degrees, deviate);
}

double MeasuredForce::virial_nn_nm() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < forces_.size(); ++i) sum += 0.5 * (forces_[i] * std::conj(tip_nm_[i])).real();
  return sum;
}

double MeasuredForce::dissipated_fw() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < forces_.size(); ++i)
    sum -= 0.5 * angular_frequencies_[i] * (forces_[i] * std::conj(tip_nm_[i])).imag();
  return sum * 1e-3;  // nN nm/s = 1e-18 W
}

}  // namespace combforce
