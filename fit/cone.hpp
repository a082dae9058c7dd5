// A rigid cone indenting an elastic half-space (Sneddon 1965, Int. J. Eng. Sci. 3, 47 with E* =
// E/(1 - nu^2)).
//
//     F = p1 (p0 - d)^2  for d <= p0,   0 beyond
//
// p0: surface position, nm; p1 = (2/pi) E* tan(theta): contact strength, GPa = nN/nm^2, theta the cone's half
// opening angle, from its axis.
#pragma once

#include <array>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct Cone {
  static constexpr std::size_t parameters = 2;
  static constexpr std::array<std::size_t, 1> linear{1};
  static constexpr std::array<std::array<double, parameters>, 1> shapes{{{0.0, 1.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0}, {"contact_strength_gpa", 1e-6, 1e5, 1.0}}};
  static constexpr ModelInfo model{"cone", "F = p1 (p0 - d)^2 for d <= p0, else 0", "Sneddon 1965", info};

  template <typename T>
  static T force(const T* p, const T& d) {
    if (!(d < p[0])) return T(0.0);
    const T depth = p[0] - d;
    return p[1] * depth * depth;
  }

  static constexpr std::array<ModelTerm, 2> contact_terms{{{1, value_of_term}, {1, 0}}};
  static std::array<double, 2> contact(const double*, double depth) { return {depth * depth, 2.0 * depth}; }

  static constexpr std::array<ModelTerm, 0> tail_terms{};
};

}  // namespace combforce
