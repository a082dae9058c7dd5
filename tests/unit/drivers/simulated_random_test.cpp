#include "drivers/simulated/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace combforce {
namespace {

// Computed by an implementation in Python. Must not change: recordings are reproduced by their seed.
TEST(SimulatedRandom, SequencesArePinned) {
  Random random(1);
  EXPECT_EQ(random.bits(), 0x4887886c7244e091U);
  EXPECT_EQ(random.bits(), 0x4cfafb3b6cc3ea99U);
  Random other(1, 1);
  EXPECT_NE(Random(1).bits(), other.bits());
  EXPECT_NE(Random(1).bits(), Random(2).bits());
}

// Chi-squared over 200 intervals of equal probability, by the error function: mean 199, standard deviation
// 20; 5 of them are a chance of 1e-6, and the seed is fixed.
TEST(SimulatedRandom, NormalHasTheBellsDistribution) {
  constexpr int intervals = 200, draws = 4000000;
  std::vector<int> counts(intervals, 0);
  Random random(7);
  for (int i = 0; i < draws; ++i) {
    const double probability = 0.5 * std::erfc(-random.normal() / std::numbers::sqrt2);
    ++counts[std::min(intervals - 1, static_cast<int>(probability * intervals))];
  }
  double chi2 = 0.0;
  constexpr double expected = static_cast<double>(draws) / intervals;
  for (const int count : counts) chi2 += (count - expected) * (count - expected) / expected;
  EXPECT_NEAR(chi2, 199.0, 100.0);
}

// The ziggurat's tail begins at 3.65: 2.58e-4 of the draws lie beyond, distributed as the bell's tail.
TEST(SimulatedRandom, TailIsExact) {
  constexpr int draws = 4000000;
  Random random(8);
  int beyond_3_8 = 0, beyond_4_5 = 0, negative = 0;
  for (int i = 0; i < draws; ++i) {
    const double x = random.normal();
    beyond_3_8 += std::abs(x) > 3.8;
    beyond_4_5 += std::abs(x) > 4.5;
    negative += x < 0.0;
  }
  const double p38 = std::erfc(3.8 / std::numbers::sqrt2) * draws,
               p45 = std::erfc(4.5 / std::numbers::sqrt2) * draws;
  // Poisson counts: five standard deviations.
  EXPECT_NEAR(beyond_3_8, p38, 5.0 * std::sqrt(p38));
  EXPECT_NEAR(beyond_4_5, p45, 5.0 * std::sqrt(p45));
  EXPECT_NEAR(negative, 0.5 * draws, 2.5 * std::sqrt(draws));
}

}  // namespace
}  // namespace combforce
