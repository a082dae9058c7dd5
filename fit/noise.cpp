#include "fit/noise.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "fit/units.hpp"

namespace combforce {

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

double force_quadrature_variance(const Cantilever& cantilever, const Noise& noise, std::size_t tone,
                                 double frequency_hz, double delta_f_hz, unsigned windows) {
  const auto& densities = noise.detector_nm_per_sqrt_hz;
  const double detector = densities.size() == 1 ? densities.front() : densities.at(tone);
  const double density = tip_force_density(cantilever, frequency_hz, noise.temperature_k) +
                         detector * detector / std::norm(tip_response(cantilever, frequency_hz));
  return density * delta_f_hz / windows;
}

}  // namespace combforce
