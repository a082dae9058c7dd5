// The Hertz contact on a Kelvin-Voigt solid: spring and dashpot side by side (Garcia, San Paulo 1999, Phys.
// Rev. B 60, 4961; with the Hertzian contact area as in Garcia, Gomez, Martinez, Patil, Dietz, Magerle 2006,
// Phys. Rev. Lett. 97, 016103).
//
//     F = p1 (delta^(3/2) + (3/2) p2 sqrt(delta) d(delta)/dt)  where that is positive, 0 elsewhere
//
// delta = p0 - d, d(delta)/dt = -velocity. p0: surface position, nm; p1 = (4/3) E* sqrt(R): contact strength,
// GPa nm^(1/2); p2 = eta/E: retardation time, us. A solid that recovers more slowly than the tip retracts
// lets go of it where delta = (3/2) p2 velocity: it does not pull.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct KelvinVoigt {
  static constexpr std::size_t parameters = 3;
  static constexpr std::array<std::size_t, 1> linear{1};
  static constexpr std::array<std::array<double, parameters>, 7> shapes{{{0.0, 1.0, 0.003},
                                                                         {0.0, 1.0, 0.01},
                                                                         {0.0, 1.0, 0.03},
                                                                         {0.0, 1.0, 0.1},
                                                                         {0.0, 1.0, 0.3},
                                                                         {0.0, 1.0, 1.0},
                                                                         {0.0, 1.0, 3.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0},
       {"contact_strength_gpa_sqrt_nm", 1e-6, 1e5, 1.0},
       {"retardation_time_us", 1e-6, 1e3, 0.1}}};
  static constexpr ModelInfo model{
      "kelvin_voigt",
      "F = p1 (delta^(3/2) + (3/2) p2 sqrt(delta) d(delta)/dt) >= 0 for delta = p0 - d >= 0, else 0",
      "Garcia et al. 2006, Phys. Rev. Lett. 97, 016103", info};

  // Of the force's zero behind the tip: it is clamped where depth < lag * velocity.
  static double lag_s(const double* p) { return 1.5 * p[2] * s_per_us; }

  template <typename T>
  static T force(const T* p, const T& d, double velocity_nm_per_s) {
    using std::sqrt;
    if (!(d < p[0])) return T(0.0);
    const T depth = p[0] - d;
    const T pressure = depth - 1.5 * p[2] * (s_per_us * velocity_nm_per_s);
    if (!(pressure > 0.0)) return T(0.0);
    return p[1] * sqrt(depth) * pressure;
  }

  static constexpr std::array<ModelTerm, 4> contact_terms{
      {{1, value_of_term}, {1, 0}, {1, 2}, {1, velocity_of_term}}};
  static std::array<double, 4> contact(const double* p, double depth, double velocity_nm_per_s) {
    const double pressure = depth - lag_s(p) * velocity_nm_per_s;
    if (!(pressure > 0.0 && depth > 0.0)) return {};
    const double root = std::sqrt(depth);
    return {root * pressure, root + 0.5 * pressure / root, -1.5 * s_per_us * velocity_nm_per_s * root,
            -lag_s(p) * root};
  }

  static constexpr std::array<ModelTerm, 0> tail_terms{};

 private:
  static constexpr double s_per_us = 1e-6;
};

}  // namespace combforce
