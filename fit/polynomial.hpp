// A polynomial in the deflection: the force where the tip moves, without a theory of it (Platz, Forchheimer,
// Tholén, Haviland 2013, Beilstein J. Nanotechnol. 4, 352).
//
//     F = p0 d + p1 d^2 + p2 d^3 + p3 d^4 + p4 d^5
//
// d: deflection from its mean, nm; p0: force gradient, N/m; p1 … p4: nN/nm^2 … nN/nm^5. No constant: a comb
// has no tone at frequency 0, so the mean force is not measured, nor the mean deflection that it makes. There
// is no surface either, and what lies beyond the motion's turning points is extrapolated.
//
// A power d^k makes its products at sums and differences of k tones. Tones around one mode hold all those of
// odd powers near it, but none of even powers, which fall near 0 and twice the mode: then p1 and p3 are not
// known (NaN), and the fit is ill conditioned. Some tones there as well, sidebands of a few spacings or the
// second harmonic, tell them. Where no products are measured, the odd powers give one number a driven tone,
// by its amplitude: fewer than three different amplitudes do not tell three odd powers apart, and nothing is
// known.
#pragma once

#include <array>
#include <cstddef>

#include "fit/force_model.hpp"

namespace combforce {

// What the members mean to their users: hertz.hpp.
struct Polynomial {
  static constexpr std::size_t parameters = 5;
  // Beyond any force on a tip that moves a nanometre; powers of longer motions are weaker by far.
  static constexpr std::array<ParameterInfo, parameters> info{{{"force_gradient_n_per_m", -1e5, 1e5, 1.0},
                                                               {"quadratic_nn_per_nm2", -1e5, 1e5, 0.1},
                                                               {"cubic_nn_per_nm3", -1e5, 1e5, 1e-2},
                                                               {"quartic_nn_per_nm4", -1e5, 1e5, 1e-3},
                                                               {"quintic_nn_per_nm5", -1e5, 1e5, 1e-4}}};
  static constexpr ModelInfo model{"polynomial",
                                   "F = p0 d + p1 d^2 + p2 d^3 + p3 d^4 + p4 d^5, d from its mean",
                                   "Platz et al. 2013, Beilstein J. Nanotechnol. 4, 352", info};

  template <typename T>
  static T force(const T* p, const T& d) {
    T sum = p[parameters - 1];
    for (std::size_t k = parameters - 1; k-- > 0;) sum = sum * d + p[k];
    return sum * d;
  }

  static std::array<double, parameters> powers(double d) {
    std::array<double, parameters> values{d};
    for (std::size_t k = 1; k < parameters; ++k) values[k] = values[k - 1] * d;
    return values;
  }
};

}  // namespace combforce
