// What conditions a pixel is measured under: near a surface that damps the cantilever, on a shaken base, with
// a calibration that is uncertain.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "fit/excitation.hpp"
#include "tests/integration/simulated_pixel.hpp"

namespace combforce {
namespace {

using test::greatest_error;
using test::Phasors;
using test::SimulatedPixels;

const std::vector<double> hertz{-40.0, 1.0}, dmt{-40.0, 1.0, 5.0, 0.5};

FitResult fitted(const FitConditions& conditions, const Phasors& tones) {
  PixelFitter fitter(conditions);
  FitResult result;
  fitter.fit(tones, result);
  return result;
}

// Air squeezed between tip and surface: the first mode loses a fiftieth of its Q there, and some of its
// frequency. Measured far away are the free motion and the cantilever.
class SqueezeFilm : public ::testing::Test {
 protected:
  SqueezeFilm() : far(SimulatedPixels::paper(test::four_tones)), near(far) {
    near.cantilever.modes[0].quality_factor *= 0.98;
    near.cantilever.modes[0].frequency_hz *= 0.9999;
    near.cantilever.modes[0].stiffness_n_per_m *= 0.9999 * 0.9999;  // the same mass
    conditions = near.conditions("dmt", 30);
    FreeResponse& free = *conditions.free_response;
    free.lifted_nm = free.mean_nm;
    const Phasors forces = near.drive_forces_nn();
    for (std::size_t i = 0; i < forces.size(); ++i)
      free.mean_nm[i] = tip_response(far.cantilever, SimulatedPixels::frequency_hz(far.bins[i])) * forces[i];
    conditions.cantilever = far.cantilever;
  }

  SimulatedPixels far, near;
  FitConditions conditions;
};

TEST_F(SqueezeFilm, IsRemovedByALiftedReference) {
  const Phasors tones = near.tones("dmt", dmt).value();
  // The linear force alone, seen as tip-surface force, is no such model's.
  const FitResult biased = fitted(conditions, tones);
  EXPECT_EQ(biased.status, FitStatus::misfit);
  conditions.settings.background = Background::linear;
  const FitResult result = fitted(conditions, tones);
  EXPECT_EQ(result.status, FitStatus::converged);
  // What is left: the first mode's background as seen by the other modes' tones.
  EXPECT_LT(greatest_error(result, dmt), 2e-3);
}

TEST_F(SqueezeFilm, IsNotRemovedBeforeTheTipWasLifted) {
  const Phasors tones = near.tones("dmt", dmt).value();
  conditions.settings.background = Background::linear;
  conditions.free_response->lifted_nm.reset();
  EXPECT_EQ(fitted(conditions, tones).status, FitStatus::no_free_response);
}

// A shaker moves the tip as forces do that give the tip the same free motion; only the detector sees less.
TEST(ShakenBase, MovesTheTipBesideItsDeflection) {
  SimulatedPixels pixels = SimulatedPixels::paper(test::four_tones);
  pixels.bins.insert(pixels.bins.begin(), 5);  // measured beside the drive
  const double sensitivities[] = {20.0, -7.0, 4.0, -3.0};
  for (std::size_t m = 0; m < 4; ++m) pixels.cantilever.modes[m].sensitivity_nm_per_v = sensitivities[m];
  const Phasors tip = pixels.tones("dmt", dmt).value();
  FitConditions conditions = pixels.conditions("dmt", 30);
  Phasors& free = conditions.free_response->mean_nm;
  Phasors seen = tip;
  for (std::size_t i = 0; i < tip.size(); ++i) {
    if (free[i] == 0.0) {
      free[i] = 1e-5;  // noise: as the answer to a base that moves it would be one of 0.01 nm
      continue;
    }
    const double hz = SimulatedPixels::frequency_hz(pixels.bins[i]);
    std::complex<double> deflection, volts;  // of unit base motion
    for (std::size_t m = 0; m < 4; ++m) {
      const Mode& mode = pixels.cantilever.modes[m];
      const std::complex<double> one =
          beam_participation(static_cast<unsigned>(m + 1)) * hz * hz /
          (mode.frequency_hz * mode.frequency_hz - hz * hz +
           std::complex<double>(0.0, hz * mode.frequency_hz / mode.quality_factor));
      deflection += one;
      volts += one / mode.sensitivity_nm_per_v;
    }
    const std::complex<double> base = free[i] / (1.0 + deflection);
    const std::complex<double> apparent = tip_per_volt(pixels.cantilever, hz) * volts * base;
    seen[i] = apparent + tip[i] - free[i];  // the surface's force acts at the tip
    free[i] = apparent;
  }
  const FitResult biased = fitted(conditions, seen);
  // The base moves by hundredths of a nanometre, 25 nm/(Q Gamma) in the first mode: the surface seems off by
  // some of that.
  EXPECT_GT(greatest_error(biased, dmt), 0.01);
  conditions.excitation.kind = Excitation::Kind::base;
  const FitResult result = fitted(conditions, seen);
  EXPECT_EQ(result.status, FitStatus::converged);
  // As without a shaker, on exact tones.
  EXPECT_LT(greatest_error(result, dmt), 1e-3);
}

// Of one mode, forces go as k, deflections and forces as alpha: of a Hertz contact p0 goes as alpha, p1 as
// k/sqrt(alpha), refined or not.
class UncertainCalibration : public ::testing::TestWithParam<unsigned> {
 protected:
  UncertainCalibration() : pixels(SimulatedPixels::intermodulation()) {
    tones = pixels.tones("hertz", hertz).value();
    conditions = pixels.conditions("hertz", GetParam());
    conditions.settings.calibration_errors = true;
  }
  FitResult with(std::array<double, 4> relative_errors, std::array<double, 6> correlation = {}) {
    const Mode& mode = pixels.cantilever.modes[0];
    const std::array values{mode.frequency_hz, mode.quality_factor, mode.stiffness_n_per_m,
                            std::abs(mode.sensitivity_nm_per_v)};
    for (std::size_t i = 0; i < 4; ++i) relative_errors[i] *= values[i];
    conditions.cantilever.uncertainty = {{relative_errors, correlation}};
    return fitted(conditions, tones);
  }

  SimulatedPixels pixels;
  Phasors tones;
  FitConditions conditions;
};

TEST_P(UncertainCalibration, ReachesTheParametersAsTheyScale) {
  const FitResult stiffness = with({0, 0, 0.1, 0});
  ASSERT_EQ(stiffness.status, FitStatus::converged);
  const double p0 = std::abs(stiffness.parameters[0]), p1 = stiffness.parameters[1];
  // Steps of 2e-2 in the paper's fit, which is good to 5e-5: alpha^(-5/2) is linear to 4 % over that.
  EXPECT_NEAR(stiffness.calibration_errors[0], 0.0, 1e-3 * p0);
  EXPECT_NEAR(stiffness.calibration_errors[1], 0.1 * p1, 0.05 * 0.1 * p1);
  const FitResult sensitivity = with({0, 0, 0, 0.02});
  EXPECT_NEAR(sensitivity.calibration_errors[0], 0.02 * p0, 0.05 * 0.02 * p0);
  EXPECT_NEAR(sensitivity.calibration_errors[1], 0.01 * p1, 0.05 * 0.01 * p1);
  // Equipartition, k alpha^2 known exactly: p1 goes as alpha^(-5/2).
  const FitResult thermal = with({0, 0, 0.04, 0.02}, {0, 0, 0, 0, 0, -1});
  EXPECT_NEAR(thermal.calibration_errors[0], 0.02 * p0, 0.05 * 0.02 * p0);
  EXPECT_NEAR(thermal.calibration_errors[1], 0.05 * p1, 0.05 * 0.05 * p1);
}

TEST_P(UncertainCalibration, ChangesNothingElse) {
  const FitResult with_errors = with({1e-3, 0.01, 0.1, 0.02});
  conditions.settings.calibration_errors = false;
  const FitResult without = fitted(conditions, tones);
  for (std::size_t k = 0; k < hertz.size(); ++k) {
    EXPECT_EQ(with_errors.parameters[k], without.parameters[k]);
    EXPECT_EQ(with_errors.std_errors[k], without.std_errors[k]);
    EXPECT_GT(with_errors.calibration_errors[k], 0.0);
    EXPECT_TRUE(std::isnan(without.calibration_errors[k]));
  }
}

TEST_P(UncertainCalibration, GoesWithOtherModelsAndTheirBounds) {
  conditions.settings.weighting = Weighting::noise;
  conditions.settings.compare = {"dmt"};
  conditions.settings.bounds = {{"adhesion_nn", 0.1, 10.0}};
  const FitResult result = with({0, 0, 0.1, 0});
  EXPECT_GT(result.calibration_errors[1], 0.0);
  EXPECT_EQ(result.compared_count, 1U);
  conditions.settings.model = "jkr";
  conditions.settings.refine = 0;
  EXPECT_THROW(with({0, 0, 0.1, 0}), std::invalid_argument) << "steps of its E";
}

INSTANTIATE_TEST_SUITE_P(Refine, UncertainCalibration, ::testing::Values(0U, 30U));

}  // namespace
}  // namespace combforce
