#include "fit/measured_force.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <numbers>

#include "fit/fit_conditions.hpp"

namespace combforce {
namespace {

constexpr double drive_resolution = 1e-6;
constexpr double room_temperature_k = 300.0;

// The quantile of chi^2 that is exceeded as rarely as a normal deviate exceeds `deviate`, and how often x is.
double rarity(double deviate) {
  return 0.5 * std::erfc(deviate / std::numbers::sqrt2);
}
double chi2_quantile(double degrees, double deviate) {
  return quantile(complement(boost::math::chi_squared(degrees), rarity(deviate)));
}
double chi2_rarity(double degrees, double chi2) {
  return cdf(complement(boost::math::chi_squared(degrees), chi2));
}

}  // namespace

MeasuredForce::MeasuredForce(const FitConditions& conditions)
    : free_nm_(conditions.free_response->mean_nm), noise_known_(conditions.noise.has_value()) {
  const std::size_t tones = conditions.comb.tones.size();
  const double delta_f_hz = conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
  const auto free_windows = static_cast<double>(conditions.free_response->windows);
  const double free_share = free_windows > 0.0 ? conditions.windows / free_windows : 0.0;
  std::vector<double> frequencies_hz;
  double drive = 0.0;
  for (std::size_t i = 0; i < tones; ++i) {
    const double frequency_hz = static_cast<double>(conditions.comb.tones[i].bin) * delta_f_hz;
    frequencies_hz.push_back(frequency_hz);
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
  set_covariance(conditions, frequencies_hz);
}

void MeasuredForce::set_covariance(const FitConditions& conditions, std::span<const double> frequencies_hz) {
  const auto rows = static_cast<Eigen::Index>(2 * frequencies_hz.size());
  const double delta_f_hz = conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
  search_covariance_ = thermal_force_covariance(
      conditions.cantilever, frequencies_hz,
      noise_known_ ? conditions.noise->temperature_k : room_temperature_k, delta_f_hz, conditions.windows);
  detector_variances_.resize(frequencies_hz.size());
  covariance_ = Eigen::MatrixXd::Zero(rows, rows);
  if (!noise_known_) return;
  for (std::size_t i = 0; i < frequencies_hz.size(); ++i) {
    const double density = detector_density(*conditions.noise, i);
    detector_variances_[i] = density * density * delta_f_hz / conditions.windows;
    const double variance = detector_variances_[i] * std::norm(inverse_response_[i]);
    search_covariance_.diagonal().segment<2>(static_cast<Eigen::Index>(2 * i)).array() += variance;
  }
  covariance_ = search_covariance_;
}

double MeasuredForce::gain(const Eigen::MatrixXd& stiffness, Eigen::Index row, Eigen::Index column) const {
  double value = stiffness(row, column);
  if (row / 2 == column / 2) {
    const std::complex<double> inverse = inverse_response_[static_cast<std::size_t>(row / 2)];
    value -= row == column ? inverse.real() : row > column ? inverse.imag() : -inverse.imag();
  }
  return value;
}

void MeasuredForce::covariance_at(const Eigen::MatrixXd& stiffness, const Eigen::MatrixXd& heat,
                                  Eigen::MatrixXd& covariance) const {
  const Eigen::Index rows = covariance.rows();
  covariance.setZero();
  for (Eigen::Index seen = 0; seen < rows; ++seen)
    for (Eigen::Index l = 0; l < rows; ++l) {
      double reached = detector_variances_[static_cast<std::size_t>(seen / 2)] * gain(stiffness, l, seen);
      for (Eigen::Index moved = 0; moved < rows; ++moved)
        reached += heat(seen, moved) * gain(stiffness, l, moved);
      for (Eigen::Index k = 0; k < rows; ++k) covariance(k, l) += gain(stiffness, k, seen) * reached;
    }
}

void MeasuredForce::set(std::span<const std::complex<double>> tip_nm,
                        std::span<const std::complex<double>> turns) {
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    tip_nm_[i] = tip_nm[i];
    forces_[i] = inverse_response_[i] * (tip_nm[i] - turns[i] * free_nm_[i]);
  }
}

bool MeasuredForce::contact() const {
  double chi2 = 0.0;
  for (std::size_t i = 0; i < forces_.size(); ++i) chi2 += std::norm(forces_[i]) / contact_variances_[i];
  return chi2 > contact_threshold_;
}

bool MeasuredForce::misfit(double chi2_reduced, std::size_t parameters, double deviate) const {
  const auto degrees = static_cast<double>(2 * forces_.size()) - static_cast<double>(parameters);
  const double chi2 = chi2_reduced * degrees;
  if (!noise_known_ || degrees <= 0.0 || !(chi2 >= 0.0)) return false;
  return !std::isfinite(chi2) || chi2_rarity(degrees, chi2) < rarity(deviate);
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
