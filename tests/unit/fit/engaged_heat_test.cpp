// The thermal motion of a tip on springs that change with time, in the tones of a window, against the
// covariance that its equation of motion has in time.
#include "fit/engaged_heat.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <ostream>
#include <vector>

#include "fit/units.hpp"
#include "tests/support/failing_allocator.hpp"

namespace combforce::test {
namespace {

using Complex = std::complex<double>;

constexpr double temperature_k = 300.0;
const std::vector<std::uint64_t> neighbours{16, 20, 22, 26}, overtones{20, 40, 60, 80},
    close_neighbours{66, 69, 70, 73};

// A spring between tip and surface, N/m, and what it loses, nN s/nm: the mean, and what comes and goes with
// a harmonic of the window.
struct Spring {
  std::vector<std::uint64_t> bins = neighbours;
  double frequency_hz = 20.3,
         quality_factor = 15.0;  // of the mode; it rings for a quarter of a window of 1 s
  double mean = 0.0, damping = 0.0;
  std::size_t harmonic = 0;
  Complex stiffness = 0.0, friction = 0.0;

  Mode mode() const { return {frequency_hz, quality_factor, 2.0, 1.0}; }
  friend std::ostream& operator<<(std::ostream& out, const Spring& spring) {
    return out << "bin " << spring.bins[0] << ", Q " << spring.quality_factor << ", spring " << spring.mean
               << " + " << spring.stiffness << ", friction " << spring.damping << " + " << spring.friction;
  }
  static double at(double mean, Complex phasor, double phase) {
    return mean + (phasor * std::polar(1.0, phase)).real();
  }
};

// (q, dq/dt, then (re, im) of (2/T) times the integral of q exp(-iwt) so far, a tone each): dx = A x dt +
// white force on the second. Its covariance P by dP/dt = A P + P A' + Q, Runge-Kutta of fourth order, from
// where it repeats.
Eigen::MatrixXd covariance_in_time(const Spring& spring, unsigned windows) {
  using State = Eigen::Matrix<double, 10, 10>;
  const Mode mode = spring.mode();
  // 25 a period of the fastest tone, and of the tip on its spring.
  const double steps = std::round(100.0 * mode.frequency_hz *
                                  std::max(1.0, std::sqrt(spring.mean / mode.stiffness_n_per_m) / 2.0));
  const int settle_windows =  // 25 relaxations of the energy
      static_cast<int>(std::ceil(4.0 * mode.quality_factor / mode.frequency_hz));
  const double w0 = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double mass = mode.stiffness_n_per_m / (w0 * w0), friction = mass * w0 / mode.quality_factor;
  const auto slope = [&](double t, const State& p) {
    const double phase = 2.0 * std::numbers::pi * static_cast<double>(spring.harmonic) * t;
    State a = State::Zero();
    a(0, 1) = 1.0;
    a(1, 0) = -(mode.stiffness_n_per_m + Spring::at(spring.mean, spring.stiffness, phase)) / mass;
    a(1, 1) = -(friction + Spring::at(spring.damping, spring.friction, phase)) / mass;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = static_cast<Eigen::Index>(2 + 2 * i);
      const Complex turn =
          2.0 / windows * std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(spring.bins[i]) * t);
      a(row, 0) = turn.real();
      a(row + 1, 0) = turn.imag();
    }
    State rate = a * p + p * a.transpose();
    rate(1, 1) += 2.0 * friction * boltzmann_nn_nm_per_k * temperature_k / (mass * mass);
    return rate;
  };
  State p = State::Zero();
  for (int window = -settle_windows; window < static_cast<int>(windows); ++window) {
    if (window == 0) {
      const Eigen::Matrix2d begin = p.topLeftCorner<2, 2>();
      p.setZero();
      p.topLeftCorner<2, 2>() = begin;
    }
    for (int i = 0; i < static_cast<int>(steps); ++i) {
      const double t = window + i / steps, h = 1.0 / steps;
      const State a = slope(t, p), b = slope(t + 0.5 * h, p + 0.5 * h * a),
                  c = slope(t + 0.5 * h, p + 0.5 * h * b), d = slope(t + h, p + h * c);
      p += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
  }
  return p.bottomRightCorner<8, 8>();
}

Eigen::MatrixXd covariance_of(const Spring& spring, unsigned windows) {
  const Cantilever cantilever{{spring.mode()}};
  Comb comb;
  comb.window_samples = 1000;
  for (const std::uint64_t bin : spring.bins) comb.tones.push_back({bin, true});
  const Harmonics harmonics(comb, cantilever, 1.0);
  // dF/dp0 = -dF/dd is the spring's stiffness, dF/d(velocity) minus its friction.
  std::vector<Complex> by_surface(80), by_velocity(80);
  by_surface[0] = spring.mean;
  by_velocity[0] = -spring.damping;
  if (spring.harmonic > 0) {
    by_surface[spring.harmonic / harmonics.periods()] = spring.stiffness;
    by_velocity[spring.harmonic / harmonics.periods()] = -spring.friction;
  }
  EngagedHeat heat(harmonics, cantilever, temperature_k, windows);
  EXPECT_TRUE(heat.engage({by_surface, by_velocity, harmonics.angular_frequency(1)}));
  return heat.covariance();
}

// Largest difference, in units of standard deviations' products.
double largest_difference(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& expected) {
  const Eigen::VectorXd scale = expected.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (covariance - expected) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

class EngagedTip : public testing::TestWithParam<Spring> {};

// Most is by kicks, which act amiss by (w step)^2/48 or less than 1 %, and by how sharp a resonance they
// move.
TEST_P(EngagedTip, HasTheThermalMotionOfItsEquationOfMotion) {
  for (const unsigned windows : {1U, 3U})
    EXPECT_LT(largest_difference(covariance_of(GetParam(), windows), covariance_in_time(GetParam(), windows)),
              2e-3)
        << windows;
}

TEST(EngagedHeat, DoesNotAllocateForManyTonesEither) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  Comb comb;
  comb.window_samples = 100'000;
  for (std::uint64_t bin = 200; bin < 264; ++bin) comb.tones.push_back({bin, true});
  const Cantilever cantilever{{{231.0, 15.0, 2.0, 1.0}}};
  const Harmonics harmonics(comb, cantilever, 1.0);
  EngagedHeat heat(harmonics, cantilever, temperature_k, 1);
  const std::vector<Complex> by_surface{0.3, 0.1};
  std::size_t allocations = 0;
  bool stable = false;
  {
    const ForbidAllocation guard;
    stable = heat.engage({by_surface, {}, harmonics.angular_frequency(1)});
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_TRUE(stable);
  EXPECT_GT(heat.covariance().diagonal().minCoeff(), 0.0);
}

const Spring coming_and_going{.quality_factor = 60.0, .mean = 0.6, .harmonic = 4, .stiffness = {0.3, 0.4}},
    viscous{
        .mean = 0.6, .damping = 0.004, .harmonic = 2, .stiffness = {0.3, -0.2}, .friction = {0.002, 0.001}},
    // At its stiffest twice the lever, once a period of the mode: moves the mean and the overtones along.
    tapping{.bins = close_neighbours,
            .frequency_hz = 70.3,
            .quality_factor = 60.0,
            .mean = 2.0,
            .harmonic = 70,
            .stiffness = {1.5, 1.0}},
    once_a_period{
        .bins = overtones, .quality_factor = 60.0, .mean = 0.3, .harmonic = 20, .stiffness = {0.1, 0.2}};

INSTANTIATE_TEST_SUITE_P(Free, EngagedTip,
                         testing::Values(Spring{}, Spring{.quality_factor = 60.0},
                                         Spring{.quality_factor = 120.0},  // rings for two windows
                                         Spring{.bins = overtones},
                                         Spring{.bins = overtones, .quality_factor = 60.0}));
INSTANTIATE_TEST_SUITE_P(OnASpring, EngagedTip,
                         testing::Values(Spring{.mean = 1.0}, Spring{.mean = 20.0},
                                         Spring{.mean = 200.0, .damping = 0.01},
                                         Spring{.mean = 0.5, .damping = 0.004},
                                         Spring{.bins = overtones, .mean = 0.1},
                                         Spring{.bins = overtones, .quality_factor = 60.0, .mean = 0.3}));
INSTANTIATE_TEST_SUITE_P(OnASpringThatChanges, EngagedTip,
                         testing::Values(coming_and_going, viscous, once_a_period, tapping));

}  // namespace
}  // namespace combforce::test
