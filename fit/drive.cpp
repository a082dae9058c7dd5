#include "fit/drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace combforce {
namespace {

void check(const Drive& drive, std::size_t tones) {
  if (drive.scheme == DriveScheme::amplitudes) {
    if (drive.amplitudes_nm.size() != tones)
      throw std::invalid_argument(fmt::format("drive.amplitudes_nm: {} values for {} driven tones",
                                              drive.amplitudes_nm.size(), tones));
    for (std::size_t i = 0; i < tones; ++i)
      if (!(drive.amplitudes_nm[i] >= 0.0) || !std::isfinite(drive.amplitudes_nm[i]))
        throw std::invalid_argument(fmt::format("drive.amplitudes_nm[{}]: {}, must be finite and at least 0",
                                                i, drive.amplitudes_nm[i]));
  } else if (!(drive.total_amplitude_nm > 0.0) || !std::isfinite(drive.total_amplitude_nm)) {
    throw std::invalid_argument(
        fmt::format("drive.total_amplitude_nm: {}, must be positive and finite", drive.total_amplitude_nm));
  }
  if (!drive.phases_rad.empty() && drive.phases_rad.size() != tones)
    throw std::invalid_argument(
        fmt::format("drive.phases_rad: {} values for {} driven tones", drive.phases_rad.size(), tones));
  for (std::size_t i = 0; i < drive.phases_rad.size(); ++i)
    if (!std::isfinite(drive.phases_rad[i]))
      throw std::invalid_argument(
          fmt::format("drive.phases_rad[{}]: {}, must be finite", i, drive.phases_rad[i]));
}

const Mode& nearest_mode(const Cantilever& cantilever, double frequency_hz) {
  return *std::ranges::min_element(cantilever.modes, {}, [frequency_hz](const Mode& mode) {
    return std::abs(mode.frequency_hz - frequency_hz);
  });
}

std::vector<double> amplitudes_nm(const Drive& drive, const Cantilever& cantilever,
                                  std::span<const double> frequencies_hz) {
  if (drive.scheme == DriveScheme::amplitudes) return drive.amplitudes_nm;
  std::vector<double> amplitudes(frequencies_hz.size(), 1.0);
  if (drive.scheme == DriveScheme::equal_energy)
    std::ranges::transform(frequencies_hz, amplitudes.begin(), [&](double frequency_hz) {
      return 1.0 / std::sqrt(nearest_mode(cantilever, frequency_hz).stiffness_n_per_m);
    });
  const double sum = std::accumulate(amplitudes.begin(), amplitudes.end(), 0.0);
  for (double& amplitude : amplitudes) amplitude *= drive.total_amplitude_nm / sum;
  return amplitudes;
}

}  // namespace

std::vector<std::complex<double>> drive_forces(const Drive& drive, const Cantilever& cantilever,
                                               std::span<const double> frequencies_hz) {
  validate(cantilever);
  check(drive, frequencies_hz.size());
  const std::vector<double> amplitudes = amplitudes_nm(drive, cantilever, frequencies_hz);
  std::vector<std::complex<double>> forces(frequencies_hz.size());
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const double phase = drive.phases_rad.empty() ? 0.0 : drive.phases_rad[i];
    forces[i] = std::polar(amplitudes[i] / std::abs(tip_response(cantilever, frequencies_hz[i])), phase);
  }
  return forces;
}

}  // namespace combforce
