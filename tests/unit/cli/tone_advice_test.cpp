#include "daemon/cli/tone_advice.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/integration/simulated_pixel.hpp"

namespace combforce {
namespace {

using test::SimulatedPixels;

TypicalPixel four_tones(std::vector<double> parameters) {
  const SimulatedPixels pixels = SimulatedPixels::paper({234, 1348, 3516, 6470});
  TypicalPixel pixel;
  pixel.conditions = pixels.conditions("dmt", 30);
  pixel.conditions.free_response.reset();
  pixel.drive_forces_nn = pixels.drive_forces_nn();
  pixel.parameters = std::move(parameters);
  return pixel;
}

// What a fit says when this tone is measured too.
FitResult fit_with(std::uint64_t bin, const std::vector<double>& parameters) {
  SimulatedPixels pixels = SimulatedPixels::paper({234, 1348, 3516, 6470});
  pixels.bins.push_back(bin);
  PixelFitter fitter(pixels.conditions("dmt", 30));
  FitResult result;
  fitter.fit(pixels.tones("dmt", parameters).value(), result);
  return result;
}

double product(std::span<const double> errors) {
  return std::accumulate(errors.begin(), errors.end(), 1.0, std::multiplies<>());
}

// Of these neighbours none is better than the advised one, and the errors are those that a fit of the wider
// comb will report.
TEST(ToneAdvice, IsTheToneWithWhichAFitSaysTheLeastErrors) {
  const std::vector<double> parameters{-40.0, 1.0, 5.0, 0.5};
  const ToneAdvice advice = advise_tones(four_tones(parameters), 1, 2);
  ASSERT_EQ(advice.steps.size(), 1U);
  const ToneAdvice::Step& best = advice.steps[0];
  const FitResult fit = fit_with(best.bin, parameters);
  for (std::size_t k = 0; k < parameters.size(); ++k)
    EXPECT_NEAR(best.std_errors[k] / fit.std_errors[k], 1.0, 1e-3) << "parameter " << k;
  EXPECT_LT(product(best.std_errors), 0.5 * product(advice.std_errors));
  for (const std::uint64_t other : {232, 1350}) {
    const FitResult worse = fit_with(other, parameters);
    EXPECT_GE(product(std::span(worse.std_errors).first(4)) * 1.001, product(best.std_errors)) << other;
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
