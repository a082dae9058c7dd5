// A sphere above a half-space of Lennard-Jones atoms (Israelachvili, Intermolecular and Surface Forces; the
// integrated 12-6 potential, used for dynamic AFM by Giessibl 1997, Phys. Rev. B 56, 16010).
//
//     F = p1 (-1/z^2 + p2^6/(30 z^8)),   z = d - p0
//
// p0: surface position (of its atoms' centres), nm; p1 = H R/6: van der Waals strength, nN nm^2, H Hamaker's
// constant and R the tip's radius; p2 = sigma: where the pair potential is zero, nm. F has a pole at z = 0,
// which the tip never reaches; below least_height_nm it stays what it is there.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct LennardJones {
  static constexpr std::size_t parameters = 3;
  static constexpr std::array<std::size_t, 1> linear{1};
  static constexpr std::array<std::array<double, parameters>, 7> shapes{{{0.0, 1.0, 0.15},
                                                                         {0.0, 1.0, 0.2},
                                                                         {0.0, 1.0, 0.27},
                                                                         {0.0, 1.0, 0.36},
                                                                         {0.0, 1.0, 0.48},
                                                                         {0.0, 1.0, 0.65},
                                                                         {0.0, 1.0, 0.9}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0},
       {"van_der_waals_strength_nn_nm2", 1e-6, 1e4, 0.1},
       {"sigma_nm", 0.05, 5.0, 0.3}}};
  static constexpr ModelInfo model{"lennard_jones", "F = p1 (-1/z^2 + p2^6/(30 z^8)), z = d - p0",
                                   "Israelachvili, Intermolecular and Surface Forces; Giessibl 1997", info};

  static constexpr double least_height_nm = 0.02;
  static double wall_height_nm(const double* p) { return p[2] / 1.7627; }  // 30^(1/6): F = 0

  template <typename T>
  static T force(const T* p, const T& d) {
    T z = d - p[0];
    if (!(z > least_height_nm)) z = T(least_height_nm);
    const T inverse = 1.0 / (z * z), ratio = p[2] * p[2] * inverse;
    return p[1] * inverse * (ratio * ratio * ratio / 30.0 - 1.0);
  }

  static constexpr std::array<ModelTerm, 2> contact_terms{{{1, value_of_term}, {1, 2}}};
  static std::array<double, 2> contact(const double* p, double) {
    const auto [value, slope, by_sigma] = tail(p, 0.0);
    return {value, by_sigma};
  }

  static constexpr std::array<ModelTerm, 3> tail_terms{{{1, value_of_term}, {1, 0}, {1, 2}}};
  static std::array<double, 3> tail(const double* p, double height) {
    const double z = std::max(height, least_height_nm);
    const double inverse = 1.0 / (z * z), ratio = p[2] * p[2] * inverse;
    const double repulsion = inverse * ratio * ratio * ratio / 30.0;
    const double by_surface = height > least_height_nm ? (8.0 * repulsion - 2.0 * inverse) / z : 0.0;
    return {repulsion - inverse, by_surface, 6.0 * repulsion / p[2]};
  }
  static double tail_length(const double*) { return least_height_nm; }
};

}  // namespace combforce
