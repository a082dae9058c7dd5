// The Hertz model: a sphere indenting an elastic half-space (paper, equation 15).
//
//     F = p1 (p0 - d)^(3/2)  for d <= p0,   0 beyond
//
// p0: surface position, nm; p1 = (4/3) E* sqrt(R): contact strength, GPa nm^(1/2) = nN/nm^(3/2).
//
// What a model offers, here and in dmt.hpp, is what model_list.hpp, the fitter and the simulator rely on:
//   force()        the formula, for double and for automatic differentiation
//   derivatives()  the force and its derivatives with respect to every parameter
//   linear         which parameters enter linearly: F = sum of p_k dF/dp_k over them
//   has_tail       whether a force acts beyond p0; where it does it is analytic in d up to tail_length()
//   below p0 shapes         start values of the nonlinear parameters but p0 (the other entries are not used)
// p[0] is always the surface position: the only place where F or a derivative of it may jump.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "fit/force_model.hpp"

namespace combforce {

struct Hertz {
  static constexpr std::size_t parameters = 2;
  static constexpr std::array<std::size_t, 1> linear{1};
  static constexpr bool has_tail = false;
  static constexpr std::array<std::array<double, parameters>, 1> shapes{{{0.0, 1.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0}, {"contact_strength_gpa_sqrt_nm", 1e-6, 1e5, 1.0}}};
  static constexpr ModelInfo model{"hertz", "F = p1 (p0 - d)^(3/2) for d <= p0, else 0",
                                   "Forchheimer et al. 2014, equation 15", info};

  template <typename T>
  static T force(const T* p, const T& d) {
    using std::sqrt;
    if (!(d < p[0])) return T(0.0);
    const T depth = p[0] - d;
    return p[1] * depth * sqrt(depth);
  }

  // Returns F; gradient[k] = dF/dp_k.
  static double derivatives(const double* p, double d, double* gradient) {
    const double depth = d < p[0] ? p[0] - d : 0.0;
    const double root = std::sqrt(depth);
    gradient[0] = 1.5 * p[1] * root;
    gradient[1] = depth * root;
    return p[1] * gradient[1];
  }

  static double tail_length(const double*) { return std::numeric_limits<double>::infinity(); }
};

}  // namespace combforce
