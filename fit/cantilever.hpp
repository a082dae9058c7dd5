// The cantilever as N eigenmodes that share the force at the tip.
//
// Conventions: d(t) = Re sum_i D_i exp(+i w_i t), D_i peak phasors; paper, equations 1-5.
#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <vector>

namespace combforce {

struct Mode {
  double frequency_hz = 0.0;          // f_m > 0
  double quality_factor = 0.0;        // Q_m > 0
  double stiffness_n_per_m = 0.0;     // k_m > 0
  double sensitivity_nm_per_v = 1.0;  // alpha_m: tip deflection of this mode per volt at the detector, != 0

  bool operator==(const Mode&) const = default;
};

// Of a mode's calibration, in the order of its fields. NaN: not known. Errors of different modes may be
// correlated through what they share; that is not told here.
struct ModeUncertainty {
  std::array<double, 4> std_errors{};   // in the fields' units, >= 0
  std::array<double, 6> correlation{};  // strict upper triangle, row by row

  bool operator==(const ModeUncertainty& other) const;  // NaN equals NaN
};

// Covariance of (ln f, ln Q, ln k, ln |alpha|), and back.
Eigen::Matrix4d log_covariance(const Mode& mode, const ModeUncertainty& uncertainty);
ModeUncertainty uncertainty_of(const Mode& mode, const Eigen::Matrix4d& log_covariance);

struct Cantilever {
  std::vector<Mode> modes;                        // at least one
  std::vector<ModeUncertainty> uncertainty = {};  // of the calibration: one a mode, or empty: not known

  bool operator==(const Cantilever&) const = default;
};

// Throws std::invalid_argument naming mode, field, value and bound.
void validate(const Cantilever& cantilever);

// chi_m(f) = (1/k_m) / (1 - f^2/f_m^2 + i f/(f_m Q_m)), nm/nN (paper, equation 5).
std::complex<double> mode_response(const Mode& mode, double frequency_hz);

// chi = sum_m chi_m: tip deflection per force at the tip, nm/nN.
std::complex<double> tip_response(const Cantilever& cantilever, double frequency_hz);

// chi_V = sum_m chi_m / alpha_m: detector signal per force at the tip, V/nN. The optical lever sees the
// slope, hence a sensitivity per mode; tip deflection is (chi/chi_V) V.
std::complex<double> detector_response(const Cantilever& cantilever, double frequency_hz);

// chi/chi_V at a tone, nm/V: what turns a detector phasor into tip deflection for a force at the tip.
std::complex<double> tip_per_volt(const Cantilever& cantilever, double frequency_hz);

// Ring-down time of the amplitude, Q/(pi f), s; and the longest of all modes.
double ring_down_s(const Mode& mode);
double longest_ring_down_s(const Cantilever& cantilever);

}  // namespace combforce
