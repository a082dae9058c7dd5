// Drive schemes: which forces make the free cantilever move as named (paper, equations 11 and 12).
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "fit/cantilever.hpp"

namespace combforce {

enum class DriveScheme : std::uint8_t {
  equal_energy,     // A_i proportional to k_i^(-1/2), k_i of the mode nearest to the tone
  equal_amplitude,  // all A_i alike
  amplitudes        // A_i as listed
};

struct Drive {
  DriveScheme scheme = DriveScheme::equal_energy;
  double total_amplitude_nm = 50.0;   // sum of the free amplitudes (half the greatest peak-to-peak), > 0
  std::vector<double> amplitudes_nm;  // scheme `amplitudes`: one a driven tone, >= 0
  std::vector<double> phases_rad;     // of the drive forces at stream sample 0; empty: all 0

  bool operator==(const Drive&) const = default;
};

// Peak phasors of the drive forces at the tip, nN, one a frequency, such that |chi F| are the free
// amplitudes. Throws std::invalid_argument when the lists do not match `frequencies_hz` or a value is out of
// range.
std::vector<std::complex<double>> drive_forces(const Drive& drive, const Cantilever& cantilever,
                                               std::span<const double> frequencies_hz);

}  // namespace combforce
