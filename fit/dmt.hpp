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
  static constexpr bool has_tail = true;
  static constexpr std::array<std::array<double, parameters>, 4> shapes{
      {{0.0, 1.0, 1.0, 0.12}, {0.0, 1.0, 1.0, 0.25}, {0.0, 1.0, 1.0, 0.5}, {0.0, 1.0, 1.0, 1.0}}};
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

  // Returns F; gradient[k] = dF/dp_k.
  static double derivatives(const double* p, double d, double* gradient) {
    if (d < p[0]) {
      const double depth = p[0] - d;
      const double root = std::sqrt(depth);
      gradient[0] = 1.5 * p[1] * root;
      gradient[1] = depth * root;
      gradient[2] = -1.0;
      gradient[3] = 0.0;
      return p[1] * gradient[1] - p[2];
    }
    const double inverse = 1.0 / (d - p[0] + p[3]);
    const double ratio = p[3] * inverse;
    const double slope = -2.0 * p[2] * ratio * inverse;
    gradient[0] = slope * ratio;
    gradient[1] = 0.0;
    gradient[2] = -ratio * ratio;
    gradient[3] = slope * (1.0 - ratio);
    return p[2] * gradient[2];
  }

  static double tail_length(const double* p) { return p[3]; }
};

}  // namespace combforce
