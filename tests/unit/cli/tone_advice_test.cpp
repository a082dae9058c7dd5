#include "daemon/cli/tone_advice.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/integration/simulated_pixel.hpp"

namespace combforce {
namespace {

using testing::SimulatedPixels;

TypicalPixel two_tones(std::vector<double> parameters) {
  const SimulatedPixels pixels = SimulatedPixels::paper({234, 1348});
  TypicalPixel pixel;
  pixel.conditions = pixels.conditions("hertz", 30);
  pixel.conditions.free_response.reset();
  pixel.drive_forces_nn = pixels.drive_forces_nn();
  pixel.parameters = std::move(parameters);
  return pixel;
}

// What a fit says when this tone is measured too.
FitResult fit_with(std::uint64_t bin, const std::vector<double>& parameters) {
  SimulatedPixels pixels = SimulatedPixels::paper({234, 1348});
  pixels.bins.push_back(bin);
  PixelFitter fitter(pixels.conditions("hertz", 30));
  FitResult result;
  fitter.fit(pixels.tones("hertz", parameters).value(), result);
  return result;
}

// Candidates are the neighbours of 234 and 1348 and of twice and three times these: the advised tone is no
// worse than the four nearest of them, and the errors are those that a fit of the wider comb will report.
TEST(ToneAdvice, IsTheToneWithWhichAFitSaysTheLeastErrors) {
  const std::vector<double> parameters{-40.0, 1.0};
  const ToneAdvice advice = advise_tones(two_tones(parameters), 1, 1);
  ASSERT_EQ(advice.steps.size(), 1U);
  const ToneAdvice::Step& best = advice.steps[0];
  const FitResult fit = fit_with(best.bin, parameters);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(best.std_errors[k] / fit.std_errors[k], 1.0, 1e-3) << "parameter " << k;
    EXPECT_LT(best.std_errors[k], advice.std_errors[k]) << "parameter " << k;
  }
  for (const std::uint64_t other : {233, 235, 1347, 1349}) {
    const FitResult worse = fit_with(other, parameters);
    EXPECT_GE(worse.std_errors[0] * worse.std_errors[1] * 1.001, best.std_errors[0] * best.std_errors[1])
        << other;
  }
}

void expect_refused(const TypicalPixel& pixel, const std::string& why) {
  try {
    advise_tones(pixel, 1, 1);
    FAIL() << "not refused: " << why;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(why));
  }
}

TEST(ToneAdvice, RefusesWhatTellsNothing) {
  expect_refused(two_tones({-80.0, 1.0}),
                 "parameters: a fit of this comb does not come back");  // never touched
  TypicalPixel silent = two_tones({-40.0, 1.0});
  silent.conditions.noise = Noise{0.0, {0.0}};
  expect_refused(silent, "noise: tells no standard errors");
}

}  // namespace
}  // namespace combforce
