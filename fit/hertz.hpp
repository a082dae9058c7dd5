// The Hertz model: a sphere indenting an elastic half-space (paper, equation 15).
//
//     F = p1 (p0 - d)^(3/2)  for d <= p0,   0 beyond
//
// p0: surface position, nm; p1 = (4/3) E* sqrt(R): contact strength, GPa nm^(1/2) = nN/nm^(3/2).
//
// What a model offers, here and in dmt.hpp (model_list.hpp holds the list):
//   force()           the formula, for double and for automatic differentiation.
//   linear            the parameters that enter linearly: F = sum over them of p_k phi_k(d; other ones), or
//                     where there are none (exponential.hpp) phi(d; p).
//   contact(), tail() the phi_k and their derivatives at depth p0 - d >= 0, and at height d - p0 > 0;
//                     contact_terms and tail_terms say which. Those not listed vanish on that side.
//                     Where the force depends on the tip's velocity (kelvin_voigt.hpp), force() and contact()
//                     take it last, nm/s, and lag_s() says from where on the force is clamped at 0.
//   tail_length()     in the tail the force is analytic in d but for a pole no closer than this below p0.
//   least_height_nm   where the force has a pole at p0 itself (lennard_jones.hpp), it is constant below this;
//   wall_height_nm(p) there, where it repels.
//   release_height_nm() where the force depends on history (jkr.hpp), contact lasts up to so far above p0:
//                     tail() is of a tip still engaged, and force() takes last whether it is. Its derivatives
//                     are release_gradient(). Terms list a derivative by what moves p0 or the release even
//                     where it is 0: it takes up the jump there.
//   ratio             a parameter that enters by its ratio to the one linear parameter (jkr.hpp).
//   decay             the parameter that is the length of an exponential decay (exponential.hpp).
//   shapes            start values of the nonlinear parameters but p0; the linear ones are 1.
// A polynomial offers its powers instead of linear and all that follows (polynomial.hpp).
// p[0] is the surface position, or where there is none (exponential.hpp) shifts F along d as one. F or its
// derivatives may jump there, and where contact is lost, alone; in contact F may behave as (p0 - d)^(3/2) at
// p0, and as the root of the distance where contact is lost.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

struct Hertz {
  static constexpr std::size_t parameters = 2;
  static constexpr std::array<std::size_t, 1> linear{1};
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

  static constexpr std::array<ModelTerm, 2> contact_terms{{{1, value_of_term}, {1, 0}}};
  static std::array<double, 2> contact(const double*, double depth) {
    const double root = std::sqrt(depth);
    return {depth * root, 1.5 * root};
  }

  static constexpr std::array<ModelTerm, 0> tail_terms{};
};

}  // namespace combforce
