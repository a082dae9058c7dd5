// Models compared on pixels that one of them explains exactly.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

FitResult fitted(ModelPixel pixel, const std::string& model, std::vector<std::string> compare,
                 std::vector<ParameterBounds> bounds = {}) {
  pixel.conditions.settings.model = model;
  pixel.conditions.settings.compare = std::move(compare);
  if (pixel.conditions.noise) pixel.conditions.settings.weighting = Weighting::noise;
  pixel.conditions.settings.bounds = std::move(bounds);
  FitResult result;
  PixelFitter(pixel.conditions).fit(pixel.tip_nm, result);
  return result;
}

// n = 8 quadratures, k = 2 and 4 parameters: what is added is 2k + 2k(k + 1)/(n - k - 1).
TEST(ModelComparison, TellsTheModelThatMadeThePixel) {
  RandomPixels draw(1);
  for (int i = 0; i < 5; ++i) {
    ModelPixel pixel = draw.dmt();
    pixel.conditions.windows = 10000;  // in one window some of these pixels are Hertzian as well
    const FitResult result = fitted(pixel, "hertz", {"dmt", "flat_punch"});
    ASSERT_EQ(result.compared_count, 2U);
    const ComparedModel &dmt = result.compared[0], &punch = result.compared[1];
    EXPECT_EQ(dmt.model->name, "dmt");
    EXPECT_EQ(punch.model->name, "flat_punch");
    const double chi2 = (8.0 - result.free_parameters) * result.chi2_reduced;
    EXPECT_NEAR(result.aicc / (chi2 + 4.0 + 12.0 / 5.0), 1.0, 1e-12);
    EXPECT_NEAR(dmt.aicc, 4.0 * dmt.chi2_reduced + 8.0 + 40.0 / 3.0, 1e-9);
    EXPECT_LT(dmt.chi2_reduced, 0.01);
    EXPECT_LT(dmt.aicc, result.aicc - 10.0);
    EXPECT_LT(dmt.aicc, punch.aicc - 10.0);
  }
}

TEST(ModelComparison, IsThatOfTheModelFittedAlone) {
  RandomPixels draw(2);
  const ModelPixel pixel = draw.dmt();
  const FitResult together = fitted(pixel, "hertz", {"dmt"}), alone = fitted(pixel, "dmt", {});
  EXPECT_EQ(together.compared[0].status, alone.status);
  EXPECT_EQ(together.compared[0].chi2_reduced, alone.chi2_reduced);
  EXPECT_TRUE(std::isnan(alone.aicc));
  EXPECT_EQ(alone.compared_count, 0U);
}

TEST(ModelComparison, SaysNothingWhereDataAreTooFew) {
  RandomPixels draw(3);
  const FitResult result = fitted(draw.hertz(), "hertz", {"dmt"});  // n = 4: k must be 2 at most
  EXPECT_NEAR(result.aicc, 2.0 * result.chi2_reduced + 4.0 + 12.0, 1e-9);
  EXPECT_TRUE(std::isnan(result.compared[0].aicc));
}

TEST(ModelComparison, BoundsEachModelByItsOwnParameters) {
  RandomPixels draw(4);
  const ModelPixel pixel = draw.dmt();
  const FitResult result = fitted(pixel, "hertz", {"dmt"}, {{"adhesion_nn", 0.1, 0.5 * pixel.truth[2]}});
  EXPECT_EQ(result.compared[0].status, FitStatus::at_bound);
  EXPECT_THROW(fitted(pixel, "hertz", {"cone"}, {{"adhesion_nn", 0.1, 1.0}}), std::invalid_argument);
}

TEST(ModelComparison, RefusesWhatItCannotCompare) {
  RandomPixels draw(5);
  ModelPixel pixel = draw.hertz();
  EXPECT_THROW(fitted(pixel, "hertz", {"hertz"}), std::invalid_argument);
  EXPECT_THROW(fitted(pixel, "hertz", {"dmt", "dmt"}), std::invalid_argument);
  EXPECT_THROW(fitted(pixel, "hertz", {"glue"}), std::invalid_argument);
  pixel.conditions.settings.compare = {"dmt"};
  EXPECT_THROW(PixelFitter{pixel.conditions}, std::invalid_argument) << "no weight by noise";
  pixel.conditions.noise.reset();
  EXPECT_THROW(fitted(pixel, "hertz", {"dmt"}), std::invalid_argument);
}

}  // namespace
}  // namespace combforce::test
