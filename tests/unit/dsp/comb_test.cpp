#include "dsp/comb.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

namespace combforce {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

Comb comb_of(std::uint64_t window_samples, std::initializer_list<std::uint64_t> bins) {
  Comb comb{window_samples, {}};
  for (const std::uint64_t bin : bins) comb.tones.push_back({bin, true});
  return comb;
}

TEST(Comb, TakesTheExtremesOfWhatIsAllowed) {
  EXPECT_NO_THROW(validate(comb_of(3, {1})));
  EXPECT_NO_THROW(validate(comb_of(4, {1})));
  EXPECT_NO_THROW(validate(comb_of(5, {2, 1})));
  EXPECT_NO_THROW(validate(comb_of((std::uint64_t{1} << 32) - 1, {1, (std::uint64_t{1} << 31) - 1})));
}

TEST(Comb, NamesFieldValueAndBoundOfWhatIsNot) {
  const auto refusal = [](const Comb& comb) { return [comb] { validate(comb); }; };
  EXPECT_THAT(refusal(comb_of(2, {1})),
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("comb.window_samples"), HasSubstr("2 is less than 3"))));
  EXPECT_THAT(refusal(comb_of(std::uint64_t{1} << 32, {1})),
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("comb.window_samples"), HasSubstr("4294967296"), HasSubstr("2^32"))));
  EXPECT_THAT(refusal(comb_of(100, {})), ThrowsMessage<std::invalid_argument>(HasSubstr("comb.tones")));
  EXPECT_THAT(refusal(comb_of(100, {1, 0})),
              ThrowsMessage<std::invalid_argument>(HasSubstr("comb.tones[1].bin: 0")));
  for (const Comb& nyquist : {comb_of(100, {50}), comb_of(99, {50}), comb_of(4, {2}), comb_of(3, {2})})
    EXPECT_THAT(refusal(nyquist), ThrowsMessage<std::invalid_argument>(
                                      AllOf(HasSubstr("comb.tones[0].bin"), HasSubstr("Nyquist"))));
  EXPECT_THAT(refusal(comb_of(100, {7, 8, 7})), ThrowsMessage<std::invalid_argument>(AllOf(
                                                    HasSubstr("comb.tones[2].bin: 7"), HasSubstr("twice"))));
}

TEST(Comb, PhaseIndexIsExactForAnyLengthOfStream) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100000; ++i) {
    const std::uint64_t n = 3 + random() % ((std::uint64_t{1} << 32) - 3);
    const std::uint64_t bin = random() % n;
    const std::uint64_t sample = random() >> (random() % 64);
    const auto exact = static_cast<std::uint64_t>(static_cast<unsigned __int128>(bin) * sample % n);
    ASSERT_EQ(phase_index(bin, sample, n), exact) << bin << " " << sample << " " << n;
  }
}

}  // namespace
}  // namespace combforce
