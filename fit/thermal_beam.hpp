// What the theory of a beam gives a thermal calibration: stiffness from plan dimensions and the damping of a
// fluid (Sader's method), and how stiffness and optical sensitivity go with the mode.
//
// Stiffness here is always that of a mode, k_m = kB T/<q_m^2> with q_m the mode's deflection at the tip: what
// Cantilever wants. The beam's static stiffness is k_static = (12/C_1^4) k_1 = 0.971 k_1. Reentrant.
#pragma once

#include <complex>

namespace combforce {

// Plan dimensions of a rectangular beam, and the fluid it moves in.
struct BeamInFluid {
  double length_um = 0.0, width_um = 0.0;  // > 0
  double density_kg_per_m3 = 0.0;          // of the fluid, > 0
  double viscosity_pa_s = 0.0;             // > 0

  bool operator==(const BeamInFluid&) const = default;
};

// Throws std::invalid_argument naming field, value and bound.
void validate(const BeamInFluid& beam);

// Re = rho w b^2/(4 eta), w = 2 pi f.
double reynolds_number(const BeamInFluid& beam, double frequency_hz);

// Gamma(Re) of an oscillating rectangular plate of no thickness: that of a circular cylinder, exact, times
// the correction Omega(Re) = Omega_r + i Omega_i, a fit of rational functions of log10 Re good to 0.1 % for
// 1e-6 <= Re <= 1e4 (Sader, J. Appl. Phys. 84, 64 (1998), equations 20 and 21; time goes as exp(-iwt)).
// Throws std::invalid_argument outside that range.
std::complex<double> hydrodynamic_function(double reynolds);

// k_m = (pi/16) rho b^2 L Q w^2 Gamma_i(w), N/m, for any mode m of a clamped rectangular beam with L >> b,
// Q >> 1; then k_static = 0.1906 rho b^2 L Q w^2 Gamma_i for the first (Sader, Chon, Mulvaney, Rev. Sci.
// Instrum. 70, 3967 (1999), equation 2). For higher modes the flow is no longer two-dimensional once their
// wavelength nears the width. The derivative is for errors.
struct SaderStiffness {
  double stiffness_n_per_m = 0.0;
  double log_by_log_frequency = 0.0;  // d ln k/d ln f at constant Q; d ln k/d ln Q is 1
};
SaderStiffness sader_stiffness(const BeamInFluid& beam, double frequency_hz, double quality_factor);

// C_m of a clamped-free Euler-Bernoulli beam, cos C cosh C = -1: 1.875, 4.694, … mode counts from 1.
double beam_eigenvalue(unsigned mode);

// k_m/k_1 = (C_m/C_1)^4: every mode has a quarter of the beam's mass as effective mass at the tip.
double beam_stiffness_ratio(unsigned mode);

// Slope at the end over deflection at the end, times the length: C/(coth C - cot C); 1.3765, 4.7812, …; 3/2
// for a force at the end. A spot that is small against the wavelength measures slope, so that
// alpha_m/alpha_1 = end_slope(1)/end_slope(m), and alpha_1 is 1.0897 times what pressing on a hard surface
// gives.
double beam_end_slope(unsigned mode);

}  // namespace combforce
