// Whether a periodic motion lasts, or gives way to one of twice its period: then forces were fitted to a
// motion that the tip does not make. Tones show nothing of it when the window holds both periods.
//
// A small motion u half a spacing above the harmonics obeys (1 - chi G) u = 0, G the spectrum of F'(d(t)).
// The determinant is 1 without a force and changes sign where the motion of twice the period branches off
// (Hill's determinant at the multiplier -1: Nayfeh and Balachandran, Applied Nonlinear Dynamics, 1995, 3.3).
// It is taken over the most compliant of these frequencies, which does for tones of several modes; where all
// intermodulate about one mode and the window is one period, these do not suffice: the determinant is
// negative for motions that last. A second branch restores the sign, and other ways to lose stability do not
// show.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <complex>
#include <cstddef>

#include "fit/harmonic_balance.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class PeriodDoubling {
 public:
  // `balance` outlives this.
  explicit PeriodDoubling(const HarmonicBalance<Model>& balance)
      : balance_(&balance), matrix_(size(balance), size(balance)), factor_(size(balance)) {}

  // Of the motion at which the balance was linearised last.
  bool branches_off() {
    const auto strong = balance_->harmonics().strong_between();
    const ForceGradient gradient = balance_->gradient();
    for (std::size_t column = 0; column < strong.size(); ++column)
      for (std::size_t row = 0; row < strong.size(); ++row) {
        const auto [re, im] = gradient.coupling_between(strong[row], strong[column]);
        const std::complex<double> chi = balance_->harmonics().response_between()[strong[row]];
        const std::complex<double> x = -chi * re, y = -chi * im;
        const auto r = static_cast<Eigen::Index>(2 * row), c = static_cast<Eigen::Index>(2 * column);
        const double one = row == column ? 1.0 : 0.0;
        matrix_(r, c) = one + x.real();
        matrix_(r + 1, c) = x.imag();
        matrix_(r, c + 1) = y.real();
        matrix_(r + 1, c + 1) = one + y.imag();
      }
    factor_.compute(matrix_);
    return has_negative_determinant();
  }

 private:
  static Eigen::Index size(const HarmonicBalance<Model>& balance) {
    return static_cast<Eigen::Index>(2 * balance.harmonics().strong_between().size());
  }

  // Sign by sign: the product itself could overflow.
  bool has_negative_determinant() const {
    const auto& order = factor_.permutationP().indices();
    bool negative = false;
    for (Eigen::Index i = 0; i < order.size(); ++i) {
      if (factor_.matrixLU()(i, i) < 0.0) negative = !negative;
      for (Eigen::Index j = i + 1; j < order.size(); ++j)
        if (order(j) < order(i)) negative = !negative;
    }
    return negative;
  }

  const HarmonicBalance<Model>* balance_;
  Eigen::MatrixXd matrix_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
};

}  // namespace combforce
