// chi and chi_V against oscillators integrated in time; thermal force density against equipartition;
// variances of phasors against windows of drawn noise.
#include "fit/cantilever.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include "fit/drive.hpp"
#include "fit/noise.hpp"
#include "fit/units.hpp"
#include "tests/unit/fit/paper_cantilever.hpp"

namespace combforce {
namespace {

using Complex = std::complex<double>;

// Peak phasor of the steady deflection under the force cos(w t), 1 nN: k q''/w0^2 + k q'/(w0 Q) + k q = F by
// Runge-Kutta's method from rest, projected on the last of many periods.
Complex phasor_by_integration(const Mode& mode, double frequency_hz) {
  const double w0 = 2.0 * std::numbers::pi * mode.frequency_hz, w = 2.0 * std::numbers::pi * frequency_hz;
  const auto acceleration = [&](double t, double q, double v) {
    return w0 * w0 * (std::cos(w * t) / mode.stiffness_n_per_m - q) - w0 / mode.quality_factor * v;
  };
  constexpr int steps = 400;
  const double h = 1.0 / (frequency_hz * steps);
  // The transient dies as exp(-t/ring-down): 30 of them leave 1e-13.
  const auto periods = static_cast<int>(std::ceil(30.0 * ring_down_s(mode) * frequency_hz)) + 1;
  double q = 0.0, v = 0.0;
  Complex sum = 0.0;
  for (int i = 0; i < periods * steps; ++i) {
    const double t = h * i;
    if (i >= (periods - 1) * steps) sum += q * std::polar(1.0, -w * t);
    const double q1 = v, v1 = acceleration(t, q, v);
    const double q2 = v + 0.5 * h * v1, v2 = acceleration(t + 0.5 * h, q + 0.5 * h * q1, q2);
    const double q3 = v + 0.5 * h * v2, v3 = acceleration(t + 0.5 * h, q + 0.5 * h * q2, q3);
    const double q4 = v + h * v3, v4 = acceleration(t + h, q + h * q3, q4);
    q += h / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4);
    v += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
  }
  return 2.0 / steps * sum;
}

TEST(Cantilever, ResponseIsTheSteadyStateOfTheEquationOfMotion) {
  const Mode mode{117e3, 20.0, 4.0, 1.0};
  for (const double frequency_hz : {30e3, 110e3, 117e3, 125e3, 400e3}) {
    const Complex expected = phasor_by_integration(mode, frequency_hz);
    // Runge-Kutta with 400 steps a period of the drive: (2 pi/400)^4 = 6e-8, times Q.
    EXPECT_LT(std::abs(mode_response(mode, frequency_hz) - expected), 1e-5 * std::abs(expected))
        << frequency_hz;
  }
}

TEST(Cantilever, ModesShareTheForceAndTheDetectorSeesEachThroughItsSensitivity) {
  const Cantilever cantilever{{{100e3, 15.0, 4.0, 50.0}, {250e3, 25.0, 60.0, -20.0}}};
  for (const double frequency_hz : {80e3, 160e3, 260e3}) {
    const Complex first = phasor_by_integration(cantilever.modes[0], frequency_hz);
    const Complex second = phasor_by_integration(cantilever.modes[1], frequency_hz);
    const Complex tip_nm = first + second, volts = first / 50.0 + second / -20.0;
    const double scale = std::abs(first) + std::abs(second);
    EXPECT_LT(std::abs(tip_response(cantilever, frequency_hz) - tip_nm), 1e-5 * scale);
    EXPECT_LT(std::abs(detector_response(cantilever, frequency_hz) - volts), 1e-5 * scale / 20.0);
    EXPECT_LT(std::abs(tip_per_volt(cantilever, frequency_hz) * volts - tip_nm),
              1e-5 * scale * std::abs(tip_nm / volts) / 10.0 + 1e-5 * scale);
  }
}

// The free decay of the amplitude is exp(-w0 t/(2Q)).
TEST(Cantilever, RingDownIsThatOfTheSlowestMode) {
  const Cantilever cantilever = test::paper_cantilever();
  for (const Mode& mode : cantilever.modes)
    EXPECT_DOUBLE_EQ(ring_down_s(mode),
                     2.0 * mode.quality_factor / (2.0 * std::numbers::pi * mode.frequency_hz));
  EXPECT_NEAR(longest_ring_down_s(cantilever), 576.8e-6, 0.1e-6);  // mode 1: 212/(pi 117 kHz)
}

TEST(Cantilever, BadModesAreNamed) {
  const auto message_of = [](auto change) {
    Cantilever cantilever = test::paper_cantilever();
    change(cantilever.modes[2]);
    try {
      validate(cantilever);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  using testing::AllOf;
  using testing::HasSubstr;
  EXPECT_EQ(message_of([](Mode&) {}), "");
  EXPECT_THAT(message_of([](Mode& m) { m.frequency_hz = 0.0; }),
              AllOf(HasSubstr("cantilever.modes[2].frequency_hz"), HasSubstr("0"), HasSubstr("positive")));
  EXPECT_THAT(message_of([](Mode& m) { m.quality_factor = -3.0; }), HasSubstr("modes[2].quality_factor: -3"));
  EXPECT_THAT(message_of([](Mode& m) { m.stiffness_n_per_m = std::numeric_limits<double>::quiet_NaN(); }),
              HasSubstr("modes[2].stiffness_n_per_m: nan"));
  EXPECT_THAT(message_of([](Mode& m) { m.sensitivity_nm_per_v = 0.0; }),
              HasSubstr("modes[2].sensitivity_nm_per_v: 0"));
  EXPECT_THROW(validate(Cantilever{}), std::invalid_argument);
}

// Equipartition: the integral over f of S |chi|^2 is kB T/k.
TEST(Noise, ThermalForceMakesEveryModeMoveByEquipartition) {
  using Rule = boost::math::quadrature::gauss_kronrod<double, 61>;
  for (const Mode& mode : test::paper_cantilever().modes) {
    const auto density = [&](double f) {
      return std::norm(mode_response(mode, f)) * thermal_force_density(mode, 300.0);
    };
    double mean_square = 0.0;
    const double width = mode.frequency_hz / mode.quality_factor;
    double from = 0.0;
    for (const double to :
         {mode.frequency_hz - 30.0 * width, mode.frequency_hz - 3.0 * width, mode.frequency_hz,
          mode.frequency_hz + 3.0 * width, mode.frequency_hz + 30.0 * width, 3.0 * mode.frequency_hz,
          100.0 * mode.frequency_hz}) {
      mean_square += Rule::integrate(density, from, to, 12, 1e-10);
      from = to;
    }
    // Beyond 100 f0 S|chi|^2 falls as f^-4: less than 1e-6 of the whole is left.
    EXPECT_NEAR(mean_square, 4.1419e-3 / mode.stiffness_n_per_m, 2e-5 * mean_square) << mode.frequency_hz;
  }
}

// The paper's table: 21, 26, 33, 43 fN/sqrt(Hz).
TEST(Noise, ThermalForceDensitiesAreThoseOfThePaper) {
  const auto modes = test::paper_cantilever().modes;
  const std::vector<double> expected_fn{21.0, 26.0, 33.0, 43.0};
  for (std::size_t m = 0; m < modes.size(); ++m)
    EXPECT_NEAR(1e6 * std::sqrt(thermal_force_density(modes[m], 300.0)), expected_fn[m], 0.55) << m;
}

// Forces of two modes drawn white, their motion and the detector's noise read at one tone, windows averaged,
// and the force taken back through chi: the variance of each quadrature is what fits reckon with.
TEST(Noise, ForceQuadratureVarianceIsThatOfWindowsOfWhiteNoise) {
  const Cantilever cantilever{{{100e3, 15.0, 4.0, 1.0}, {160e3, 25.0, 10.0, 1.0}}};
  const Noise noise{300.0, {1.0, 4e-5}};
  constexpr double frequency_hz = 130e3, delta_f_hz = 1e3, rate_hz = 520e3;
  constexpr unsigned windows = 4;
  constexpr int samples = 520, draws = 4000;
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  const auto phasor = [&](double one_sided_density) {  // of white noise over one window
    const double sigma = std::sqrt(one_sided_density * rate_hz / 2.0);
    Complex sum = 0.0;
    for (int n = 0; n < samples; ++n)
      sum += sigma * normal(engine) * std::polar(1.0, -2.0 * std::numbers::pi * frequency_hz / rate_hz * n);
    return 2.0 / samples * sum;
  };
  double square = 0.0;
  for (int i = 0; i < draws; ++i) {
    Complex motion = 0.0;
    for (unsigned w = 0; w < windows; ++w) {
      for (const Mode& mode : cantilever.modes)
        motion += mode_response(mode, frequency_hz) * phasor(thermal_force_density(mode, 300.0));
      motion += phasor(1.6e-9);
    }
    square += std::norm(motion / tip_response(cantilever, frequency_hz)) / (windows * windows);
  }
  const double expected = force_quadrature_variance(cantilever, noise, 1, frequency_hz, delta_f_hz, windows);
  // 2 x 4000 quadratures: a variance is known to sqrt(2/8000) = 1.6 %; four of that.
  EXPECT_NEAR(square / (2.0 * draws), expected, 0.064 * expected);
  const double thermal = tip_force_density(cantilever, frequency_hz, 300.0) * delta_f_hz / windows;
  EXPECT_GT(expected, 1.2 * thermal) << "the detector's share must be seen";
  EXPECT_LT(expected, 5.0 * thermal) << "and the thermal one";
}

TEST(Noise, OneDetectorDensityServesAllTones) {
  const Cantilever cantilever = test::paper_cantilever();
  for (const std::size_t tone : {0U, 3U})
    EXPECT_EQ(
        force_quadrature_variance(cantilever, {300.0, {1e-4}}, tone, 117e3, 500.0, 1),
        force_quadrature_variance(cantilever, {300.0, {1e-4, 1e-4, 1e-4, 1e-4}}, tone, 117e3, 500.0, 1));
}

TEST(Noise, BadValuesAreNamed) {
  using testing::HasSubstr;
  using testing::ThrowsMessage;
  EXPECT_NO_THROW(validate(Noise{300.0, {0.0}}, 4));
  EXPECT_THAT(
      [] {
        validate(Noise{-1.0, {0.0}}, 4);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("noise.temperature_k: -1")));
  EXPECT_THAT(
      [] {
        validate(Noise{300.0, {0.0, 0.0}}, 4);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("noise.detector_nm_per_sqrt_hz: 2 values")));
  EXPECT_THAT(
      [] {
        validate(Noise{300.0, {0.0, -2.0}}, 2);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("noise.detector_nm_per_sqrt_hz[1]: -2")));
}

std::vector<double> free_amplitudes(const Drive& drive, const std::vector<double>& frequencies_hz) {
  const Cantilever cantilever = test::paper_cantilever();
  const auto forces = drive_forces(drive, cantilever, frequencies_hz);
  std::vector<double> amplitudes;
  for (std::size_t i = 0; i < forces.size(); ++i)
    amplitudes.push_back(std::abs(forces[i] * tip_response(cantilever, frequencies_hz[i])));
  return amplitudes;
}

TEST(Drive, EqualEnergyIsThePapersEquation12) {
  const auto amplitudes =
      free_amplitudes({DriveScheme::equal_energy, 50.0, {}, {}}, {117e3, 674e3, 1758e3, 3235e3});
  const std::vector<double> stiffnesses{4.0, 78.5, 366.0, 1330.0};
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    sum += amplitudes[i];
    EXPECT_NEAR(stiffnesses[i] * amplitudes[i] * amplitudes[i], 4.0 * amplitudes[0] * amplitudes[0], 1e-9);
  }
  EXPECT_NEAR(sum, 50.0, 1e-12);
  EXPECT_NEAR(amplitudes[0], 36.0981, 1e-4);  // the prototype's free response
}

TEST(Drive, EqualAmplitudeAndListedAmplitudesAreAsNamed) {
  EXPECT_THAT(free_amplitudes({DriveScheme::equal_amplitude, 50.0, {}, {}}, {117e3, 674e3}),
              testing::Pointwise(testing::DoubleNear(1e-12), {25.0, 25.0}));
  EXPECT_THAT(free_amplitudes({DriveScheme::amplitudes, 50.0, {3.0, 0.0}, {}}, {117e3, 674e3}),
              testing::Pointwise(testing::DoubleNear(1e-12), {3.0, 0.0}));
}

TEST(Drive, PhasesAreThoseOfTheForces) {
  const std::vector<double> frequencies_hz{117e3, 674e3};
  const auto forces = drive_forces({DriveScheme::equal_amplitude, 50.0, {}, {0.5, -2.0}},
                                   test::paper_cantilever(), frequencies_hz);
  EXPECT_NEAR(std::arg(forces[0]), 0.5, 1e-14);
  EXPECT_NEAR(std::arg(forces[1]), -2.0, 1e-14);
}

TEST(Drive, BadListsAreNamed) {
  const std::vector<double> frequencies_hz{117e3, 674e3};
  const auto thrown = [&](const Drive& drive) {
    try {
      drive_forces(drive, test::paper_cantilever(), frequencies_hz);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  using testing::HasSubstr;
  EXPECT_THAT(thrown({DriveScheme::amplitudes, 50.0, {1.0}, {}}),
              HasSubstr("drive.amplitudes_nm: 1 values for 2"));
  EXPECT_THAT(thrown({DriveScheme::amplitudes, 50.0, {1.0, -1.0}, {}}),
              HasSubstr("drive.amplitudes_nm[1]: -1"));
  EXPECT_THAT(thrown({DriveScheme::equal_energy, 0.0, {}, {}}), HasSubstr("drive.total_amplitude_nm: 0"));
  EXPECT_THAT(thrown({DriveScheme::equal_energy, 50.0, {}, {1.0}}),
              HasSubstr("drive.phases_rad: 1 values for 2"));
}

}  // namespace
}  // namespace combforce
