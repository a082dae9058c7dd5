// A rigid flat-ended cylinder indenting an elastic half-space (Sneddon 1965, Int. J. Eng. Sci. 3, 47, with
// E* = E/(1 - nu^2)).
//
//     F = p1 (p0 - d)  for d <= p0,   0 beyond
//
// p0: surface position, nm; p1 = 2 E* a: contact stiffness, N/m, a the cylinder's radius. The slope of F
// jumps at p0 by p1.
#pragma once

#include <array>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct FlatPunch {
  static constexpr std::size_t parameters = 2;
  static constexpr std::array<std::size_t, 1> linear{1};
  static constexpr std::array<std::array<double, parameters>, 1> shapes{{{0.0, 1.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0}, {"contact_stiffness_n_per_m", 1e-6, 1e5, 1.0}}};
  static constexpr ModelInfo model{"flat_punch", "F = p1 (p0 - d) for d <= p0, else 0", "Sneddon 1965", info};

  template <typename T>
  static T force(const T* p, const T& d) {
    if (!(d < p[0])) return T(0.0);
    return p[1] * (p[0] - d);
  }

  static constexpr std::array<ModelTerm, 2> contact_terms{{{1, value_of_term}, {1, 0}}};
  static std::array<double, 2> contact(const double*, double depth) { return {depth, 1.0}; }

  static constexpr std::array<ModelTerm, 0> tail_terms{};
};

}  // namespace combforce
