// The numerical pieces under the force balance: polynomials of the motion, turning points, crossings, Gauss
// rules, bounds by transformation, least squares between bounds.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "fit/bounded.hpp"
#include "fit/box_least_squares.hpp"
#include "fit/motion.hpp"
#include "fit/quadrature.hpp"
#include "tests/unit/fit/reference_force.hpp"

namespace combforce {
namespace {

TEST(Motion, CellsAreTheSumOfTones) {
  const std::vector<std::uint64_t> bins{234, 1348, 3516, 6470};
  const std::vector<std::complex<double>> tones{{3.8, -35.8}, {0.6, -8.1}, {0.2, -3.8}, {0.04, -2.0}};
  Motion motion(bins);
  motion.set(tones);
  const test::ReferenceMotion expected(bins, tones);
  EXPECT_EQ(motion.highest_harmonic(), 3235U);  // of the period T/2
  const auto cells = static_cast<double>(motion.cells());
  for (std::size_t cell = 0; cell < motion.cells(); cell += 97)
    for (const double s : {-1.0, -0.4, 0.0, 0.9, 1.0})
      // Stated: 5e-11 of the amplitudes, 50 nm.
      EXPECT_NEAR(value_at(motion.polynomial(cell), s),
                  expected.at((static_cast<double>(cell) + 0.5 + 0.5 * s) / cells), 3e-9);
  EXPECT_NEAR(motion.lowest_nm(), expected.lowest_nm(), 5e-3 * 50.0);
  EXPECT_GE(motion.lowest_nm(), expected.lowest_nm() - 1e-8);
}

TEST(GaussLegendre, IntegratesPolynomialsOfDegreeTwoNMinusOne) {
  for (const std::size_t n : {1U, 2U, 5U, 12U, 24U}) {
    const GaussRule rule = gauss_legendre(n);
    for (std::size_t degree = 0; degree < 2 * n; ++degree) {
      double sum = 0.0;
      for (std::size_t j = 0; j < n; ++j)
        sum += rule.weights[j] * std::pow(rule.nodes[j], static_cast<double>(degree));
      EXPECT_NEAR(sum, 1.0 / static_cast<double>(degree + 1), 1e-13) << n << " nodes, degree " << degree;
    }
  }
}

// Polynomials whose slope has known roots: prod (s - r_i) integrated.
TEST(TurningPoints, NoneIsMissedAndNoneInvented) {
  std::mt19937_64 engine(61);
  std::uniform_real_distribution<double> place(-1.6, 1.6);
  for (int trial = 0; trial < 2000; ++trial) {
    const auto count = static_cast<std::size_t>(trial % 9);
    std::vector<double> roots;
    while (roots.size() < count) {
      const double root = place(engine);
      const bool apart =
          std::ranges::all_of(roots, [root](double other) { return std::abs(other - root) > 1e-3; });
      if (apart && std::abs(std::abs(root) - 1.0) > 1e-3) roots.push_back(root);
    }
    std::vector<double> slope{1.0};
    for (const double root : roots) {
      std::vector<double> next(slope.size() + 1, 0.0);
      for (std::size_t k = 0; k < slope.size(); ++k) {
        next[k + 1] += slope[k];
        next[k] -= root * slope[k];
      }
      slope = next;
    }
    Motion::Polynomial c{};
    for (std::size_t k = 0; k < slope.size(); ++k) c[k + 1] = slope[k] / static_cast<double>(k + 1);
    std::erase_if(roots, [](double root) { return std::abs(root) >= 1.0; });
    std::ranges::sort(roots);
    std::array<double, Motion::order> points;
    ASSERT_EQ(turning_points(c, points), roots.size()) << "trial " << trial;
    // Bisected to 1e-9; rounding of a slope with roots 1e-3 apart moves them by about as much.
    for (std::size_t i = 0; i < roots.size(); ++i)
      EXPECT_NEAR(points[i], roots[i], 1e-6) << "trial " << trial;
  }
}

TEST(Crossing, IsWhereThePolynomialTakesTheValue) {
  const Motion::Polynomial c{0.5, 2.0, 0.3, 0.4};  // monotone over [-1, 1]: slope 2 + 0.6 s + 1.2 s^2 > 0
  for (double s = -1.0; s <= 1.0; s += 0.125) {
    EXPECT_NEAR(crossing(c, -1.0, 1.0, value_at(c, s), 1e-13), s, 1e-12);
  }
  Motion::Polynomial falling = c;
  for (double& coefficient : falling) coefficient = -coefficient;
  EXPECT_NEAR(crossing(falling, -1.0, 1.0, value_at(falling, 0.3), 1e-13), 0.3, 1e-12);
  const Motion::Polynomial flat{0.0, 0.0, 1.0};  // at its turning point the slope is 0
  EXPECT_NEAR(crossing(flat, 0.0, 1.0, 1e-10, 1e-16), 1e-5, 1e-9);
}

TEST(Bounded, StaysWithinBoundsAndInvertsAndDifferentiates) {
  for (const Bounded& bounded : {Bounded(-45.0, 12.0), Bounded(0.01, 100.0)}) {
    for (double x = -4.0; x < 4.0; x += 0.37) {
      const double p = bounded.value(x), h = 1e-5;
      const double difference = (bounded.value(x + h) - bounded.value(x - h)) / (2.0 * h);
      EXPECT_NEAR(bounded.slope(x, p), difference, 1e-8 * (std::abs(difference) + 100.0)) << x;
      if (std::abs(std::sin(x)) < 0.998) {
        EXPECT_NEAR(bounded.value(bounded.inverse(p)), p, 1e-11 * (1.0 + std::abs(p)));
      }
    }
  }
  const Bounded bounded(2.0, 5.0);
  for (const double outside : {-1.0, 0.0, 1.0, 2.0, 5.0, 9.0}) {
    const double p = bounded.value(bounded.inverse(outside));
    EXPECT_GT(p, 2.0);
    EXPECT_LT(p, 5.0);
    EXPECT_GT(std::abs(bounded.slope(bounded.inverse(outside), p)), 0.0) << "a start the solver can leave";
  }
  EXPECT_TRUE(bounded.at_bound(std::numbers::pi / 2.0));
  EXPECT_FALSE(bounded.at_bound(bounded.inverse(5.0)));
}

// Against a fine grid over the box.
TEST(BoxLeastSquares, FindsTheLeastWithinTheBox) {
  std::mt19937_64 engine(62);
  std::normal_distribution<double> normal;
  int held = 0;
  for (int trial = 0; trial < 300; ++trial) {
    Eigen::Matrix<double, 4, 2> a;
    Eigen::Vector4d y;
    for (auto& value : a.reshaped()) value = normal(engine);
    for (auto& value : y) value = 2.0 * normal(engine);
    const Eigen::Matrix2d matrix = a.transpose() * a;
    const Eigen::Vector2d right = a.transpose() * y;
    const std::array<Bounds, 2> bounds{{{-0.5, 0.7}, {0.1, 1.0}}};
    const BoxSolution<2> found = solve_box<2>(matrix, right, bounds);
    const auto value = [&](const Eigen::Vector2d& x) { return x.dot(matrix * x) - 2.0 * right.dot(x); };
    EXPECT_NEAR(found.value, value(found.x), 1e-12 * (1.0 + std::abs(found.value)));
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_GE(found.x(static_cast<Eigen::Index>(k)), bounds[k].lower);
      EXPECT_LE(found.x(static_cast<Eigen::Index>(k)), bounds[k].upper);
      held += found.holds[k] != Hold::free;
    }
    for (double u = 0.0; u <= 1.0; u += 0.05)
      for (double v = 0.0; v <= 1.0; v += 0.05)
        EXPECT_LE(found.value, value({-0.5 + 1.2 * u, 0.1 + 0.9 * v}) + 1e-12) << "trial " << trial;
  }
  EXPECT_GT(held, 100);
}

TEST(BoxLeastSquares, AnUnknownThatIsNotFeltIsHeldAtItsLowerBound) {
  const Eigen::Matrix2d matrix{{4.0, 0.0}, {0.0, 0.0}};
  const BoxSolution<2> found =
      solve_box<2>(matrix, Eigen::Vector2d(2.0, 0.0), {{{-10.0, 10.0}, {0.25, 1.0}}});
  EXPECT_DOUBLE_EQ(found.x(0), 0.5);
  EXPECT_EQ(found.x(1), 0.25);
  EXPECT_EQ(found.holds[1], Hold::lower);
}

}  // namespace
}  // namespace combforce
