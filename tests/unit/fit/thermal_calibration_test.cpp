#include "fit/thermal_calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace combforce {
namespace {

using ::testing::HasSubstr;

MeasuredMode measured(double frequency, double quality, double variance) {
  MeasuredMode mode{{frequency, quality, variance}, Eigen::Matrix3d::Zero()};
  mode.covariance.diagonal() << 1e-8, 4e-4, 1e-4;  // 0.01 %, 2 %, 1 %
  return mode;
}

// The vendor's parameters of a measured cantilever in water, and its answer, 45.87 mN/m:
// S = A^2 f0^4/(…) + W has the variance (pi/2) A^2 f0 Q.
TEST(ThermalCalibration, HasTheVendorsAnswerForTheVendorsParameters) {
  const double amplitude = 92.12e-6, f0 = 24.25e3, quality = 2.050;
  const MeasuredMode mode =
      measured(f0, quality, 0.5 * std::numbers::pi * amplitude * amplitude * f0 * quality);
  CalibrationSettings settings;
  settings.temperature_k = 298.15;
  settings.correction_factor = 0.9;
  settings.values = {11.0399};
  const double k = calibrate_thermal(std::vector{mode}, settings).modes.at(0).stiffness_n_per_m;
  // The parameters carry four digits.
  EXPECT_NEAR(k, 45.8785e-3, 5e-4 * 45.87e-3);
  settings.correction_factor = 1.0;
  EXPECT_NEAR(calibrate_thermal(std::vector{mode}, settings).modes.at(0).stiffness_n_per_m, k / 0.9, 1e-12);
}

TEST(ThermalCalibration, FindsEitherFromTheOther) {
  const std::vector modes{measured(50e3, 100.0, 4e-6)};
  CalibrationSettings settings;
  settings.temperature_k = 300.0;
  settings.values = {40.0};
  const Mode by_sensitivity = calibrate_thermal(modes, settings).modes.at(0);
  // <q^2> = 40^2 nm^2/V^2 4e-6 V^2, k = kB T/<q^2>.
  EXPECT_NEAR(by_sensitivity.stiffness_n_per_m, 1.380649e-23 * 300.0 / (6.4e-3 * 1e-18), 1e-12);
  settings.known = KnownQuantity::stiffness;
  settings.values = {by_sensitivity.stiffness_n_per_m};
  const Mode by_stiffness = calibrate_thermal(modes, settings).modes.at(0);
  EXPECT_NEAR(by_stiffness.sensitivity_nm_per_v, 40.0, 1e-10);
  EXPECT_EQ(by_stiffness.frequency_hz, 50e3);
  EXPECT_EQ(by_stiffness.quality_factor, 100.0);
}

double error(const Cantilever& result, std::size_t mode, int which) {
  return std::sqrt(log_covariance(result.modes.at(mode), result.uncertainty.at(mode))(which, which));
}

TEST(ThermalCalibration, PropagatesErrors) {
  const std::vector modes{measured(50e3, 100.0, 4e-6)};
  CalibrationSettings settings;
  settings.temperature_k = 300.0;
  settings.values = {40.0};
  settings.relative_error = 0.03;
  const Cantilever by_sensitivity = calibrate_thermal(modes, settings);
  EXPECT_NEAR(error(by_sensitivity, 0, 2), std::hypot(0.01, 2.0 * 0.03), 1e-12);
  EXPECT_NEAR(error(by_sensitivity, 0, 3), 0.03, 1e-12);
  settings.known = KnownQuantity::stiffness;
  const Cantilever by_stiffness = calibrate_thermal(modes, settings);
  EXPECT_NEAR(error(by_stiffness, 0, 2), 0.03, 1e-12);
  EXPECT_NEAR(error(by_stiffness, 0, 3), 0.5 * std::hypot(0.01, 0.03), 1e-12);
  settings.known = KnownQuantity::sader;
  settings.values.clear();
  settings.beam = BeamInFluid{200.0, 40.0, 1.18, 1.86e-5};
  const Cantilever by_sader = calibrate_thermal(modes, settings);
  // k goes with Q; alpha with 1/sqrt(k P).
  EXPECT_NEAR(error(by_sader, 0, 2), std::hypot(0.02, 0.03), 1e-5);
  EXPECT_NEAR(error(by_sader, 0, 3), 0.5 * std::hypot(0.02, 0.03, 0.01), 1e-5);
  EXPECT_EQ(by_sader.modes[0].stiffness_n_per_m,
            sader_stiffness(*settings.beam, 50e3, 100.0).stiffness_n_per_m);
}

TEST(ThermalCalibration, ScalesHigherModesAsABeam) {
  const std::vector modes{measured(50e3, 100.0, 4e-6), measured(313e3, 300.0, 3e-7)};
  CalibrationSettings settings;
  settings.temperature_k = 300.0;
  settings.values = {40.0};
  const auto energy = [&](const Mode& mode, std::size_t m) {
    return mode.stiffness_n_per_m * std::pow(mode.sensitivity_nm_per_v, 2) * modes[m].mode.variance_v2;
  };
  const double kbt = 1.380649e-5 * 300.0;
  for (const ModeScaling scaling : {ModeScaling::stiffness, ModeScaling::sensitivity}) {
    settings.scaling = scaling;
    const auto result = calibrate_thermal(modes, settings).modes;
    EXPECT_NEAR(energy(result[0], 0), kbt, 1e-12);
    EXPECT_NEAR(energy(result[1], 1), kbt, 1e-12);
    EXPECT_EQ(result[0].sensitivity_nm_per_v, 40.0);
    if (scaling == ModeScaling::stiffness) {
      EXPECT_NEAR(result[1].stiffness_n_per_m / result[0].stiffness_n_per_m, 39.275, 0.005);
    } else {
      EXPECT_NEAR(result[1].sensitivity_nm_per_v / 40.0, 1.3765 / 4.7812, 1e-4);
    }
  }
  settings.scaling = ModeScaling::stiffness;
  settings.mode_numbers = {2, 3};
  const auto higher = calibrate_thermal(modes, settings).modes;
  EXPECT_NEAR(higher[1].stiffness_n_per_m / higher[0].stiffness_n_per_m, 307.91 / 39.275, 0.002);
  settings.values = {40.0, 15.0};
  const auto both = calibrate_thermal(modes, settings).modes;
  EXPECT_EQ(both[1].sensitivity_nm_per_v, 15.0);
  EXPECT_NEAR(energy(both[1], 1), kbt, 1e-12);
}

TEST(ThermalCalibration, RefusesBadSettings) {
  const std::vector modes{measured(50e3, 100.0, 4e-6), measured(313e3, 300.0, 3e-7)};
  CalibrationSettings good;
  good.temperature_k = 300.0;
  good.values = {40.0};
  const auto refused = [&](auto change) {
    CalibrationSettings bad = good;
    change(bad);
    try {
      calibrate_thermal(modes, bad);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  using S = CalibrationSettings;
  EXPECT_THAT(refused([](S& s) { s.temperature_k = 0.0; }), HasSubstr("temperature_k: 0, must be above 0"));
  EXPECT_THAT(refused([](S& s) { s.correction_factor = -1.0; }), HasSubstr("correction_factor: -1"));
  EXPECT_THAT(refused([](S& s) { s.relative_error = -0.1; }), HasSubstr("relative_error: -0.1"));
  EXPECT_THAT(refused([](S& s) { s.values = {}; }), HasSubstr("must be one, or 2, one a mode"));
  EXPECT_THAT(refused([](S& s) { s.values = {1.0, 0.0}; }), HasSubstr("values[1]: 0"));
  EXPECT_THAT(refused([](S& s) { s.mode_numbers = {1}; }), HasSubstr("mode_numbers: 1"));
  EXPECT_THAT(refused([](S& s) { s.mode_numbers = {2, 2}; }), HasSubstr("mode_numbers[1]: 2"));
  EXPECT_THAT(refused([](S& s) { s.mode_numbers = {0, 2}; }), HasSubstr("mode_numbers[0]: 0"));
  EXPECT_THAT(refused([](S& s) { s.known = KnownQuantity::sader; }), HasSubstr("must be none"));
  EXPECT_THAT(refused([](S& s) { s.known = KnownQuantity::sader, s.values = {}; }),
              HasSubstr("beam: absent"));
  EXPECT_EQ(refused([](S&) {}), "accepted");
}

}  // namespace
}  // namespace combforce
