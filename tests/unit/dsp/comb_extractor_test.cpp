#include "dsp/comb_extractor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "dsp/comb_kernels.hpp"
#include "tests/support/failing_allocator.hpp"

namespace combforce {
namespace {

using Phasors = std::vector<std::complex<double>>;
using LongComplex = std::complex<long double>;

constexpr double infinity = std::numeric_limits<double>::infinity();

// The promise of comb_extractor.hpp, relative to full scale.
constexpr double promised = 1e-6;

Comb comb_of(std::uint64_t window_samples, const std::vector<std::uint64_t>& bins) {
  Comb comb{window_samples, {}};
  for (const std::uint64_t bin : bins) comb.tones.push_back({bin, true});
  return comb;
}

// Bins at both ends and between, as many as the window has.
Comb spread_comb(std::uint64_t n) {
  std::vector<std::uint64_t> bins;
  const std::uint64_t last = (n - 1) / 2;
  for (const std::uint64_t bin :
       {std::uint64_t{1}, std::uint64_t{2}, std::uint64_t{3}, n / 7, n / 4, n / 3, last - 1, last})
    if (bin >= 1 && bin <= last && std::ranges::find(bins, bin) == bins.end()) bins.push_back(bin);
  return comb_of(n, bins);
}

// The definition, in extended precision, with a phase of its own: (bin * sample) mod N in 128 bits.
class Oracle {
 public:
  explicit Oracle(std::uint64_t n) : n_(n), turns_(n) {
    for (std::uint64_t k = 0; k < n; ++k) {
      const long double angle =
          2.0L * std::numbers::pi_v<long double> * static_cast<long double>(k) / static_cast<long double>(n);
      turns_[k] = {std::cos(angle), -std::sin(angle)};
    }
  }

  template <typename Sample>
  std::complex<double> phasor(const std::vector<Sample>& samples, std::uint64_t bin,
                              std::uint64_t start) const {
    auto index = static_cast<std::uint64_t>(static_cast<unsigned __int128>(bin) * start % n_);
    LongComplex sum = 0.0L;
    for (const Sample sample : samples) {
      sum += static_cast<long double>(sample) * turns_[index];
      index = (index + bin) % n_;
    }
    return std::complex<double>(sum * 2.0L / static_cast<long double>(samples.size()));
  }

 private:
  std::uint64_t n_;
  std::vector<LongComplex> turns_;
};

struct Outcome {
  Phasors phasors;
  std::vector<double> means;
  std::uint64_t clipped;
  bool operator==(const Outcome&) const = default;
};

template <typename Sample>
constexpr SampleFormat format_of = std::is_same_v<Sample, float> ? SampleFormat::f32 : SampleFormat::i16;

// Feeds the frames in blocks as long as `block_of` says.
template <typename Sample>
Outcome extract(CombExtractor& extractor, const std::vector<Sample>& samples, std::uint16_t channels,
                std::uint64_t start, std::uint32_t windows, const std::function<std::size_t()>& block_of) {
  extractor.begin(start, windows);
  const std::size_t frames = samples.size() / channels;
  for (std::size_t done = 0; done < frames;)
    done += extractor.add(samples.data() + done * channels, std::min(block_of(), frames - done));
  Outcome outcome{Phasors(extractor.comb().tones.size()), std::vector<double>(channels), extractor.clipped()};
  extractor.finish(outcome.phasors, outcome.means);
  return outcome;
}

template <typename Sample>
Outcome extract(const Comb& comb, const std::vector<Sample>& samples, std::uint64_t start,
                std::uint32_t windows) {
  CombExtractor extractor(comb, 1, format_of<Sample>, -infinity, infinity);
  return extract(extractor, samples, 1, start, windows, [&samples] { return samples.size(); });
}

// Signals that strain single precision: a constant at full scale (its products do not cancel at low bins and
// their roundings share a sign), the same with noise, noise over all codes, and full-scale codes that follow
// the sign of a tone's own cosine or sine, whose sums grow fastest.
enum class Signal { constant, constant_with_noise, noise, in_phase, quadrature };
constexpr Signal signals[] = {Signal::constant, Signal::constant_with_noise, Signal::noise, Signal::in_phase,
                              Signal::quadrature};

std::vector<std::int16_t> codes_of(Signal signal, std::size_t count, std::uint64_t bin, std::uint64_t n) {
  std::mt19937_64 random(count);
  std::vector<std::int16_t> codes(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double phase = phase_radians(phase_index(bin, i, n), n);
    const auto draw = static_cast<int>(random() % 65536);
    int code = 0;
    switch (signal) {
      case Signal::constant:
        code = -32768;
        break;
      case Signal::constant_with_noise:
        code = 32767 - draw % 256;
        break;
      case Signal::noise:
        code = draw - 32768;
        break;
      case Signal::in_phase:
        code = std::cos(phase) < 0.0 ? -32768 : 32767;
        break;
      case Signal::quadrature:
        code = std::sin(phase) < 0.0 ? -32768 : 32767;
        break;
    }
    codes[i] = static_cast<std::int16_t>(code);
  }
  return codes;
}

// Largest distance from the oracle over signals and tones, in units of full scale.
double worst_error(std::uint64_t n, std::uint32_t windows, std::uint64_t start) {
  const Comb comb = spread_comb(n);
  const Oracle oracle(n);
  double worst = 0.0;
  for (const Signal signal : signals) {
    const std::vector<std::int16_t> codes = codes_of(signal, n * windows, comb.tones[0].bin, n);
    const Outcome outcome = extract(comb, codes, start, windows);
    for (std::size_t t = 0; t < comb.tones.size(); ++t)
      worst = std::max(
          worst, std::abs(outcome.phasors[t] - oracle.phasor(codes, comb.tones[t].bin, start)) / 32768.0);
  }
  return worst;
}

// One run of these a SIMD target that this CPU has, down to the scalar fallback.
class OnEveryTarget : public testing::TestWithParam<std::int64_t> {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }
};

INSTANTIATE_TEST_SUITE_P(CombExtractor, OnEveryTarget, testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& target) { return std::string(hwy::TargetName(target.param)); });

TEST(CombExtractor, TestsReachTheTargetTheyName) {
  std::vector<std::size_t> lanes;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    lanes.push_back(comb_kernels().lanes);
    hwy::SetSupportedTargetsForTest(0);
  }
  EXPECT_TRUE(std::ranges::is_sorted(lanes, std::ranges::greater())) << "best first";
  EXPECT_EQ(comb_kernels().lanes, lanes.front()) << "the best one runs when none is named";
  EXPECT_TRUE(lanes.size() == 1 || lanes.back() < lanes.front());
}

TEST_P(OnEveryTarget, EveryBinOfEveryShortWindowIsWithinThePromise) {
  for (std::uint64_t n = 3; n <= 50; ++n) {
    std::vector<std::uint64_t> bins((n - 1) / 2);
    std::iota(bins.begin(), bins.end(), 1U);
    const Comb comb = comb_of(n, bins);
    const Oracle oracle(n);
    const std::uint64_t start = (std::uint64_t{1} << 50) + 7 * n + 1;
    for (const std::uint32_t windows : {1U, 3U}) {
      const std::vector<std::int16_t> codes = codes_of(Signal::noise, n * windows, 1, n);
      const Outcome outcome = extract(comb, codes, start, windows);
      for (std::size_t t = 0; t < bins.size(); ++t)
        ASSERT_LT(std::abs(outcome.phasors[t] - oracle.phasor(codes, bins[t], start)), promised * 32768.0)
            << "N " << n << " bin " << bins[t];
    }
  }
}

TEST_P(OnEveryTarget, LongerWindowsAreWithinThePromise) {
  // Around multiples of the chunks of all targets (32 to 1024 samples), primes, odd and even.
  for (const std::uint64_t n : {63U, 64U, 65U, 588U, 1023U, 1024U, 1025U, 2047U, 2048U, 2049U, 4099U, 12000U})
    EXPECT_LT(worst_error(n, 1, 12345), promised) << n;
  EXPECT_LT(worst_error(588, 7, (std::uint64_t{1} << 50) - 1), promised);
  EXPECT_LT(worst_error(1024, 40, 3), promised) << "chunks in step with the window: their errors add up";
}

TEST(CombExtractor, PaperSizedWindowsAreWithinThePromise) {
  EXPECT_LT(worst_error(400000, 1, 0), promised);
  EXPECT_LT(worst_error(400001, 1, (std::uint64_t{1} << 50) + 12345), promised);
}

TEST(CombExtractor, PhaseRefersToStreamSampleZero) {
  // A month at 100 MS/s into the stream.
  constexpr std::uint64_t start = 259'200'000'000'000 + 17;
  constexpr std::uint64_t n = 10000;
  const Comb comb = comb_of(n, {234, 1348});
  std::vector<std::int16_t> codes(n);
  for (std::uint64_t i = 0; i < n; ++i)
    codes[i] = static_cast<std::int16_t>(
        std::lround(10000.0 * std::cos(phase_radians(phase_index(234, start + i, n), n) + 0.5) +
                    5000.0 * std::cos(phase_radians(phase_index(1348, start + i, n), n) - 2.0)));
  const Outcome outcome = extract(comb, codes, start, 1);
  // Rounding to codes scatters a phasor by sqrt(2/12 * 2/n) = 0.006 codes.
  EXPECT_LT(std::abs(outcome.phasors[0] - std::polar(10000.0, 0.5)), 0.03);
  EXPECT_LT(std::abs(outcome.phasors[1] - std::polar(5000.0, -2.0)), 0.03);
}

TEST_P(OnEveryTarget, FloatSamplesAreWithinThePromise) {
  for (const std::uint64_t n : {7U, 1000U, 5003U}) {
    const Comb comb = spread_comb(n);
    const Oracle oracle(n);
    std::mt19937_64 random(n);
    std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
    for (const float offset : {0.0F, 0.7F}) {
      std::vector<float> samples(n * 2);
      for (float& sample : samples)
        sample = std::clamp(uniform(random) * (1.0F - offset) + offset, -1.0F, 1.0F);
      const Outcome outcome = extract(comb, samples, 99, 2);
      for (std::size_t t = 0; t < comb.tones.size(); ++t)
        EXPECT_LT(std::abs(outcome.phasors[t] - oracle.phasor(samples, comb.tones[t].bin, 99)), promised)
            << "N " << n << " bin " << comb.tones[t].bin;
      const double mean =
          std::accumulate(samples.begin(), samples.end(), 0.0) / static_cast<double>(samples.size());
      EXPECT_NEAR(outcome.means[0], mean, 1e-7);
    }
  }
}

TEST(CombExtractor, LongPrimeWindowIsWithinThePromise) {
  const std::uint64_t n = 1048573;
  EXPECT_LT(worst_error(n, 1, (std::uint64_t{1} << 50) - 9), promised);
}

template <typename Sample>
void expect_same_bits_however_cut(std::uint16_t channels) {
  constexpr std::uint64_t n = 7001;
  constexpr std::uint32_t windows = 3;
  std::mt19937_64 random(channels);
  std::vector<Sample> samples(n * windows * channels);
  for (Sample& sample : samples) sample = static_cast<Sample>(static_cast<int>(random() % 65536) - 32768);
  CombExtractor extractor(spread_comb(n), channels, format_of<Sample>, -32700.0, 32700.0);
  const Outcome whole = extract(extractor, samples, channels, 5, windows, [&] { return samples.size(); });
  EXPECT_GT(whole.clipped, 0U);
  for (const std::size_t longest : {3U, 700U, 5000U}) {
    const auto block = [&] { return static_cast<std::size_t>(random() % longest); };
    const Outcome cut = extract(extractor, samples, channels, 5, windows, block);
    EXPECT_EQ(cut, whole) << "blocks below " << longest << ", " << channels << " channels";
  }
}

TEST_P(OnEveryTarget, SameBitsHoweverTheSamplesAreCut) {
  for (const std::uint16_t channels : {std::uint16_t{1}, std::uint16_t{2}, std::uint16_t{5}}) {
    expect_same_bits_however_cut<std::int16_t>(channels);
    expect_same_bits_however_cut<float>(channels);
  }
}

TEST(CombExtractor, OtherChannelsOnlyAddTheirMeans) {
  constexpr std::uint64_t n = 3001;
  std::mt19937_64 random(1);
  std::vector<std::int16_t> deflection(n);
  std::vector<std::int16_t> interleaved;
  std::int64_t sums[3] = {};
  for (std::int16_t& code : deflection) {
    code = static_cast<std::int16_t>(random());
    for (const std::int16_t value :
         {code, static_cast<std::int16_t>(random()), static_cast<std::int16_t>(-7)}) {
      sums[interleaved.size() % 3] += value;
      interleaved.push_back(value);
    }
  }
  CombExtractor extractor(spread_comb(n), 3, SampleFormat::i16, -infinity, infinity);
  const Outcome outcome = extract(extractor, interleaved, 3, 0, 1, [] { return 100; });
  EXPECT_EQ(outcome.phasors, extract(spread_comb(n), deflection, 0, 1).phasors);
  // Sums of codes are exact in double.
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_EQ(outcome.means[c], static_cast<double>(sums[c]) / static_cast<double>(n));
}

TEST_P(OnEveryTarget, CountsClippedSamplesOfTheFirstChannel) {
  constexpr std::uint64_t n = 5000;
  struct Limits {
    double lo, hi;
  };
  std::mt19937_64 random(1);
  std::vector<std::int16_t> codes(2 * n);
  for (std::int16_t& code : codes) code = static_cast<std::int16_t>(random());
  for (const Limits limits :
       {Limits{-32768, 32767}, Limits{-32000, 32767}, Limits{-32768, 31000.5}, Limits{0, 1}, Limits{10, 20},
        Limits{-40000, 40000}, Limits{-infinity, infinity}, Limits{-1e9, -32768}}) {
    CombExtractor extractor(comb_of(n, {1}), 2, SampleFormat::i16, limits.lo, limits.hi);
    std::uint64_t expected = 0;
    extractor.begin(0, 1);
    for (std::size_t i = 0; i < n; ++i) {
      expected += static_cast<std::uint64_t>(codes[2 * i] <= limits.lo || codes[2 * i] >= limits.hi);
      extractor.add(codes.data() + 2 * i, 1);
      if (i % 97 != 0 && i + 1 != n) continue;
      ASSERT_EQ(extractor.clipped(), expected) << limits.lo << " " << limits.hi << " " << i;
    }
    extractor.begin(0, 1);
    EXPECT_EQ(extractor.clipped(), 0U);
  }
}

TEST_P(OnEveryTarget, CountsClippedFloatsAmongNaNs) {
  constexpr std::size_t n = 5000;
  std::vector<float> samples(n, 0.25F);
  for (std::size_t i = 0; i < n; i += 50) samples[i] = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 1; i < n; i += 100) samples[i] = i % 200 == 1 ? 1.0F : -1.5F;
  CombExtractor extractor(comb_of(n, {1}), 1, SampleFormat::f32, -1.0, 1.0);
  const Outcome outcome = extract(extractor, samples, 1, 0, 1, [] { return n; });
  EXPECT_EQ(outcome.clipped, n / 100);
}

TEST_P(OnEveryTarget, SamplesThatAreNotFiniteMakeThePhasorsNaN) {
  constexpr std::size_t n = 3000;
  const Comb comb = comb_of(n, {1, 7, 1499});
  std::vector<float> good(n, 0.5F);
  const Outcome before = extract(comb, good, 0, 1);
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const std::size_t place : {std::size_t{0}, std::size_t{1234}, n - 1}) {
      std::vector<float> samples = good;
      samples[place] = bad;
      CombExtractor extractor(comb, 1, SampleFormat::f32, -infinity, infinity);
      const Outcome outcome = extract(extractor, samples, 1, 0, 1, [] { return n; });
      for (const std::complex<double>& phasor : outcome.phasors) {
        EXPECT_FALSE(std::isfinite(phasor.real())) << bad << " at " << place;
        EXPECT_FALSE(std::isfinite(phasor.imag())) << bad << " at " << place;
      }
      const Outcome after = extract(extractor, good, 1, 0, 1, [] { return n; });
      EXPECT_EQ(after.phasors, before.phasors) << "the next span is clean again";
    }
  }
}

TEST(CombExtractor, TakesOnlyWhatTheSpanNeeds) {
  const std::vector<std::int16_t> codes(500, 100);
  CombExtractor extractor(comb_of(100, {3}), 1, SampleFormat::i16, -32768, 32767);
  extractor.begin(1000, 3);
  EXPECT_EQ(extractor.missing(), 300U);
  EXPECT_EQ(extractor.add(codes.data(), 120), 120U);
  EXPECT_EQ(extractor.missing(), 180U);
  EXPECT_EQ(extractor.add(codes.data(), 500), 180U);
  EXPECT_EQ(extractor.missing(), 0U);
  EXPECT_EQ(extractor.add(codes.data(), 500), 0U);
  Phasors phasors(1);
  double mean = 0.0;
  extractor.finish(phasors, {&mean, 1});
  EXPECT_EQ(mean, 100.0);
  extractor.begin(1300, 1);
  EXPECT_EQ(extractor.add(codes.data(), 60), 60U);
  extractor.begin(7, 2);
  EXPECT_EQ(extractor.missing(), 200U) << "an unfinished span is discarded";
}

TEST(CombExtractor, RefusesMisuse) {
  EXPECT_THROW(CombExtractor(comb_of(100, {50}), 1, SampleFormat::i16, 0, 1), std::invalid_argument);
  EXPECT_THROW(CombExtractor(comb_of(100, {5}), 0, SampleFormat::i16, 0, 1), std::invalid_argument);
  CombExtractor extractor(comb_of(100, {5, 6}), 1, SampleFormat::i16, -32768, 32767);
  const std::vector<float> floats(100);
  const std::vector<std::int16_t> codes(100);
  extractor.begin(0, 1);
  EXPECT_THROW(extractor.add(floats.data(), 100), std::logic_error);
  Phasors phasors(2);
  std::vector<double> means(1);
  EXPECT_THROW(extractor.finish(phasors, means), std::logic_error) << "samples are missing";
  extractor.add(codes.data(), 100);
  EXPECT_NO_THROW(extractor.finish(phasors, means));
  Phasors short_of_one(1);
  EXPECT_THROW(extractor.finish(short_of_one, means), std::logic_error);
  std::vector<double> one_too_many(2);
  EXPECT_THROW(extractor.finish(phasors, one_too_many), std::logic_error);
}

TEST(CombExtractor, MovesWithItsSpan) {
  const std::vector<std::int16_t> codes = codes_of(Signal::noise, 5000, 1, 5000);
  CombExtractor first(comb_of(5000, {3}), 1, SampleFormat::i16, -32768, 32767);
  first.begin(0, 1);
  first.add(codes.data(), 1700);
  CombExtractor second = std::move(first);
  second.add(codes.data() + 1700, 3300);
  Phasors phasors(1);
  double mean = 0.0;
  second.finish(phasors, {&mean, 1});
  EXPECT_EQ(phasors, extract(comb_of(5000, {3}), codes, 0, 1).phasors);
}

TEST(CombExtractor, DoesNotAllocateAfterConstruction) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  constexpr std::size_t n = 10000;
  const std::vector<std::int16_t> codes(3 * n, 32767);
  const std::vector<float> floats(3 * n, 1.0F);
  CombExtractor of_codes(spread_comb(n), 3, SampleFormat::i16, -32768, 32767);
  CombExtractor of_floats(spread_comb(n), 1, SampleFormat::f32, -1.0, 1.0);
  Phasors phasors(of_codes.comb().tones.size());
  std::vector<double> means(3);
  const test::ForbidAllocation guard;
  for (int repeat = 0; repeat < 3; ++repeat) {
    of_codes.begin(5, 1);
    of_floats.begin(5, 3);
    for (std::size_t i = 0; i < n; i += 1000) of_codes.add(codes.data() + 3 * i, 1000);
    of_floats.add(floats.data(), 3 * n);
    of_codes.finish(phasors, means);
    of_floats.finish(phasors, {means.data(), 1});
  }
  EXPECT_EQ(guard.calls(), 0U);
}

}  // namespace
}  // namespace combforce
