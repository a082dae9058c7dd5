#include "daemon/cli/tone_advice.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/integration/simulated_pixel.hpp"

namespace combforce {
namespace {

using test::SimulatedPixels;

TypicalPixel four_tones(std::vector<double> truth) {
  const SimulatedPixels pixels = SimulatedPixels::paper(test::four_tones);
  TypicalPixel pixel;
  pixel.conditions = pixels.conditions("dmt", 30);
  pixel.conditions.free_response.reset();
  pixel.drive_forces_nn = pixels.drive_forces_nn();
  pixel.parameters = std::move(truth);
  return pixel;
}

const std::vector<double> parameters{-40.0, 1.0, 5.0, 0.5};

// What a fit says when these tones are measured too.
std::vector<double> errors_with(const std::vector<std::uint64_t>& added) {
  SimulatedPixels pixels = SimulatedPixels::paper(test::four_tones);
  pixels.bins.insert(pixels.bins.end(), added.begin(), added.end());
  PixelFitter fitter(pixels.conditions("dmt", 30));
  FitResult result;
  fitter.fit(pixels.tones("dmt", parameters).value(), result);
  return {result.std_errors.begin(), result.std_errors.begin() + 4};
}

double sum_of_squares(std::span<const double> errors, std::span<const double> of_comb) {
  double sum = 0.0;
  for (std::size_t k = 0; k < errors.size(); ++k) sum += errors[k] * errors[k] / (of_comb[k] * of_comb[k]);
  return sum;
}

// The errors are those that a fit of the wider comb will report, and of these other tones, near and far, none
// is better than the advised one by more than the choice's first order may miss.
TEST(ToneAdvice, IsTheToneWithWhichAFitSaysTheLeastErrors) {
  const ToneAdvice advice = advise_tones(four_tones(parameters), 1);
  ASSERT_EQ(advice.steps.size(), 1U);
  const ToneAdvice::Step& best = advice.steps[0];
  const std::vector<double> fitted = errors_with({best.bin});
  for (std::size_t k = 0; k < parameters.size(); ++k)
    EXPECT_NEAR(best.std_errors[k] / fitted[k], 1.0, 1e-3) << "parameter " << k;
  const double least = sum_of_squares(best.std_errors, advice.std_errors);
  for (const std::uint64_t other : {118, 232, 350, 1350, 1582})
    EXPECT_GT(1.1 * sum_of_squares(errors_with({other}), advice.std_errors), least) << other;
}

// What products of intermodulation can do for the paper's four tones: .23 .15 .24 .45 of the errors are left.
TEST(ToneAdvice, SixTonesHalveEveryError) {
  const ToneAdvice advice = advise_tones(four_tones(parameters), 6);
  ASSERT_EQ(advice.steps.size(), 6U);
  for (std::size_t k = 0; k < parameters.size(); ++k)
    EXPECT_LT(advice.steps.back().std_errors[k], 0.5 * advice.std_errors[k]) << "parameter " << k;
  for (std::size_t i = 1; i < 6; ++i)
    EXPECT_LT(sum_of_squares(advice.steps[i].std_errors, advice.std_errors),
              sum_of_squares(advice.steps[i - 1].std_errors, advice.std_errors))
        << i;
}

void expect_refused(const TypicalPixel& pixel, const std::string& why) {
  try {
    advise_tones(pixel, 1);
    FAIL() << "not refused: " << why;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(why));
  }
}

TEST(ToneAdvice, RefusesWhatTellsNothing) {
  expect_refused(four_tones({-80.0, 1.0, 5.0, 0.5}), "parameters: the tip does not touch");
  TypicalPixel silent = four_tones({-40.0, 1.0, 5.0, 0.5});
  silent.conditions.noise = Noise{0.0, {0.0}};
  expect_refused(silent, "noise: temperature_k and detector noise are 0");
  TypicalPixel still = four_tones({-40.0, 1.0, 5.0, 0.5});
  still.drive_forces_nn.assign(4, 0.0);
  expect_refused(still, "drive: no tone");
  TypicalPixel ringing = four_tones({-40.0, 1.0, 5.0, 0.5});
  ringing.conditions.cantilever.modes[0].quality_factor = 1e9;
  expect_refused(ringing, "cantilever: rings for");
  TypicalPixel slow = four_tones({-40.0, 1.0, 5.0, 0.5});
  slow.conditions.sample_rate_hz = 1.0;
  expect_refused(slow, "sample rate: 1 Hz, must be at least");
}

}  // namespace
}  // namespace combforce
