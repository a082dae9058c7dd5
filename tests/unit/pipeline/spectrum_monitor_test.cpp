#include "daemon/pipeline/spectrum_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <thread>

#include "tests/support/failing_allocator.hpp"
#include "tests/support/synthetic_stream.hpp"

namespace combforce {
namespace {

constexpr std::size_t segment = 256;
constexpr double rate_hz = 1e6;
constexpr double sigma_codes = 1000.0;
constexpr double volts_per_code = 1e-3;

SampleBlock block_of(std::uint64_t first_sample, std::uint32_t frames, std::uint32_t epoch = 0) {
  SampleBlock block(frames * sizeof(std::int16_t));
  block.header.first_sample = first_sample;
  block.header.frames = frames;
  block.header.epoch = epoch;
  auto* codes = reinterpret_cast<std::int16_t*>(block.storage.data());
  std::mt19937_64 random(first_sample);
  std::normal_distribution<double> normal(0.0, sigma_codes);
  for (std::uint32_t i = 0; i < frames; ++i)
    codes[i] = static_cast<std::int16_t>(std::lround(normal(random)));
  return block;
}

// The first spectrum of white noise under this description.
Spectrum spectrum_of(Description description) {
  StreamInfo info = test::one_channel(rate_hz, 512);
  info.channels[0].scale = volts_per_code;
  description.comb = Comb{200, {{7, true}, {31, true}}};
  description.fit.emplace().model = "hertz";
  if (!description.channels) description.channels = info.channels;
  auto analysis = make_analysis(info, description);
  std::atomic<bool> there{false};
  Spectrum result;
  SpectrumMonitor monitor(
      info, segment, [&] { return analysis; },
      [&](const Spectrum& spectrum) {
        if (there.load()) return;
        result = spectrum;
        there.store(true);
      });
  monitor.set_rate(10.0);
  for (std::uint64_t first = 1000; !there.load(); first += 500) monitor.tap().add(block_of(first, 500));
  return result;
}

Description with_cantilever(double second_sensitivity) {
  Description description;
  description.cantilever =
      Cantilever{{{35000.0, 20.0, 4.0, 5.0}, {210000.0, 60.0, 80.0, second_sensitivity}}};
  return description;
}

// The integral of a density is the variance, here of 8320 samples, which leave sqrt(2/8320) of it uncertain:
// 1.6 %, and the bound is five times that.
void expect_variance(const Spectrum& spectrum, double expected) {
  ASSERT_EQ(spectrum.density.size(), segment / 2 + 1);
  const double sum = std::accumulate(spectrum.density.begin(), spectrum.density.end(), 0.0);
  EXPECT_NEAR(sum * spectrum.bin_hz / expected, 1.0, 0.08);
}

TEST(SpectrumMonitor, GivesTheDensityOfTheDeflectionInItsUnit) {
  const double volts = std::pow(sigma_codes * volts_per_code, 2);
  const Spectrum plain = spectrum_of({});
  EXPECT_EQ(plain.unit, "V^2/Hz");
  EXPECT_EQ(plain.bin_hz, rate_hz / segment);
  EXPECT_EQ(plain.segments, 64U);
  EXPECT_EQ(plain.samples, segment + 63 * segment / 2);
  EXPECT_EQ(plain.first_sample % 500, 0U);
  expect_variance(plain, volts);

  Description calibrated;
  calibrated.channels = Channels(1);
  calibrated.channels->front().scale = volts_per_code;
  calibrated.channels->front().nm_per_v = 20.0;
  const Spectrum nm = spectrum_of(calibrated);
  EXPECT_EQ(nm.unit, "nm^2/Hz");
  expect_variance(nm, volts * 400.0);

  const Spectrum shared = spectrum_of(with_cantilever(5.0));
  EXPECT_EQ(shared.unit, "nm^2/Hz");
  expect_variance(shared, volts * 25.0);

  const Spectrum each_its_own = spectrum_of(with_cantilever(6.0));
  EXPECT_EQ(each_its_own.unit, "V^2/Hz");
  expect_variance(each_its_own, volts);
}

TEST(SpectrumTap, TakesAnUnbrokenStretch) {
  SpectrumTap tap(1000);
  tap.add(block_of(0, 100));  // not asked for
  tap.arm(700);
  tap.add(block_of(100, 300));
  tap.add(block_of(500, 300));     // 400..499 lost
  tap.add(block_of(800, 300, 1));  // another epoch
  tap.add(block_of(1100, 300, 1));
  tap.add(block_of(1400, 300, 1));
  ASSERT_TRUE(tap.wait_full());
  tap.add(block_of(1700, 300, 1));  // full
  EXPECT_EQ(tap.first_sample(), 800U);
  ASSERT_EQ(tap.codes().size(), 700U);
  for (std::size_t i = 0; i < 700; ++i) {
    const SampleBlock block = block_of(800 + i / 300 * 300, 300, 1);
    ASSERT_EQ(tap.codes()[i], static_cast<float>(block.i16()[i % 300])) << i;
  }
}

TEST(SpectrumTap, AddDoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  SpectrumTap tap(1000);
  tap.arm(700);
  const SampleBlock block = block_of(0, 800);
  const test::ForbidAllocation guard;
  tap.add(block);
  EXPECT_EQ(guard.calls(), 0U);
}

TEST(SpectrumMonitor, EndsWhileItWaitsForSamples) {
  const StreamInfo info = test::one_channel(rate_hz, 512);
  Description description;
  description.comb = Comb{200, {{7, true}}};
  auto analysis = make_analysis(info, description);
  SpectrumMonitor monitor(
      info, segment, [&] { return analysis; }, [](const Spectrum&) {});
  monitor.set_rate(10.0);
  monitor.tap().add(block_of(0, 100));
}

}  // namespace
}  // namespace combforce
