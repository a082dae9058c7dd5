#include "fit/thermal_spectrum.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <random>

#include "fit/thermal_oscillator.hpp"

namespace combforce {
namespace {

using std::numbers::pi;

TEST(ThermalOscillator, HasVarianceOne) {
  for (const double quality : {0.3, 2.0, 50.0}) {
    // By f = f0 tan(u), a smooth integrand over (0, pi/2).
    double sum = 0.0;
    constexpr int steps = 200'000;
    for (int i = 0; i < steps; ++i) {
      const double u = 0.5 * pi * (i + 0.5) / steps;
      const double cosine = std::cos(u);
      sum += oscillator_density(1e3, quality, 1e3 * std::tan(u)).value * 1e3 / (cosine * cosine) * 0.5 * pi /
             steps;
    }
    EXPECT_NEAR(sum, 1.0, 1e-9) << quality;  // the midpoint rule resolves the peak 1e3 times over
  }
}

template <typename Density>
void expect_derivatives(const Density& density, double frequency, double quality, double scale) {
  const double h = 1e-5;
  const auto at = density(frequency, quality);
  const double by_frequency =
      (density(frequency * std::exp(h), quality).value - density(frequency * std::exp(-h), quality).value) /
      (2.0 * h);
  const double by_quality =
      (density(frequency, quality * std::exp(h)).value - density(frequency, quality * std::exp(-h)).value) /
      (2.0 * h);
  // The difference quotient is off by h^2 (2Q)^3/6 of the value at the steepest place.
  const double tolerance = scale * (1e-7 + h * h * 8.0 * quality * quality * quality);
  EXPECT_NEAR(at.by_log_frequency, by_frequency, tolerance);
  EXPECT_NEAR(at.by_log_quality, by_quality, tolerance);
}

TEST(ThermalOscillator, DerivativesMeetDifferences) {
  for (const double quality : {0.8, 3.0, 40.0})
    for (const double at_hz : {0.0, 3e3, 9.8e3, 1e4, 1.02e4, 4e4}) {
      const auto density = [&](double f0, double q) { return oscillator_density(f0, q, at_hz); };
      expect_derivatives(density, 1e4, quality, density(1e4, quality).value);
    }
}

constexpr std::size_t samples = 256;
constexpr double rate_hz = 1e5;

std::vector<double> hann() {
  std::vector<double> window;
  for (std::size_t i = 0; i < samples; ++i)
    window.push_back(0.5 - 0.5 * std::cos(2.0 * pi * static_cast<double>(i) / samples));
  return window;
}

// sum_mn w_m w_n R(m - n) exp(-i phi (m - n)), as it stands.
double direct_periodogram(double frequency, double quality, std::size_t bin) {
  const auto window = hann();
  const double decay = pi * frequency / quality;
  const double rotation = std::sqrt(4.0 * pi * pi * frequency * frequency - decay * decay);
  double sum = 0.0, power = 0.0;
  for (std::size_t m = 0; m < samples; ++m) {
    power += window[m] * window[m];
    for (std::size_t n = 0; n < samples; ++n) {
      const double lag = (static_cast<double>(m) - static_cast<double>(n)) / rate_hz;
      const double t = std::abs(lag);
      const double covariance =
          std::exp(-decay * t) * (std::cos(rotation * t) + decay / rotation * std::sin(rotation * t));
      sum += window[m] * window[n] * covariance *
             std::cos(2.0 * pi * static_cast<double>(bin) * rate_hz / samples * lag);
    }
  }
  return 2.0 * sum / (rate_hz * power);
}

TEST(HannPeriodogram, IsTheExpectationSummedDirectly) {
  for (const double frequency : {2e3, 1.03e4, 4.5e4})
    for (const double quality : {0.6, 5.0, 300.0})  // ring-down from 1/200 of the record to 20 of it
      for (const std::size_t bin : {std::size_t{2}, std::size_t{5}, std::size_t{26}, std::size_t{100}}) {
        const double direct = direct_periodogram(frequency, quality, bin);
        const double closed = HannPeriodogram(samples, rate_hz, frequency, quality).at_bin(bin).value;
        // Rounding: far from a sharp peak the sum cancels to 1e-6 of its terms.
        EXPECT_NEAR(closed, direct, 1e-9 * direct + 1e-14)
            << frequency << " Hz, Q " << quality << ", bin " << bin;
      }
}

TEST(HannPeriodogram, DerivativesMeetDifferences) {
  for (const double quality : {0.8, 5.0, 60.0})
    for (const std::size_t bin : {std::size_t{2}, std::size_t{24}, std::size_t{26}, std::size_t{60}}) {
      const auto density = [&](double f0, double q) {
        return HannPeriodogram(samples, rate_hz, f0, q).at_bin(bin);
      };
      expect_derivatives(density, 1.03e4, quality, density(1.03e4, quality).value);
    }
}

// Segments of 300 ring-downs: the window smears by S'' (0.7 bin)^2 at most, 1e-4 at the peak.
TEST(HannPeriodogram, OfALongRecordIsTheDensity) {
  const std::size_t n = 1 << 18;
  const double quality = 20.0, frequency = 1e3;
  const HannPeriodogram periodogram(n, 1e5, frequency, quality);
  for (const std::size_t bin : {std::size_t{1000}, std::size_t{2600}, std::size_t{2621}, std::size_t{4000}}) {
    const double density = oscillator_density(frequency, quality, static_cast<double>(bin) * 1e5 / n).value;
    EXPECT_NEAR(periodogram.at_bin(bin).value / density, 1.0, 1e-3) << bin;
  }
}

// |sum_n a_n exp(-2 pi i l n/N)|^2/(sum w^2)^2
double squared_transform(const std::vector<double>& values, std::size_t l) {
  std::complex<double> sum = 0.0;
  double power = 0.0;
  for (const double w : hann()) power += w * w;
  for (std::size_t n = 0; n < values.size(); ++n)
    sum += values[n] * std::polar(1.0, -2.0 * pi * static_cast<double>(l * n) / samples);
  return std::norm(sum) / (power * power);
}

TEST(HannStatistics, AreTheTransformsOfTheWindow) {
  const auto window = hann();
  std::vector<double> same, overlapped;
  for (std::size_t n = 0; n < samples; ++n) same.push_back(window[n] * window[n]);
  for (std::size_t n = 0; n < samples / 2; ++n) overlapped.push_back(window[n] * window[n + samples / 2]);
  constexpr std::uint64_t segments = 9, runs = 2;
  const double pairs = 2.0 * 7.0 / 9.0;  // per segment: 9 segments of two runs overlap 7 times, both ways
  const double variance = 1.0 + pairs * squared_transform(overlapped, 0);
  const SpectrumStatistics statistics = hann_statistics(segments, runs);
  EXPECT_NEAR(statistics.averages, 9.0 / variance, 1e-3);
  for (std::size_t l = 1; l <= 3; ++l)
    // The formula is that of many samples: its error is of order 1/N^2.
    EXPECT_NEAR(statistics.correlation[l - 1],
                (squared_transform(same, l) + pairs * squared_transform(overlapped, l)) / variance, 1e-4)
        << l;
  EXPECT_EQ(hann_statistics(1).averages, 1.0);
  EXPECT_EQ(hann_statistics(1).correlation, hann_correlation);
}

TEST(MeasureScatter, FindsTheShapeOfGammaVariables) {
  for (const double averages : {1.0, 7.5, 200.0}) {
    std::mt19937_64 random(3);
    std::gamma_distribution<double> gamma(averages, 1.0 / averages);
    std::vector<double> ratios;
    for (int i = 0; i < 4000; ++i) ratios.push_back(gamma(random));
    const MeasuredScatter scatter = measure_scatter(ratios);
    EXPECT_NEAR(scatter.averages, averages, 4.0 * scatter.averages_std_error);
    EXPECT_LT(scatter.averages_std_error, 0.03 * averages);  // sqrt(2/4000) = 2.2 % for many averages
    EXPECT_NEAR(scatter.neighbour_correlation, 0.0, 4.0 / std::sqrt(4000.0));
  }
}

}  // namespace
}  // namespace combforce
