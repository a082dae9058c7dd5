// The refined fit under the detector's noise alone, which the surface answers to.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "fit/hertz.hpp"
#include "fit/self_consistent.hpp"
#include "fit/units.hpp"
#include "tests/unit/fit/paper_cantilever.hpp"

namespace combforce::test {
namespace {

using Complex = std::complex<double>;

// The detector's noise moves the model's forces too: mostly so where the contact is stiff.
TEST(DetectorNoise, StandardErrorsHoldUnderIt) {
  const std::vector<std::uint64_t> bins{234, 1348};
  const Phasors tip_nm{{2.0, -36.0}, {1.0, -8.5}};
  const double density = 2e-4;  // nm/sqrt(Hz): 4.5 pm a quadrature
  FitConditions conditions = paper_conditions("hertz", bins, Phasors(2));
  conditions.noise = Noise{1.0, {density}};  // heat, which is not drawn, counts for little
  conditions.settings.refine = 30;
  const Harmonics harmonics(conditions.comb, conditions.cantilever, paper_delta_f_hz);
  HarmonicBalance<Hertz> balance(harmonics);
  SelfConsistentFit<Hertz> model(balance);
  balance.set_whitening(Eigen::MatrixXd::Identity(4, 4));
  const std::vector<Bounds> held{{-40.0 - 1e-9, -40.0 + 1e-9}, {1.0 - 1e-9, 1.0 + 1e-9}};
  balance.set_bounds(held);
  balance.set_measured(tip_nm, Phasors(2));
  model.solve({-40.0, 1.0}, 1, 20);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto row = static_cast<Eigen::Index>(2 * i);
    conditions.free_response->mean_nm[i] =
        tip_nm[i] - tip_response(conditions.cantilever, paper_delta_f_hz * static_cast<double>(bins[i])) *
                        Complex(model.residuals()(row), model.residuals()(row + 1));
  }
  PixelFitter fitter(conditions);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, density * std::sqrt(paper_delta_f_hz));
  constexpr int draws = 100;
  double squares[2]{}, chi2 = 0.0;
  for (int draw = 0; draw < draws; ++draw) {
    Phasors noisy = tip_nm;
    for (Complex& tone : noisy) {
      const double re = normal(random), im = normal(random);
      tone += Complex(re, im);
    }
    FitResult result;
    fitter.fit(noisy, result);
    chi2 += result.chi2_reduced / draws;
    squares[0] += std::pow((result.parameters[0] + 40.0) / result.std_errors[0], 2) / draws;
    squares[1] += std::pow((result.parameters[1] - 1.0) / result.std_errors[1], 2) / draws;
  }
  // Means of 100 squares of deviates spread by sqrt(2/100) = 0.14; four times that.
  EXPECT_NEAR(squares[0], 1.0, 0.56);
  EXPECT_NEAR(squares[1], 1.0, 0.56);
  EXPECT_NEAR(chi2, 1.0, 0.4);  // two degrees of freedom: four times sqrt(1/100)
}

}  // namespace
}  // namespace combforce::test
