// The Jacobians that the solver and the error estimate see, against finite differences and the reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fit/force_model.hpp"
#include "fit/residuals.hpp"
#include "tests/unit/fit/random_pixel.hpp"

namespace combforce {
namespace {

// A pixel's residuals at a point away from the minimum, tones weighted unequally.
template <typename Model>
class ResidualsOf {
 public:
  static constexpr std::size_t level = 3;
  using Parameters = typename Residuals<Model>::Parameters;
  using Coordinates = typename Residuals<Model>::Coordinates;

  ResidualsOf(const test::ModelPixel& pixel, std::array<Bounds, Model::parameters> bounds)
      : tones_(pixel.tip_nm.size()),
        balance_(bins(pixel), test::paper_delta_f_hz),
        residuals_(balance_, tones_) {
    const test::ReferenceMotion motion(bins(pixel), pixel.tip_nm, test::paper_delta_f_hz);
    forces_ = test::reference_phasors<Model>(motion, pixel.truth);
    for (std::size_t i = 0; i < tones_; ++i) weights_.push_back(1.0 + static_cast<double>(i));
    balance_.set_motion(pixel.tip_nm);
    balance_.prepare(pixel.truth[0], level, !Model::tail_terms.empty());
    residuals_.set_measured(forces_, weights_);
    residuals_.set_bounds(bounds);
  }

  Residuals<Model>& operator*() { return residuals_; }
  const test::Phasors& forces() const { return forces_; }

  Eigen::VectorXd at(const Coordinates& x) {
    Eigen::VectorXd values(residuals_.NumResiduals());
    residuals_(x.data(), values.data(), nullptr);
    return values;
  }
  Eigen::MatrixXd jacobian(const Coordinates& x) {
    Eigen::VectorXd values(residuals_.NumResiduals());
    Eigen::MatrixXd result(residuals_.NumResiduals(), x.size());
    residuals_(x.data(), values.data(), result.data());
    return result;
  }

  static std::vector<std::uint64_t> bins(const test::ModelPixel& pixel) {
    std::vector<std::uint64_t> result;
    for (const Tone& tone : pixel.conditions.comb.tones) result.push_back(tone.bin);
    return result;
  }

 private:
  std::size_t tones_;
  ForceBalance balance_;
  Residuals<Model> residuals_;
  test::Phasors forces_;
  std::vector<double> weights_;
};

template <typename Model>
std::array<Bounds, Model::parameters> bounds_about(const test::ModelPixel& pixel) {
  std::array<Bounds, Model::parameters> bounds;
  for (std::size_t k = 0; k < Model::parameters; ++k)
    bounds[k] = k == 0 ? Bounds{pixel.truth[0] - 20.0, pixel.truth[0] + 20.0}
                       : Bounds{1e-3 * pixel.truth[k], 1e3 * pixel.truth[k]};
  return bounds;
}

template <typename Model>
void expect_jacobian_is_finite_differences(ResidualsOf<Model>& residuals, const test::ModelPixel& pixel) {
  std::array<double, Model::parameters> p;
  std::ranges::copy(pixel.truth, p.begin());
  p[0] += 0.3;
  p[Model::parameters - 1] *= 1.2;
  const auto x = (*residuals).coordinates(p);
  const Eigen::MatrixXd jacobian = residuals.jacobian(x);
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    // 1e-3 nm of the surface position, 1e-3 of a length: 2e-5 … 2e-4 of the range in x. The second difference
    // of forces that vary over 0.3 nm leaves (1e-3/0.3)^2 = 1e-5 of the slope.
    const double step = k == 0 ? 1e-3 / 20.0 : 1e-3 / std::log(1e3);
    typename ResidualsOf<Model>::Coordinates before = x, after = x;
    before(k) -= step;
    after(k) += step;
    const Eigen::VectorXd difference = (residuals.at(after) - residuals.at(before)) / (2.0 * step);
    ASSERT_GT(difference.norm(), 0.0);
    EXPECT_LE((jacobian.col(k) - difference).norm(), 3e-5 * difference.norm()) << "coordinate " << k;
  }
}

TEST(Residuals, HertzJacobianIsFiniteDifferences) {
  test::RandomPixels draw(21);
  for (int i = 0; i < 20; ++i) {
    SCOPED_TRACE(i);
    const test::ModelPixel pixel = draw.hertz();
    ResidualsOf<Hertz> residuals(pixel, bounds_about<Hertz>(pixel));
    expect_jacobian_is_finite_differences(residuals, pixel);
  }
}

TEST(Residuals, DmtJacobianIsFiniteDifferences) {
  test::RandomPixels draw(22);
  for (int i = 0; i < 10; ++i) {
    SCOPED_TRACE(i);
    const test::ModelPixel pixel = draw.dmt();
    ResidualsOf<Dmt> residuals(pixel, bounds_about<Dmt>(pixel));
    expect_jacobian_is_finite_differences(residuals, pixel);
  }
}

TEST(Residuals, KelvinVoigtJacobianIsFiniteDifferences) {
  test::RandomPixels draw(26);
  for (int i = 0; i < 10; ++i) {
    SCOPED_TRACE(i);
    const test::ModelPixel pixel = draw.kelvin_voigt();
    ResidualsOf<KelvinVoigt> residuals(pixel, bounds_about<KelvinVoigt>(pixel));
    expect_jacobian_is_finite_differences(residuals, pixel);
  }
}

TEST(Residuals, ExponentialJacobianIsFiniteDifferences) {
  test::RandomPixels draw(27);
  for (int i = 0; i < 10; ++i) {
    SCOPED_TRACE(i);
    const test::ModelPixel pixel = draw.exponential();
    ResidualsOf<Exponential> residuals(pixel, bounds_about<Exponential>(pixel));
    expect_jacobian_is_finite_differences(residuals, pixel);
  }
}

// Adhesion held at its upper bound no longer follows the nonlinear parameters.
TEST(Residuals, DmtJacobianIsFiniteDifferencesWithALinearParameterHeld) {
  test::RandomPixels draw(23);
  const test::ModelPixel pixel = draw.dmt();
  auto bounds = bounds_about<Dmt>(pixel);
  bounds[2].upper = 0.9 * pixel.truth[2];
  ResidualsOf<Dmt> residuals(pixel, bounds);
  expect_jacobian_is_finite_differences(residuals, pixel);
  std::array<double, 4> p;
  std::ranges::copy(pixel.truth, p.begin());
  const auto x = (*residuals).coordinates(p);
  EXPECT_EQ((*residuals).parameters(x)[2], bounds[2].upper);
  EXPECT_TRUE((*residuals).held(x)[2]);
  EXPECT_FALSE((*residuals).held(x)[1]);
}

// At each x the linear parameters are the best ones: no other pair makes the residuals smaller.
TEST(Residuals, LinearParametersAreThoseOfLeastSquares) {
  test::RandomPixels draw(24);
  const test::ModelPixel pixel = draw.dmt();
  ResidualsOf<Dmt> residuals(pixel, bounds_about<Dmt>(pixel));
  std::array<double, 4> p;
  std::ranges::copy(pixel.truth, p.begin());
  const auto x = (*residuals).coordinates(p);
  const auto solved = (*residuals).parameters(x);
  for (const std::size_t k : {std::size_t{1}, std::size_t{2}})
    EXPECT_NEAR(solved[k], pixel.truth[k], 1e-4 * pixel.truth[k]) << "at the true shape, the true strengths";
  EXPECT_LT((*residuals).squared_norm(x), 1e-10);  // of forces scaled to 1
}

template <typename Model>
void expect_linearization_is_the_references(const test::ModelPixel& pixel) {
  ResidualsOf<Model> residuals(pixel, bounds_about<Model>(pixel));
  std::array<double, Model::parameters> p;
  std::ranges::copy(pixel.truth, p.begin());
  p[1] *= 1.1;
  Eigen::MatrixXd jacobian((*residuals).NumResiduals(), static_cast<Eigen::Index>(Model::parameters));
  Eigen::VectorXd differences((*residuals).NumResiduals());
  (*residuals).linearize(p, jacobian, differences);
  Eigen::MatrixXd expected =
      test::reference_force<Model>(test::ReferenceMotion(ResidualsOf<Model>::bins(pixel), pixel.tip_nm), p);
  for (std::size_t i = 0; i < pixel.tip_nm.size(); ++i) {
    expected(static_cast<Eigen::Index>(2 * i), 0) -= residuals.forces()[i].real();
    expected(static_cast<Eigen::Index>(2 * i + 1), 0) -= residuals.forces()[i].imag();
  }
  // Level 3 of the quadrature: force_balance_test.cpp says how good that is.
  EXPECT_LE((differences - expected.col(0)).norm(), 1e-5 * expected.col(0).norm());
  for (Eigen::Index k = 0; k < jacobian.cols(); ++k)
    EXPECT_LE((jacobian.col(k) - expected.col(1 + k)).norm(), 1e-5 * expected.col(1 + k).norm()) << "p" << k;
}

TEST(Residuals, LinearizationIsTheReferences) {
  test::RandomPixels draw(25);
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    expect_linearization_is_the_references<Hertz>(draw.hertz());
    expect_linearization_is_the_references<Dmt>(draw.dmt());
    expect_linearization_is_the_references<Exponential>(draw.exponential());
  }
}

}  // namespace
}  // namespace combforce
