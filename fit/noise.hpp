// The noise a fit reckons with: thermal forces on every mode and the detector's own.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "fit/cantilever.hpp"

namespace combforce {

// All 0: not known, as if there were none.
struct Noise {
  double temperature_k = 0.0;  // >= 0
  // Detector noise as equivalent tip deflection, nm/sqrt(Hz), one-sided: one value for all tones, or one a
  // tone.
  std::vector<double> detector_nm_per_sqrt_hz{0.0};  // each >= 0

  bool operator==(const Noise&) const = default;
};

// Throws std::invalid_argument naming field, value and bound. `tones`: of the comb.
void validate(const Noise& noise, std::size_t tones);

// One-sided density of the thermal force on a mode, nN^2/Hz: 2 kB T k/(pi f Q) = 4 kB T k/(w Q)
// (fluctuation-dissipation; paper, equation 14).
double thermal_force_density(const Mode& mode, double temperature_k);

// The same as one force at the tip at a tone: sum_m |chi_m/chi|^2 S_m, nN^2/Hz.
double tip_force_density(const Cantilever& cantilever, double frequency_hz, double temperature_k);

// Variance of each quadrature of the measured force phasor at tone `tone`, nN^2: (tip_force_density +
// detector^2/|chi|^2) * Delta f / windows. Thermal motion is real motion and enters as force; the detector's
// noise through chi^-1.
double force_quadrature_variance(const Cantilever& cantilever, const Noise& noise, std::size_t tone,
                                 double frequency_hz, double delta_f_hz, unsigned windows);

// Detector noise at a tone, nm/sqrt(Hz).
double detector_density(const Noise& noise, std::size_t tone);

// Covariance of the thermal force phasors at these frequencies, rows (re, im) of each, nN^2, as far as it can
// be told without knowing the surface (engaged_heat.hpp tells the rest).
//
// On the diagonal tip_force_density * Delta f / windows. Besides, a window of length T ends in another state
// of a mode than it began in, and the change (dq, dv) of its position and velocity appears as a force
//     b_m(w) = (chi_m/chi) (2 k_m/(w_m^2 T)) [dv + (i w + w_m/Q_m) dq]
// at all frequencies alike (the equation of motion, integrated by parts against exp(-iwt)); n contiguous
// windows are one of length nT. Added for every mode whose thermal motion is the greatest at two tones or
// more, with standard deviations of dq and of dv/w_m of beta sqrt(2 kB T/k_m). beta = 2: an engaged tip moves
// more than a free one. Where a mode has one tone b nearly cancels against the window's own forces, with
// which the mode ends.
Eigen::MatrixXd thermal_force_covariance(const Cantilever& cantilever, std::span<const double> frequencies_hz,
                                         double temperature_k, double delta_f_hz, unsigned windows);

}  // namespace combforce
