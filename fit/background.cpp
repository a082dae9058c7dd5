#include "fit/background.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace combforce {
namespace {

constexpr double least_driven = 1e-3;  // of the greatest free motion; what is below it is noise, or leakage

struct LinearForce {
  double stiffness = 0.0;  // Re kappa, nN/nm
  double damping = 0.0;    // Im kappa/w, nN s/nm
};

struct Weighted {
  double weight = 0.0, stiffness = 0.0;
  double squares = 0.0, damping = 0.0;

  void add(double w, double angular_hz, std::complex<double> kappa) {
    weight += w;
    stiffness += w * kappa.real();
    squares += w * angular_hz * angular_hz;
    damping += w * angular_hz * kappa.imag();
  }
};

std::size_t answering_mode(const Cantilever& cantilever, double frequency_hz) {
  std::size_t most = 0;
  double response = 0.0;
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m)
    if (const double one = std::abs(mode_response(cantilever.modes[m], frequency_hz)); one > response) {
      response = one;
      most = m;
    }
  return most;
}

Mode changed(Mode mode, const LinearForce& background, std::size_t number) {
  const double angular_hz = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double mass = mode.stiffness_n_per_m / (angular_hz * angular_hz);
  const double stiffness = mode.stiffness_n_per_m - background.stiffness;
  const double damping = mode.stiffness_n_per_m / (angular_hz * mode.quality_factor) - background.damping;
  if (!(stiffness > 0.0) || !(damping > 0.0))
    throw std::invalid_argument(fmt::format(
        "free_response.lifted_nm: mode {} would have stiffness {} N/m and damping {} kg/s: not of "
        "the drive that mean_nm is of",
        number, stiffness, damping));
  const double angular = std::sqrt(stiffness / mass);
  mode.stiffness_n_per_m = stiffness;
  mode.frequency_hz = angular / (2.0 * std::numbers::pi);
  mode.quality_factor = stiffness / (angular * damping);
  return mode;
}

}  // namespace

Cantilever near_surface(const Cantilever& cantilever, std::span<const double> frequencies_hz,
                        std::span<const std::complex<double>> free_nm,
                        std::span<const std::complex<double>> lifted_nm) {
  double greatest = 0.0;
  for (const std::complex<double> tone : free_nm) greatest = std::max(greatest, std::abs(tone));
  std::vector<Weighted> sums(cantilever.modes.size());
  for (std::size_t i = 0; i < frequencies_hz.size(); ++i) {
    if (!(std::abs(free_nm[i]) > least_driven * greatest)) continue;
    const std::complex<double> kappa =
        (1.0 - free_nm[i] / lifted_nm[i]) / tip_response(cantilever, frequencies_hz[i]);
    sums[answering_mode(cantilever, frequencies_hz[i])].add(
        std::norm(free_nm[i]), 2.0 * std::numbers::pi * frequencies_hz[i], kappa);
  }
  Cantilever near = cantilever;
  for (std::size_t m = 0; m < sums.size(); ++m)
    if (sums[m].weight > 0.0)
      near.modes[m] =
          changed(near.modes[m], {sums[m].stiffness / sums[m].weight, sums[m].damping / sums[m].squares}, m);
  return near;
}

}  // namespace combforce
