// The Derjaguin-Muller-Toporov model: Hertzian contact under constant adhesion, van der Waals attraction
// beyond (paper, equation 16).
//
//     F = -p2 + p1 (p0 - d)^(3/2)        for d <= p0
//     F = -p2 (p3 / (d - p0 + p3))^2     for d >  p0
//
// p0: surface position, nm; p1 = (4/3) E* sqrt(R): contact strength, GPa nm^(1/2); p2 = H R / (6 p3^2):
// adhesion, nN (the paper drops the 6); p3: contact distance, nm, > 0. The pole at d = p0 - p3 lies where the
// first line holds, so it is never met. F is continuous at p0, its slope jumps there by 2 p2/p3.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct Dmt {
  static constexpr std::size_t parameters = 4;
  static constexpr std::array<std::size_t, 2> linear{1, 2};
  static constexpr std::array<std::array<double, parameters>, 12> shapes{{{0.0, 1.0, 1.0, 0.08},
                                                                          {0.0, 1.0, 1.0, 0.107},
                                                                          {0.0, 1.0, 1.0, 0.144},
                                                                          {0.0, 1.0, 1.0, 0.192},
                                                                          {0.0, 1.0, 1.0, 0.258},
                                                                          {0.0, 1.0, 1.0, 0.346},
                                                                          {0.0, 1.0, 1.0, 0.463},
                                                                          {0.0, 1.0, 1.0, 0.62},
                                                                          {0.0, 1.0, 1.0, 0.831},
                                                                          {0.0, 1.0, 1.0, 1.11},
                                                                          {0.0, 1.0, 1.0, 1.49},
                                                                          {0.0, 1.0, 1.0, 2}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0},
       {"contact_strength_gpa_sqrt_nm", 1e-6, 1e5, 1.0},
       {"adhesion_nn", 1e-4, 1e4, 1.0},
       {"contact_distance_nm", 0.01, 100.0, 0.5}}};
  static constexpr ModelInfo model{"dmt",
                                   "F = -p2 + p1 (p0 - d)^(3/2) for d <= p0, else -p2 (p3/(d - p0 + p3))^2",
                                   "Forchheimer et al. 2014, equation 16", info};

  template <typename T>
  static T force(const T* p, const T& d) {
    using std::sqrt;
    if (d < p[0]) {
      const T depth = p[0] - d;
      return p[1] * depth * sqrt(depth) - p[2];
    }
    const T ratio = p[3] / (d - p[0] + p[3]);
    return -p[2] * ratio * ratio;
  }

  static constexpr std::array<ModelTerm, 3> contact_terms{{{1, value_of_term}, {1, 0}, {2, value_of_term}}};
  static std::array<double, 3> contact(const double*, double depth) {
    const double root = std::sqrt(depth);
    return {depth * root, 1.5 * root, -1.0};
  }

  static constexpr std::array<ModelTerm, 3> tail_terms{{{2, value_of_term}, {2, 0}, {2, 3}}};
  static std::array<double, 3> tail(const double* p, double height) {
    const double inverse = 1.0 / (height + p[3]);
    const double ratio = p[3] * inverse;
    const double slope = -2.0 * ratio * inverse;
    return {-ratio * ratio, slope * ratio, slope * (1.0 - ratio)};
  }
  static double tail_length(const double* p) { return p[3]; }
};

}  // namespace combforce
