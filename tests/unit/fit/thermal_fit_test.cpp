#include "fit/thermal_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fit/thermal_oscillator.hpp"

namespace combforce {
namespace {

using ::testing::HasSubstr;

const FittedMode first{20e3, 25.0, 3e-6};
const FittedMode second{125e3, 80.0, 2e-7};
constexpr double floor_v2_per_hz = 2e-12;

// Bins at the expected density itself.
AveragedSpectrum exact_spectrum() {
  AveragedSpectrum spectrum{0.0, 50.0, {}, {40.0, {}}, std::nullopt};
  for (int bin = 0; bin <= 4000; ++bin) {
    double density = floor_v2_per_hz;
    for (const FittedMode& mode : {first, second})
      density +=
          mode.variance_v2 * oscillator_density(mode.frequency_hz, mode.quality_factor, 50.0 * bin).value;
    spectrum.density.push_back(density);
  }
  return spectrum;
}

ThermalFitSettings around_first() {
  return {{10e3, 40e3}, {}, {{21e3, 10.0}}};
}

void expect_mode(const FittedMode& fitted, const FittedMode& truth, double tolerance) {
  EXPECT_NEAR(fitted.frequency_hz / truth.frequency_hz, 1.0, tolerance);
  EXPECT_NEAR(fitted.quality_factor / truth.quality_factor, 1.0, tolerance);
  EXPECT_NEAR(fitted.variance_v2 / truth.variance_v2, 1.0, tolerance);
}

TEST(ThermalFit, FindsWhatMadeTheSpectrum) {
  const AveragedSpectrum spectrum = exact_spectrum();
  const ThermalFit fit = fit_thermal(spectrum, {{1e3, 200e3}, {}, {{18e3, 5.0}, {130e3, 30.0}}});
  EXPECT_EQ(fit.status, ThermalStatus::converged);
  ASSERT_EQ(fit.modes.size(), 2U);
  expect_mode(fit.modes[0], first, 1e-8);
  expect_mode(fit.modes[1], second, 1e-8);
  EXPECT_NEAR(fit.floor_v2_per_hz / floor_v2_per_hz, 1.0, 1e-8);
  EXPECT_TRUE(fit.floor_determined);
  EXPECT_NEAR(fit.greatest_ratio, 1.0, 1e-6);
}

// A fit may start from the quality factor of another: it never passes the bound, not even by rounding.
TEST(ThermalFit, MakesAToneAsNarrowAsItMay) {
  AveragedSpectrum spectrum = exact_spectrum();
  for (double& density : spectrum.density) density = floor_v2_per_hz;
  spectrum.density[400] *= 1e6;  // at 20 kHz
  const ThermalFit fit = fit_thermal(spectrum, around_first());
  EXPECT_EQ(fit.modes.at(0).quality_factor, most_quality_factor);
}

// A block of the other mode's tail passes for floor: 1e-3 of the first mode's peak.
TEST(ThermalFit, TakesModesOneByOneToo) {
  const ThermalFit fit = fit_thermal(exact_spectrum(), around_first());
  expect_mode(fit.modes.at(0), first, 1e-3);
}

TEST(ThermalFit, StartsFromFrequencyAlone) {
  const AveragedSpectrum spectrum = exact_spectrum();
  for (const FittedMode& mode : {first, second}) {
    for (const double off : {0.85, 1.0, 1.2}) {
      const double about = off * mode.frequency_hz;
      const OscillatorStart start = find_start(spectrum, about, {0.5 * about, 2.0 * about});
      EXPECT_NEAR(start.frequency_hz / mode.frequency_hz, 1.0, 0.5 / mode.quality_factor);
      EXPECT_NEAR(std::log(start.quality_factor / mode.quality_factor), 0.0, std::log(2.0));
    }
  }
}

TEST(ThermalFit, LeavesOutWhatIsExcluded) {
  AveragedSpectrum spectrum = exact_spectrum();
  for (std::size_t bin = 440; bin <= 444; ++bin) spectrum.density[bin] *= 1000.0;  // a tone at 22.1 kHz
  ThermalFitSettings settings = around_first();
  const ThermalFit misled = fit_thermal(spectrum, settings);
  EXPECT_EQ(misled.status, ThermalStatus::misfit);
  EXPECT_GT(misled.greatest_ratio, 5.0);  // floor and peak have risen towards the tone
  EXPECT_NEAR(misled.greatest_at_hz, 22.1e3, 200.0);
  settings.excluded = {{21.9e3, 22.3e3}};
  const ThermalFit fit = fit_thermal(spectrum, settings);
  EXPECT_EQ(fit.bins, misled.bins - 9);
  expect_mode(fit.modes.at(0), first, 1e-3);
}

TEST(ThermalFit, HoldsAFloorThatIsNotThere) {
  AveragedSpectrum spectrum = exact_spectrum();
  for (std::size_t bin = 0; bin < spectrum.density.size(); ++bin)
    spectrum.density[bin] =
        first.variance_v2 *
        oscillator_density(first.frequency_hz, first.quality_factor, spectrum.frequency_hz(bin)).value;
  const ThermalFit fit = fit_thermal(spectrum, around_first());
  EXPECT_FALSE(fit.floor_determined);
  EXPECT_TRUE(std::isnan(fit.floor_error()));
  EXPECT_GT(fit.variance_error(0), 0.0);
  expect_mode(fit.modes.at(0), first, 1e-4);
}

TEST(ThermalFit, SaysWhenAModeIsNotThere) {
  AveragedSpectrum spectrum = exact_spectrum();
  std::mt19937_64 random(5);
  std::gamma_distribution<double> gamma(40.0, 1.0 / 40.0);
  for (double& density : spectrum.density) density = 1e-10 * gamma(random);
  const ThermalFit fit = fit_thermal(spectrum, around_first());
  // Whatever it finds in the noise, its error bar says that it is nothing.
  EXPECT_TRUE(fit.status != ThermalStatus::converged || fit.variance_error(0) > 0.25);
}

// Likelihood against least squares: with single periodograms (exponential scatter) the mean of S/M is 1, and
// errors grow as those of the Fisher information of a mean: 1/sqrt(bins).
TEST(ThermalFit, ErrorsFollowAveragesAndCorrelation) {
  AveragedSpectrum spectrum = exact_spectrum();
  const ThermalFit independent = fit_thermal(spectrum, around_first());
  spectrum.statistics.averages = 160.0;
  const ThermalFit averaged = fit_thermal(spectrum, around_first());
  EXPECT_NEAR(averaged.variance_error(0), 0.5 * independent.variance_error(0),
              1e-6 * independent.variance_error(0));
  // Hann: 1 + 2(4/9 + 1/36) for gradients that are smooth over 20 bins a peak.
  spectrum.statistics = {40.0, hann_correlation};
  const ThermalFit correlated = fit_thermal(spectrum, around_first());
  EXPECT_NEAR(correlated.variance_error(0) / independent.variance_error(0), std::sqrt(35.0 / 18.0), 0.02);
}

TEST(ThermalFit, RefusesWhatCannotBeFitted) {
  const AveragedSpectrum spectrum = exact_spectrum();
  AveragedSpectrum zero = spectrum, none = spectrum;
  zero.density[401] = 0.0;
  none.density[401] = std::nan("");
  struct Case {
    const AveragedSpectrum& spectrum;
    ThermalFitSettings settings;
    const char* said;
  };
  const Case cases[] = {
      {spectrum, {{40e3, 10e3}, {}, {{20e3, 10.0}}}, "band.low_hz: 40000"},
      {spectrum, {{-1.0, 10e3}, {}, {{5e3, 10.0}}}, "band.low_hz: -1"},
      {spectrum, {{10e3, 40e3}, {}, {}}, "modes: 0, must be at least one"},
      {spectrum, {{10e3, 40e3}, {}, {{50e3, 10.0}}}, "within the band 10000 to 40000 Hz"},
      {spectrum, {{10e3, 40e3}, {}, {{20e3, 0.5}}}, "modes.quality_factor: 0.5, must be in [0.51, 1"},
      {spectrum, {{19.5e3, 20.5e3}, {}, {{20e3, 10.0}}}, "21 bins of 50 Hz"},
      {spectrum, {{300e3, 400e3}, {}, {{350e3, 10.0}}}, "0 bins of 50 Hz"},
      {zero, around_first(), "density at 20050 Hz: 0, must be positive and finite"},
      {none, around_first(), "density at 20050 Hz: nan, must be positive and finite"},
  };
  for (const Case& bad : cases) {
    try {
      fit_thermal(bad.spectrum, bad.settings);
      ADD_FAILURE() << bad.said;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad.said));
    }
  }
  EXPECT_THROW(find_start(spectrum, 1e6, {0.5e6, 2e6}), std::invalid_argument);
}

}  // namespace
}  // namespace combforce
