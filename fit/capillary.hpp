// A sphere in contact with a wet surface: Hertzian contact under the pull of a meniscus of liquid, which
// forms when the tip touches, is drawn out at constant volume, and ruptures (Butt, Kappl 2009, Adv. Colloid
// Interface Sci. 146, 48; Israelachvili, Intermolecular and Surface Forces).
//
//     F = -p2 + p1 (p0 - d)^(3/2)         for d <= p0
//     F = -p2 (1 - z/sqrt(z^2 + p3^2))    for 0 < z = d - p0 <= p4, after contact and until z has exceeded p4
//     F = 0                               elsewhere
//
// p0: surface position, nm; p1 = (4/3) E* sqrt(R): contact strength, GPa nm^(1/2); p2 = 4 pi gamma R cos
// theta: capillary force, nN; p3 = sqrt(V/(pi R)): meniscus length, nm, V its volume; p4: rupture distance,
// nm. With H = 2 r cos theta the height of the meniscus where it meets the sphere, the pressure is 2 gamma
// cos theta/H over an area 2 pi R (H - z), and V = pi R (H^2 - z^2).
//
// Five parameters: two tones give four numbers and do not determine them. One window at four tones of the
// paper's comb does, but not well: of 200 random pixels without noise on their forces 178 come back exactly,
// 172 of them as ill conditioned, and of the others none is called converged; around one mode, at twelve
// tones, 195 do, all ill conditioned. As for JKR, E jumps wherever one cycle more or less is held
// (touch_search.hpp).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct Capillary {
  static constexpr std::size_t parameters = 5;
  static constexpr std::array<std::size_t, 2> linear{1, 2};
  static constexpr std::array<std::array<double, parameters>, 20> shapes{
      {{0.0, 1.0, 1.0, 0.5, 0.7},  {0.0, 1.0, 1.0, 0.5, 1.4},  {0.0, 1.0, 1.0, 0.5, 2.8},
       {0.0, 1.0, 1.0, 0.5, 5.6},  {0.0, 1.0, 1.0, 0.5, 11.0}, {0.0, 1.0, 1.0, 1.5, 0.7},
       {0.0, 1.0, 1.0, 1.5, 1.4},  {0.0, 1.0, 1.0, 1.5, 2.8},  {0.0, 1.0, 1.0, 1.5, 5.6},
       {0.0, 1.0, 1.0, 1.5, 11.0}, {0.0, 1.0, 1.0, 4.0, 0.7},  {0.0, 1.0, 1.0, 4.0, 1.4},
       {0.0, 1.0, 1.0, 4.0, 2.8},  {0.0, 1.0, 1.0, 4.0, 5.6},  {0.0, 1.0, 1.0, 4.0, 11.0},
       {0.0, 1.0, 1.0, 12.0, 0.7}, {0.0, 1.0, 1.0, 12.0, 1.4}, {0.0, 1.0, 1.0, 12.0, 2.8},
       {0.0, 1.0, 1.0, 12.0, 5.6}, {0.0, 1.0, 1.0, 12.0, 11.0}}};
  static constexpr std::array<ParameterInfo, parameters> info{
      {{"surface_position_nm", -1e5, 1e5, 1.0},
       {"contact_strength_gpa_sqrt_nm", 1e-6, 1e5, 1.0},
       {"capillary_force_nn", 1e-4, 1e4, 1.0},
       {"meniscus_length_nm", 0.05, 1e3, 1.0},
       {"rupture_distance_nm", 0.05, 1e3, 1.0}}};
  static constexpr ModelInfo model{"capillary",
                                   "F = -p2 + p1 (p0 - d)^(3/2) for d <= p0, then -p2 (1 - z/sqrt(z^2 + "
                                   "p3^2)) up to z = d - p0 = p4, else 0",
                                   "Butt, Kappl 2009, Adv. Colloid Interface Sci. 146, 48", info};

  static double release_height_nm(const double* p) { return p[4]; }
  static std::array<double, parameters> release_gradient(const double* /*p*/) {
    return {0.0, 0.0, 0.0, 0.0, 1.0};
  }

  template <typename T>
  static T force(const T* p, const T& d, bool engaged) {
    using std::sqrt;
    const T z = d - p[0];
    if (z < 0.0) return p[1] * -z * sqrt(-z) - p[2];
    if (!engaged || z > p[4]) return T(0.0);
    return p[2] * (z / sqrt(z * z + p[3] * p[3]) - 1.0);
  }

  static constexpr std::array<ModelTerm, 4> contact_terms{
      {{1, value_of_term}, {1, 0}, {2, value_of_term}, {2, 0}}};
  static std::array<double, 4> contact(const double* /*p*/, double depth) {
    const double root = std::sqrt(depth);
    return {depth * root, 1.5 * root, -1.0, 0.0};
  }

  static constexpr std::array<ModelTerm, 4> tail_terms{{{2, value_of_term}, {2, 0}, {2, 3}, {2, 4}}};
  static std::array<double, 4> tail(const double* p, double height) {
    const double square = height * height + p[3] * p[3], inverse = 1.0 / std::sqrt(square);
    const double slope = p[3] * inverse / square;
    return {height * inverse - 1.0, -slope * p[3], -slope * height, 0.0};
  }
  static double tail_length(const double* p) { return p[3]; }
};

}  // namespace combforce
