// The thermal motion of a tip on springs that change with time, at every time of their period, against
// equipartition where they do not, and where they do against a direct integration of its covariance.
#include "fit/engaged_heat.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "fit/units.hpp"
#include "tests/support/failing_allocator.hpp"

namespace combforce::test {
namespace {

using Complex = std::complex<double>;

constexpr double room_k = 300.0, heat_nn_nm = boltzmann_nn_nm_per_k * room_k;

// In liquid; the surface changes with the first mode's period, 1 ms.
const Cantilever soft{{{1e3, 2.0, 0.05, 1.0}, {6.3e3, 5.0, 1.9, 1.0}}};
const Cantilever one_mode{{{1e3, 2.0, 0.05, 1.0}}};

// Between tip and surface, N/m and nN s/nm: phasors of harmonics.
struct Surface {
  std::vector<Complex> stiffness{0.0}, friction{0.0};

  static double at(const std::vector<Complex>& phasors, double phase) {
    double sum = 0.0;
    for (std::size_t n = 0; n < phasors.size(); ++n)
      sum += (phasors[n] * std::polar(1.0, static_cast<double>(n) * phase)).real();
    return sum;
  }
};

Harmonics harmonics(const Cantilever& cantilever) {
  Comb comb;
  comb.window_samples = 1000;
  for (const std::uint64_t bin : {20, 40, 60, 140}) comb.tones.push_back({bin, true});
  return {comb, cantilever, 50.0};  // 1 kHz apart
}

struct Spread {
  bool stable = false;
  std::vector<Complex> phasors;

  double at(double phase) const { return Surface::at(phasors, phase); }
};

Spread spread_over(const Surface& surface, const Cantilever& cantilever, double seen = 0.0) {
  const Harmonics harmonics = test::harmonics(cantilever);
  EngagedHeat heat(harmonics, cantilever, room_k, 1);
  std::vector<Complex> damping = surface.friction;
  for (Complex& phasor : damping) phasor = -phasor;  // dF/d(velocity); dF/dp0 = -dF/dd is the stiffness
  Spread result{false, std::vector<Complex>(harmonics.band() + 1)};
  result.stable = heat.engage({surface.stiffness, damping, harmonics.angular_frequency(1)});
  if (result.stable) heat.standard_deviation(seen, result.phasors);
  return result;
}

// The tip's standard deviation at so many times of the period, by Runge and Kutta's fourth order, after so
// many periods: dP/dt = A P + P A' + S.
std::vector<double> integrated(const Surface& surface, const Cantilever& cantilever, std::size_t times) {
  constexpr std::size_t steps = 1000;  // 160 a period of the second mode
  constexpr int periods = 8;
  const auto order = static_cast<Eigen::Index>(2 * cantilever.modes.size());
  const auto slope = [&](double phase, const Eigen::MatrixXd& p) {
    const double stiffness = Surface::at(surface.stiffness, phase),
                 friction = Surface::at(surface.friction, phase);
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(order, order), heat = a;
    for (Eigen::Index m = 0; m < order; m += 2) {
      const Mode& mode = cantilever.modes[static_cast<std::size_t>(m / 2)];
      const double w = 2.0 * std::numbers::pi * mode.frequency_hz, per_mass = w * w / mode.stiffness_n_per_m;
      a(m, m + 1) = 1.0;
      a(m + 1, m) = -w * w;
      a(m + 1, m + 1) = -w / mode.quality_factor;
      for (Eigen::Index l = 0; l < order; l += 2) {
        a(m + 1, l) -= per_mass * stiffness;
        a(m + 1, l + 1) -= per_mass * friction;
      }
      heat(m + 1, m + 1) = 2.0 * heat_nn_nm * per_mass * w / mode.quality_factor;
    }
    return Eigen::MatrixXd(a * p + p * a.transpose() + heat);
  };
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(order, order);
  std::vector<double> deviations;
  const double turn = 2.0 * std::numbers::pi / static_cast<double>(steps),
               h = 1e-3 / static_cast<double>(steps);
  for (int period = 0; period <= periods; ++period)
    for (std::size_t i = 0; i < steps; ++i) {
      if (period == periods && i % (steps / times) == 0) {
        double variance = 0.0;
        for (Eigen::Index m = 0; m < order; m += 2)
          for (Eigen::Index l = 0; l < order; l += 2) variance += p(m, l);
        deviations.push_back(std::sqrt(variance));
      }
      const double at = turn * static_cast<double>(i);
      const Eigen::MatrixXd k1 = slope(at, p), k2 = slope(at + 0.5 * turn, p + 0.5 * h * k1),
                            k3 = slope(at + 0.5 * turn, p + 0.5 * h * k2), k4 = slope(at + turn, p + h * k3);
      p += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
  return deviations;
}

TEST(EngagedSpread, IsThatOfEquipartitionWithoutASurface) {
  const Spread spread = spread_over({}, soft);
  ASSERT_TRUE(spread.stable);
  for (const double phase : {0.0, 2.0, 5.0})
    EXPECT_NEAR(spread.at(phase), std::sqrt(heat_nn_nm / 0.05 + heat_nn_nm / 1.9), 1e-9) << phase;
}

// The kicks, two a step, are a spring to (w step)^2/48 or so, here 1e-4.
TEST(EngagedSpread, IsThatOfEquipartitionOnASpring) {
  const Spread spread = spread_over({{0.07}, {0.0}}, one_mode);
  ASSERT_TRUE(spread.stable);
  EXPECT_NEAR(spread.at(1.0), std::sqrt(heat_nn_nm / 0.12), 1e-3 * std::sqrt(heat_nn_nm / 0.12));
}

// A thousand times as stiff as the lever; the kicks, made often enough, leave a percent of the stiffness.
TEST(EngagedSpread, IsThatOfEquipartitionOnAWall) {
  const Spread spread = spread_over({{50.0}, {0.0}}, one_mode);
  ASSERT_TRUE(spread.stable);
  EXPECT_NEAR(spread.at(1.0), std::sqrt(heat_nn_nm / 50.05), 5e-3 * std::sqrt(heat_nn_nm / 50.05));
}

TEST(EngagedSpread, IsNoneWithoutHeat) {
  const Harmonics harmonics = test::harmonics(soft);
  EngagedHeat heat(harmonics, soft, 0.0, 3);
  const std::vector<Complex> by_surface{0.05, 0.06};
  std::vector<Complex> phasors(harmonics.band() + 1, 1.0);
  ASSERT_TRUE(heat.engage({by_surface, {}, harmonics.angular_frequency(1)}));
  EXPECT_EQ(heat.covariance().norm(), 0.0);
  heat.standard_deviation(0.0, phasors);
  EXPECT_EQ(phasors, std::vector<Complex>(harmonics.band() + 1));
}

// It rings for a hundred periods, and so long it takes to be what the surface makes of it, to what the kicks
// leave.
TEST(EngagedSpread, WaitsForALeverThatRings) {
  const Spread spread = spread_over({{0.02}, {0.0}}, Cantilever{{{1e3, 300.0, 0.05, 1.0}}});
  ASSERT_TRUE(spread.stable);
  EXPECT_NEAR(spread.at(1.0), std::sqrt(heat_nn_nm / 0.07), 1e-3 * std::sqrt(heat_nn_nm / 0.07));
}

// What the surface takes is not given back: its own heat is not known. Within what the kicks leave.
TEST(EngagedSpread, IsCooledByASurfaceThatTakesEnergy) {
  const double own = 0.05 / (2.0 * std::numbers::pi * 1e3 * 2.0);  // k/(w Q), nN s/nm
  const Spread spread = spread_over({{0.0}, {own}}, one_mode);
  ASSERT_TRUE(spread.stable);
  EXPECT_NEAR(spread.at(1.0), std::sqrt(0.5 * heat_nn_nm / 0.05), 1e-3 * std::sqrt(heat_nn_nm / 0.1));
}

// Within what the kicks leave.
TEST(EngagedSpread, FollowsASurfaceThatComesAndGoes) {
  const double own = 0.05 / (2.0 * std::numbers::pi * 1e3 * 2.0);
  const Surface touched{{0.05, {0.06, 0.03}, {0.02, -0.01}}, {0.4 * own, {0.3 * own, 0.1 * own}}};
  constexpr std::size_t times = 10;
  for (const Cantilever* cantilever : {&one_mode, &soft}) {
    const Spread spread = spread_over(touched, *cantilever);
    ASSERT_TRUE(spread.stable);
    const std::vector<double> expected = integrated(touched, *cantilever, times);
    for (std::size_t i = 0; i < times; ++i) {
      const double phase = 2.0 * std::numbers::pi * static_cast<double>(i) / times;
      EXPECT_NEAR(spread.at(phase), expected[i], 1e-3 * expected[i])
          << cantilever->modes.size() << ", " << phase;
    }
  }
}

TEST(EngagedSpread, LeavesOutWhatTheTonesHold) {
  const double free = heat_nn_nm / 0.05;
  EXPECT_NEAR(spread_over({}, one_mode, 0.36 * free).at(0.0), 0.8 * std::sqrt(free), 1e-9);
  EXPECT_EQ(spread_over({}, one_mode, 1.1 * free).at(0.0), 0.0);
}

TEST(EngagedSpread, IsNotKnownWhereTheMotionGrows) {
  EXPECT_FALSE(spread_over({{-0.06}, {0.0}}, one_mode).stable);  // a spring that repels
  EXPECT_FALSE(
      spread_over({{0.0, 0.0, 0.2}, {0.0}}, Cantilever{{{1e3, 50.0, 0.05, 1.0}}}).stable);  // a swing
}

TEST(EngagedSpread, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const Harmonics harmonics = test::harmonics(soft);
  EngagedHeat heat(harmonics, soft, room_k, 3);
  const std::vector<Complex> by_surface{0.05, 0.06}, by_velocity{-1e-6, 0.0};
  std::vector<Complex> phasors(harmonics.band() + 1);
  const ForceGradient gradient{by_surface, by_velocity, harmonics.angular_frequency(1)};
  std::size_t allocations = 0;
  {
    const ForbidAllocation guard;
    heat.engage(gradient);
    heat.standard_deviation(0.0, phasors);
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(phasors[0].real(), 0.0);
}

}  // namespace
}  // namespace combforce::test
