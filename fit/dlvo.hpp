// Two charged surfaces in an electrolyte: double-layer repulsion that decays with the Debye length, and van
// der Waals attraction, cut off at closest approach (Derjaguin-Landau-Verwey-Overbeek; sphere on plane as in
// Butt, Cappella, Kappl 2005, Surf. Sci. Rep. 59, 1).
//
//     F = p1 exp(-z/p2) - p3 (D0/(z + D0))^2   for z = d - p0 > 0
//     F = p1 exp(-z/p2) - p3                   for z <= 0
//
// p0: closest approach, where the surfaces are D0 = 0.165 nm apart (Israelachvili, Intermolecular and Surface
// Forces), nm; p1: repulsion there, nN; p2: Debye length, nm; p3 = H R/(6 D0^2): attraction there, nN. The
// repulsion alone does not know p0 (it is degenerate with p1): the attraction tells. 30 Debye lengths below
// p0 and deeper the repulsion stays what it is there.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct Dlvo {
  static constexpr std::size_t parameters = 4;
  static constexpr std::array<std::size_t, 2> linear{1, 3};
  static constexpr std::array<std::array<double, parameters>, 8> shapes{{{0.0, 1.0, 0.25, 1.0},
                                                                         {0.0, 1.0, 0.4, 1.0},
                                                                         {0.0, 1.0, 0.7, 1.0},
                                                                         {0.0, 1.0, 1.2, 1.0},
                                                                         {0.0, 1.0, 2.0, 1.0},
                                                                         {0.0, 1.0, 3.5, 1.0},
                                                                         {0.0, 1.0, 6.0, 1.0},
                                                                         {0.0, 1.0, 10.0, 1.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{{{"surface_position_nm", -1e5, 1e5, 1.0},
                                                               {"repulsion_nn", 1e-4, 1e4, 1.0},
                                                               {"debye_length_nm", 0.1, 1e3, 1.0},
                                                               {"attraction_nn", 1e-4, 1e4, 1.0}}};
  static constexpr ModelInfo model{"dlvo",
                                   "F = p1 exp(-z/p2) - p3 (D0/(max(z, 0) + D0))^2, z = d - p0, D0 = 0.165",
                                   "Butt, Cappella, Kappl 2005, Surf. Sci. Rep. 59, 1", info};

  static constexpr double cut_off_nm = 0.165;  // D0

  template <typename T>
  static T force(const T* p, const T& d) {
    using std::exp;
    const T height = d - p[0];
    const T repulsion =
        height < -deepest * p[2] ? T(p[1] * std::exp(deepest)) : T(p[1] * exp(-height / p[2]));
    if (height < 0.0) return repulsion - p[3];
    const T ratio = cut_off_nm / (height + cut_off_nm);
    return repulsion - p[3] * ratio * ratio;
  }

  static constexpr std::array<ModelTerm, 4> contact_terms{
      {{1, value_of_term}, {1, 0}, {1, 2}, {3, value_of_term}}};
  static std::array<double, 4> contact(const double* p, double depth) {
    if (depth > deepest * p[2]) return {std::exp(deepest), 0.0, 0.0, -1.0};
    const double repulsion = std::exp(depth / p[2]);
    return {repulsion, repulsion / p[2], -repulsion * depth / (p[2] * p[2]), -1.0};
  }

  static constexpr std::array<ModelTerm, 5> tail_terms{
      {{1, value_of_term}, {1, 0}, {1, 2}, {3, value_of_term}, {3, 0}}};
  static std::array<double, 5> tail(const double* p, double height) {
    const double repulsion = std::exp(-height / p[2]);
    const double inverse = 1.0 / (height + cut_off_nm), ratio = cut_off_nm * inverse;
    return {repulsion, repulsion / p[2], repulsion * height / (p[2] * p[2]), -ratio * ratio,
            -2.0 * ratio * ratio * inverse};
  }
  static double tail_length(const double*) { return cut_off_nm; }

 private:
  static constexpr double deepest = 30.0;  // Debye lengths
};

}  // namespace combforce
