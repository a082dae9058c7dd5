// From fitted thermal spectra to a calibrated cantilever: stiffness and sensitivity of every mode.
//
// Equipartition, k_m <q_m^2> = kB T in every mode with q_m = alpha_m V_m:
//     k_m alpha_m^2 P_m = c kB T,
// P_m the variance (V^2) that the fit found and c a correction factor that is 1 for the k and alpha of a
// mode. Makers of instruments put other things into c: 0.971 makes k_1 of a beam its static stiffness; 0.817
// does so when alpha was found by pressing on a hard surface; 0.9 is what JPK states for its PFQNM-LC-A.
// Reentrant.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fit/cantilever.hpp"
#include "fit/thermal_beam.hpp"
#include "fit/thermal_fit.hpp"

namespace combforce {

// Which of the two is known; equipartition gives the other.
enum class KnownQuantity : std::uint8_t {
  sensitivity,  // nm/V
  stiffness,    // N/m
  sader         // stiffness, from plan dimensions and fluid
};

// What is known of one mode only is carried to the others as in an Euler-Bernoulli beam (thermal_beam.hpp).
enum class ModeScaling : std::uint8_t {
  stiffness,   // k_m/k_1 = (C_m/C_1)^4; sensitivities then by equipartition
  sensitivity  // alpha_m/alpha_1 = end_slope(1)/end_slope(m); stiffnesses then by equipartition
};

struct CalibrationSettings {
  double temperature_k = 0.0;      // > 0
  double correction_factor = 1.0;  // c, > 0
  KnownQuantity known = KnownQuantity::sensitivity;
  std::vector<double> values;   // of the known quantity, each > 0: one a mode, or one for the first mode;
                                // empty for sader
  double relative_error = 0.0;  // standard error of the known quantity, >= 0; for sader of b^2 L, rho and eta
  ModeScaling scaling = ModeScaling::stiffness;
  std::vector<unsigned> mode_numbers;  // of the beam, ascending from 1 on; empty: 1, 2, …
  std::optional<BeamInFluid> beam;     // needed for sader
};

// A mode as fitted, with its (ln f0, ln Q, ln P) covariance.
struct MeasuredMode {
  FittedMode mode;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
MeasuredMode measured_mode(const ThermalFit& fit, std::size_t mode);

// With its uncertainty: statistical, and of the known quantity; NaN where it is not determined. Throws
// std::invalid_argument naming field, value and bound.
Cantilever calibrate_thermal(std::span<const MeasuredMode> modes, const CalibrationSettings& settings);

}  // namespace combforce
