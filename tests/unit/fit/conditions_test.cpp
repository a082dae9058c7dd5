// Conditions of a fit that make no sense are refused when it is set up, by name and value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "tests/unit/fit/paper_cantilever.hpp"

namespace combforce::test {
namespace {

FitConditions valid() {
  return paper_conditions("dmt", {234, 1348}, {{0.0, -40.8}, {0.0, -9.2}});
}

struct Mistake {
  std::function<void(FitConditions&)> make;
  std::string message;  // what it must contain
};

class Mistakes : public testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, AreNamedWithTheirValue) {
  FitConditions conditions = valid();
  GetParam().make(conditions);
  EXPECT_THAT([&] { PixelFitter fitter(conditions); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    FitConditions, Mistakes,
    testing::Values(
        Mistake{[](auto& c) { c.sample_rate_hz = -1.0; }, "sample_rate_hz: -1"},
        Mistake{[](auto& c) { c.windows = 0; }, "windows: 0"},
        Mistake{[](auto& c) { c.comb.tones.clear(); }, "tones"},
        Mistake{[](auto& c) { c.cantilever.modes[1].quality_factor = 0.0; }, "modes[1].quality_factor: 0"},
        Mistake{[](auto& c) { c.free_response->mean_nm.pop_back(); },
                "free_response.mean_nm: 1 values for 2"},
        Mistake{[](auto& c) { c.free_response->mean_nm[1] = std::numeric_limits<double>::infinity(); },
                "free_response.mean_nm[1]"},
        Mistake{[](auto& c) { c.free_response->covariance.emplace(15); },
                "free_response.covariance: 15 values"},
        Mistake{[](auto& c) { c.noise->temperature_k = -2.0; }, "noise.temperature_k: -2"},
        Mistake{[](auto& c) { c.settings.model = "dmpt"; }, "dmpt"},
        Mistake{[](auto& c) {
                  c.settings.model = "polynomial";
                  c.settings.refine = 1;
                },
                "settings.refine: 1, must be 0 for model polynomial"},
        Mistake{[](auto& c) {
                  c.settings.bounds = {{"adhesion", 1.0, 2.0}};
                },
                R"(settings.bounds[0].parameter: "adhesion", not of model dmt)"},
        Mistake{[](auto& c) {
                  c.settings.bounds = {{"adhesion_nn", 2.0, 1.0}};
                },
                "settings.bounds.adhesion_nn: 2 to 1"},
        Mistake{[](auto& c) {
                  c.settings.bounds = {{"adhesion_nn", 0.0, 1.0}};
                },
                "settings.bounds.adhesion_nn[0]: 0, must be positive"},
        Mistake{[](auto& c) {
                  c.noise = Noise{0.0, {0.0, 0.0}};
                  c.settings.refine = 1;
                  c.settings.profile_intervals = true;
                },
                "settings.profile_intervals: true, but noise is all 0"},
        Mistake{[](auto& c) {
                  c.noise = Noise{0.0, {0.0}};
                  c.settings.refine = 1;
                  c.settings.compare = {"hertz"};
                },
                "settings.compare: not empty, but noise is all 0"},
        Mistake{[](auto& c) {
                  c.cantilever.uncertainty.resize(c.cantilever.modes.size());
                  c.cantilever.uncertainty[1].correlation = {0.9, 0.9, 0.0, -0.9, 0.0, 0.0};
                },
                "cantilever.uncertainty[1].correlation: least eigenvalue -0.8, must be >= 0"},
        Mistake{[](auto& c) {
                  c.noise.reset();
                  c.settings.weighting = Weighting::noise;
                },
                "settings.weighting: noise"},
        Mistake{[](auto& c) {
                  c.noise = Noise{0.0, {0.0}};
                  c.settings.weighting = Weighting::noise;
                },
                "settings.weighting: noise"}));

TEST(PixelFitter, RefusesListsOfTheWrongLength) {
  PixelFitter fitter(valid());
  FitResult result;
  const std::vector<double> three{-40.0, 1.0, 5.0};
  EXPECT_THROW(fitter.fit(Phasors(3), result), std::invalid_argument);
  EXPECT_THROW(fitter.fit_from(Phasors(2), three, result), std::invalid_argument);
  EXPECT_THROW(fitter.error(Phasors(2), three), std::invalid_argument);
  EXPECT_EQ(fitter.model().name, "dmt");
}

}  // namespace
}  // namespace combforce::test
