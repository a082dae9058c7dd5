// Where the drive acts, and what that makes of the tip's free motion.
//
// A force at the tip (or one spread so that each mode answers as to a force at the tip) moves it by
// (chi/chi_V) V. A shaker moves the base instead, and the tip with it. Of base motion b mode m answers with
//     q_m = G_m b,   G_m = Gamma_m w^2/(w_m^2 - w^2 + i w w_m/Q_m),
// Gamma_m its participation: the beam is driven by inertia alone, in the frame of its base, in which damping
// acts too (clamped beam, mode m: Gamma_m = 4 (-1)^(m+1) sigma_m/C_m, sigma_m = (sinh C - sin C)/(cosh C +
// cos C): 1.566, -0.868, 0.509, -0.364; e.g. Melcher, Hu, Raman, Appl. Phys. Lett. 91, 053101 (2007)). The
// detector sees V = b sum_m G_m/alpha_m, the tip's motion in the laboratory is
//     d_free = b (1 + sum_m G_m):
// deflection plus base. A force at the tip adds to it what it always does, (chi/chi_V) (V - V_free).
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/cantilever.hpp"

namespace combforce {

struct Excitation {
  enum class Kind : std::uint8_t { tip, base };
  Kind kind = Kind::tip;
  // Gamma_m, one a mode; empty: modes 1, 2, … of a clamped rectangular beam. Of base excitation alone.
  std::vector<double> participation;

  bool operator==(const Excitation&) const = default;
};

// Throws std::invalid_argument naming field, value and bound.
void validate(const Excitation& excitation, const Cantilever& cantilever);

// Gamma of mode 1, 2, … of a clamped-free Euler-Bernoulli beam.
double beam_participation(unsigned mode);

// The tip's motion less (chi/chi_V) V, nm, one a tone: the same with and without a force at the tip. 0 for
// drives at the tip. `apparent_nm`: (chi/chi_V) V of the free motion, at tones that are driven: elsewhere it
// is noise, and means nothing as the answer to a base. Reentrant.
std::vector<std::complex<double>> motion_beside_deflection(const Excitation& excitation,
                                                           const Cantilever& cantilever,
                                                           std::span<const double> frequencies_hz,
                                                           std::span<const std::complex<double>> apparent_nm);

}  // namespace combforce
