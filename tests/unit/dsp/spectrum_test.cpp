#include "dsp/spectrum.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <thread>

#include "tests/support/failing_allocator.hpp"

namespace combforce {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr double pi = std::numbers::pi;

std::vector<double> white_noise(std::size_t count, double sigma, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sigma);
  std::vector<double> samples(count);
  for (double& sample : samples) sample = normal(random);
  return samples;
}

double integral(const WelchSpectrum& spectrum) {
  double sum = 0.0;
  for (const double value : spectrum.density()) sum += value;
  return sum * spectrum.bin_hz();
}

// Welch's estimate from its definition: one slow Fourier sum a bin and a segment.
std::vector<double> naive_density(std::span<const double> samples, std::size_t n, double rate,
                                  bool remove_mean) {
  std::vector<double> density(n / 2 + 1, 0.0);
  std::size_t segments = 0;
  for (std::size_t first = 0; first + n <= samples.size(); first += n / 2, ++segments) {
    double mean = 0.0;
    for (std::size_t i = 0; i < n; ++i) mean += samples[first + i] / static_cast<double>(n);
    for (std::size_t k = 0; k <= n / 2; ++k) {
      std::complex<double> sum = 0.0;
      double window_power = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        const double window = std::pow(std::sin(pi * static_cast<double>(i) / static_cast<double>(n)), 2);
        const double phase = -2.0 * pi * static_cast<double>(k * i % n) / static_cast<double>(n);
        sum += std::polar(window * (samples[first + i] - (remove_mean ? mean : 0.0)), phase);
        window_power += window * window;
      }
      density[k] += std::norm(sum) / (rate * window_power) * (k == 0 || k == n / 2 ? 1.0 : 2.0);
    }
  }
  for (double& value : density) value /= static_cast<double>(segments);
  return density;
}

TEST(WelchSpectrum, IsTheAverageOfItsDefinition) {
  std::vector<double> samples = white_noise(333, 2.0, 1);
  for (double& sample : samples) sample += 5.0;
  for (const std::size_t n : {4U, 6U, 50U, 64U}) {
    for (const bool remove_mean : {true, false}) {
      WelchSpectrum spectrum(n, 1000.0, remove_mean);
      spectrum.push(samples);
      const std::vector<double> expected = naive_density(samples, n, 1000.0, remove_mean);
      const std::vector<double> density = spectrum.density();
      ASSERT_EQ(density.size(), n / 2 + 1);
      EXPECT_EQ(spectrum.segments(), (samples.size() - n) / (n / 2) + 1);
      EXPECT_DOUBLE_EQ(spectrum.bin_hz(), 1000.0 / static_cast<double>(n));
      // Rounding of sums of some 50 terms of order 10, squared, in double.
      for (std::size_t k = 0; k < density.size(); ++k)
        EXPECT_NEAR(density[k], expected[k], 1e-14) << n << " " << k;
    }
  }
}

TEST(WelchSpectrum, IntegralIsTheVarianceOfWhiteNoise) {
  constexpr double sigma = 3.0;
  constexpr std::size_t count = 1 << 18;
  WelchSpectrum spectrum(256, 2.5e6, false);
  spectrum.push(white_noise(count, sigma, 2));
  // The relative scatter of a variance of 2^18 samples is sqrt(2/2^18) = 0.28 %; Hann's overlapped segments
  // use nearly all of it. 5 sigma.
  EXPECT_NEAR(integral(spectrum) / (sigma * sigma), 1.0, 0.014);
}

TEST(WelchSpectrum, WhiteNoiseIsFlatAtTwiceItsVarianceOverTheRate) {
  constexpr double rate = 1e4;
  WelchSpectrum spectrum(64, rate, false);
  spectrum.push(white_noise(1 << 18, 1.0, 3));
  const std::vector<double> density = spectrum.density();
  // 8191 segments, worth about 8191/1.06... = 7400 independent ones at 50 % overlap: 1.2 % a bin, 5 sigma; DC
  // and Nyquist have one degree of freedom instead of two.
  for (std::size_t k = 2; k + 2 < density.size(); ++k) EXPECT_NEAR(density[k] * rate / 2.0, 1.0, 0.06) << k;
  EXPECT_NEAR(density.front() * rate, 1.0, 0.09);
  EXPECT_NEAR(density.back() * rate, 1.0, 0.09);
}

TEST(WelchSpectrum, PowerOfASineIsHalfItsAmplitudeSquared) {
  constexpr std::size_t n = 128;
  constexpr double amplitude = 1.7;
  // On a bin and between bins: Hann's sidelobes hold what leaks, and the sum over all bins is the power
  // within the window. Off the bin the weight of a segment depends on the phase at its ends by about 1e-4.
  for (const double bin : {20.0, 20.37}) {
    WelchSpectrum spectrum(n, 1e6);
    std::vector<double> samples(100 * n);
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i] = amplitude * std::cos(2.0 * pi * bin * static_cast<double>(i) / n + 0.3);
    spectrum.push(samples);
    EXPECT_NEAR(integral(spectrum), amplitude * amplitude / 2.0, 1e-3 * amplitude * amplitude) << bin;
    const std::vector<double> density = spectrum.density();
    const auto peak = static_cast<std::size_t>(std::ranges::max_element(density) - density.begin());
    EXPECT_EQ(peak, 20U);
  }
}

TEST(WelchSpectrum, ResultDoesNotDependOnHowSamplesArrive) {
  const std::vector<double> samples = white_noise(10000, 1.0, 4);
  WelchSpectrum whole(200, 1.0);
  whole.push(samples);
  std::mt19937_64 random(5);
  WelchSpectrum parts(200, 1.0);
  for (std::span<const double> rest = samples; !rest.empty();) {
    const std::size_t count = std::min<std::size_t>(rest.size(), random() % 700);
    parts.push(rest.first(count));
    rest = rest.subspan(count);
  }
  EXPECT_EQ(parts.density(), whole.density());
}

TEST(WelchSpectrum, MeanIsRemovedWhenAsked) {
  const std::vector<double> constant(1000, 4.0);
  WelchSpectrum without(100, 1.0, true);
  without.push(constant);
  for (const double value : without.density()) EXPECT_EQ(value, 0.0);
  WelchSpectrum with(100, 1.0, false);
  with.push(constant);
  EXPECT_GT(with.density()[0], 100.0);
}

TEST(WelchSpectrum, ResetForgetsEverything) {
  const std::vector<double> samples = white_noise(1000, 1.0, 6);
  WelchSpectrum fresh(100, 1.0);
  fresh.push(samples);
  WelchSpectrum reused(100, 1.0);
  reused.push(white_noise(777, 50.0, 7));
  reused.reset();
  EXPECT_EQ(reused.segments(), 0U);
  EXPECT_THAT(reused.density(), testing::Each(0.0));
  reused.push(samples);
  EXPECT_EQ(reused.density(), fresh.density());
}

TEST(WelchSpectrum, RefusesWhatItCannotDo) {
  const auto refusal = [](std::size_t n, double rate) {
    return [n, rate] { const WelchSpectrum spectrum(n, rate); };
  };
  for (const std::size_t n : {0U, 2U, 3U, 5U, 0x80000000U})
    EXPECT_THAT(refusal(n, 1.0), ThrowsMessage<std::invalid_argument>(
                                     AllOf(HasSubstr("segment_samples"), HasSubstr(std::to_string(n)))));
  for (const double rate :
       {0.0, -1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THAT(refusal(4, rate), ThrowsMessage<std::invalid_argument>(HasSubstr("sample_rate_hz")));
}

TEST(WelchSpectrum, PushDoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const std::vector<double> samples = white_noise(5000, 1.0, 8);
  WelchSpectrum spectrum(300, 1.0);
  const test::ForbidAllocation guard;
  spectrum.push(samples);
  spectrum.reset();
  spectrum.push(samples);
  EXPECT_EQ(guard.calls(), 0U);
}

// FFTW's planner has state of the whole process; TSan sees it when it is not guarded.
TEST(WelchSpectrum, MayBeMadeOnSeveralThreads) {
  const std::vector<double> samples = white_noise(500, 1.0, 9);
  std::vector<double> densities[2];
  const auto work = [&samples](std::vector<double>& density) {
    for (int i = 0; i < 50; ++i) {
      WelchSpectrum spectrum(100 + 2 * static_cast<std::size_t>(i), 1.0);
      spectrum.push(samples);
      density = spectrum.density();
    }
  };
  std::thread first(work, std::ref(densities[0]));
  std::thread second(work, std::ref(densities[1]));
  first.join();
  second.join();
  EXPECT_EQ(densities[0], densities[1]);
}

}  // namespace
}  // namespace combforce
