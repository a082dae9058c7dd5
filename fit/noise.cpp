#include "fit/noise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

#include "fit/units.hpp"

namespace combforce {
namespace {

constexpr double engaged_spread = 2.0;  // of a mode's state at the ends of windows, by that of the free mode

// Whose thermal motion is greatest there.
std::size_t noisiest_mode(const Cantilever& cantilever, double frequency_hz) {
  const auto motion = [&](const Mode& mode) {
    return std::norm(mode_response(mode, frequency_hz)) * thermal_force_density(mode, 1.0);
  };
  return static_cast<std::size_t>(std::ranges::max_element(cantilever.modes, {}, motion) -
                                  cantilever.modes.begin());
}

void add_window_end(const Cantilever& cantilever, std::size_t index, std::span<const double> frequencies_hz,
                    double temperature_k, double windows_per_s, Eigen::MatrixXd& covariance) {
  const Mode& mode = cantilever.modes[index];
  const double w_mode = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double position_nm =
      engaged_spread * std::sqrt(2.0 * boltzmann_nn_nm_per_k * temperature_k / mode.stiffness_n_per_m);
  Eigen::MatrixX2d ends(covariance.rows(), 2);  // forces of standard deviations of dq and of dv
  for (std::size_t i = 0; i < frequencies_hz.size(); ++i) {
    const std::complex<double> share =
        mode_response(mode, frequencies_hz[i]) / tip_response(cantilever, frequencies_hz[i]) * 2.0 *
        mode.stiffness_n_per_m * windows_per_s / (w_mode * w_mode) * position_nm;
    const std::complex<double> of_position =
        share * std::complex(w_mode / mode.quality_factor, 2.0 * std::numbers::pi * frequencies_hz[i]);
    const std::complex<double> of_velocity = share * w_mode;
    const auto row = static_cast<Eigen::Index>(2 * i);
    ends.row(row) << of_position.real(), of_velocity.real();
    ends.row(row + 1) << of_position.imag(), of_velocity.imag();
  }
  covariance += ends * ends.transpose();
}

}  // namespace

void validate(const Noise& noise, std::size_t tones) {
  if (!(noise.temperature_k >= 0.0) || !std::isfinite(noise.temperature_k))
    throw std::invalid_argument(
        fmt::format("noise.temperature_k: {}, must be finite and at least 0", noise.temperature_k));
  const auto& detector = noise.detector_nm_per_sqrt_hz;
  if (detector.size() != 1 && detector.size() != tones)
    throw std::invalid_argument(
        fmt::format("noise.detector_nm_per_sqrt_hz: {} values, must be one, or one for each of {} tones",
                    detector.size(), tones));
  for (std::size_t i = 0; i < detector.size(); ++i)
    if (!(detector[i] >= 0.0) || !std::isfinite(detector[i]))
      throw std::invalid_argument(fmt::format(
          "noise.detector_nm_per_sqrt_hz[{}]: {}, must be finite and at least 0", i, detector[i]));
}

double thermal_force_density(const Mode& mode, double temperature_k) {
  return 2.0 * boltzmann_nn_nm_per_k * temperature_k * mode.stiffness_n_per_m /
         (std::numbers::pi * mode.frequency_hz * mode.quality_factor);
}

double tip_force_density(const Cantilever& cantilever, double frequency_hz, double temperature_k) {
  double motion = 0.0;
  for (const Mode& mode : cantilever.modes)
    motion += std::norm(mode_response(mode, frequency_hz)) * thermal_force_density(mode, temperature_k);
  return motion / std::norm(tip_response(cantilever, frequency_hz));
}

double detector_density(const Noise& noise, std::size_t tone) {
  const auto& densities = noise.detector_nm_per_sqrt_hz;
  return densities.size() == 1 ? densities.front() : densities.at(tone);
}

double force_quadrature_variance(const Cantilever& cantilever, const Noise& noise, std::size_t tone,
                                 double frequency_hz, double delta_f_hz, unsigned windows) {
  const double detector = detector_density(noise, tone);
  const double density = tip_force_density(cantilever, frequency_hz, noise.temperature_k) +
                         detector * detector / std::norm(tip_response(cantilever, frequency_hz));
  return density * delta_f_hz / windows;
}

Eigen::MatrixXd thermal_force_covariance(const Cantilever& cantilever, std::span<const double> frequencies_hz,
                                         double temperature_k, double delta_f_hz, unsigned windows) {
  const auto rows = static_cast<Eigen::Index>(2 * frequencies_hz.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(rows, rows);
  std::vector<std::size_t> measured_modes;
  for (std::size_t i = 0; i < frequencies_hz.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(2 * i);
    const double variance =
        tip_force_density(cantilever, frequencies_hz[i], temperature_k) * delta_f_hz / windows;
    covariance.diagonal().segment<2>(row).setConstant(variance);
    measured_modes.push_back(noisiest_mode(cantilever, frequencies_hz[i]));
  }
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m)
    if (std::ranges::count(measured_modes, m) > 1)
      add_window_end(cantilever, m, frequencies_hz, temperature_k, delta_f_hz / windows, covariance);
  return covariance;
}

}  // namespace combforce
