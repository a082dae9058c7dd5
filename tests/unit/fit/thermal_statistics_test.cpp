// Many draws of thermal streams, made by an exact recursion that shares nothing with the fit: are the fitted
// values unbiased, and do they scatter as their error bars say?
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "dsp/spectrum.hpp"
#include "fit/thermal_calibration.hpp"
#include "fit/thermal_fit.hpp"
#include "tests/support/thermal_stream.hpp"

namespace combforce {
namespace {

constexpr int draws = 200;

// (estimate - truth)/(error bar) over draws.
class Pulls {
 public:
  void add(double pull) {
    sum_ += pull;
    squares_ += pull * pull;
    ++count_;
  }
  double mean() const { return sum_ / count_; }
  double deviation() const { return std::sqrt(squares_ / count_ - mean() * mean()); }

 private:
  double sum_ = 0.0, squares_ = 0.0;
  int count_ = 0;
};

struct Case {
  double rate_hz;
  std::size_t samples, segment;
  FittedMode truth;
  double floor;
  FrequencyBand band;
  bool smeared = true;  // the model knows of the window
};

struct Report {
  std::array<Pulls, 4> pulls;  // f0, Q, floor, k
  Pulls quality;               // relative errors themselves
};

AveragedSpectrum draw_spectrum(const Case& one, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> samples(one.samples);
  test::ThermalStream(one.rate_hz, one.truth.frequency_hz, one.truth.quality_factor, one.truth.variance_v2)
      .add(samples, random);
  test::add_white(samples, one.floor, one.rate_hz, random);
  WelchSpectrum welch(one.segment, one.rate_hz);
  welch.push(samples);
  AveragedSpectrum spectrum{0.0, welch.bin_hz(), welch.density(), hann_statistics(welch.segments()), {}};
  if (one.smeared) spectrum.record = HannRecord{one.segment, one.rate_hz};
  return spectrum;
}

Report run(const Case& one) {
  CalibrationSettings settings;
  settings.temperature_k = 300.0;
  settings.values = {50.0};
  const double k = 1.380649e-5 * 300.0 / (2500.0 * one.truth.variance_v2);
  Report report;
  for (int draw = 0; draw < draws; ++draw) {
    const AveragedSpectrum spectrum = draw_spectrum(one, static_cast<std::uint64_t>(draw));
    const ThermalFit fit = fit_thermal(
        spectrum, {one.band, {}, {find_start(spectrum, 1.05 * one.truth.frequency_hz, one.band)}});
    EXPECT_TRUE(fit.status == ThermalStatus::converged || fit.status == ThermalStatus::misfit) << draw;
    const auto pull = [](double estimate, double truth, double relative) {
      return std::log(estimate / truth) / relative;
    };
    const FittedMode& mode = fit.modes[0];
    const auto calibrated = calibrate_thermal(std::vector{measured_mode(fit, 0)}, settings);
    report.pulls[0].add(pull(mode.frequency_hz, one.truth.frequency_hz, fit.frequency_error(0)));
    report.pulls[1].add(pull(mode.quality_factor, one.truth.quality_factor, fit.quality_error(0)));
    report.pulls[2].add(pull(fit.floor_v2_per_hz, one.floor, fit.floor_error()));
    report.pulls[3].add(
        pull(calibrated.modes[0].stiffness_n_per_m, k,
             calibrated.uncertainty[0].std_errors[2] / calibrated.modes[0].stiffness_n_per_m));
    report.quality.add(std::log(mode.quality_factor / one.truth.quality_factor));
  }
  return report;
}

constexpr std::array names{"f0", "Q", "floor", "k"};

// Of 200 draws the mean pull scatters by 1/sqrt(200) = 0.07 and their deviation by 1/sqrt(400) = 0.05: four
// of these. Logarithms of estimates with 5 % error are low by half their variance, 0.025 of the error.
void expect_unbiased(const Report& report, double greatest_deviation = 1.2) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_NEAR(report.pulls[i].mean(), 0.0, 0.3) << names[i];
    EXPECT_GT(report.pulls[i].deviation(), 0.8) << names[i];
    EXPECT_LT(report.pulls[i].deviation(), greatest_deviation) << names[i];
    ::testing::Test::RecordProperty(
        std::string("pull_") + names[i],
        std::to_string(report.pulls[i].mean()) + " " + std::to_string(report.pulls[i].deviation()));
  }
}

// Q 100: segments of 31 ring-downs, 60 averages.
TEST(ThermalStatistics, InAir) {
  expect_unbiased(run({1e6, 1 << 19, 16384, {60e3, 100.0, 1e-6}, 1e-12, {50e3, 70e3}}));
}

TEST(ThermalStatistics, InWater) {
  expect_unbiased(run({5e5, 1 << 17, 4096, {24e3, 2.1, 1e-6}, 2e-12, {1e3, 80e3}}));
}

// Exponential scatter, where least squares fails worst.
TEST(ThermalStatistics, OfOnePeriodogram) {
  expect_unbiased(run({5e5, 1 << 16, 1 << 16, {24e3, 20.0, 1e-6}, 2e-12, {10e3, 40e3}}));
}

// Segments of 3.9 ring-downs: the peak is as wide as a bin. The window in the model keeps the values
// unbiased; the error bars, which take bins for correlated by the window alone, are a quarter too small.
// Without the window in the model Q is low by many times its error.
TEST(ThermalStatistics, OfShortSegments) {
  Case one{1e6, 1 << 18, 2048, {60e3, 100.0, 1e-6}, 1e-12, {20e3, 120e3}};
  const Report report = run(one);
  expect_unbiased(report, 1.5);
  EXPECT_NEAR(report.quality.mean(), 0.0, 4.0 * report.quality.deviation() / std::sqrt(draws));
  one.smeared = false;
  const Report plain = run(one);
  EXPECT_LT(plain.quality.mean(), -0.05);
  ::testing::Test::RecordProperty("quality_bias_without_window", std::to_string(plain.quality.mean()));
}

}  // namespace
}  // namespace combforce
