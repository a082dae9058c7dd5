// The refined fit against single pixels whose force is known, and what must not happen.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/integration/simulated_pixel.hpp"
#include "tests/support/failing_allocator.hpp"

namespace combforce {
namespace {

using test::four_tones;
using test::greatest_error;
using test::Phasors;
using test::SimulatedPixels;

constexpr unsigned refine = 30;

Phasors phasors(const nlohmann::json& list) {
  Phasors result;
  for (const auto& value : list) result.emplace_back(value[0].get<double>(), value[1].get<double>());
  return result;
}

TEST(RefinedFit, TakesTheBiasOutOfThePapersCases) {
  std::ifstream file(std::string(COMBFORCE_SHARED_DIR) + "/cases/paper_cases.json");
  if (!file) GTEST_SKIP() << "the reference cases are not beside the project";
  for (const auto& one : nlohmann::json::parse(file)) {
    const std::string name = one["name"];
    const std::vector<double> truth = one["truth"];
    FitConditions conditions = SimulatedPixels::paper(one["bins"].get<std::vector<std::uint64_t>>())
                                   .conditions(one["model"], refine);
    conditions.free_response->mean_nm = phasors(one["free_nm"]);
    PixelFitter fitter(conditions);
    FitResult result;
    fitter.fit(phasors(one["engaged_nm"]), result);
    // The tones are good to 0.034 pm: at equal amplitude DMT feels that.
    const bool hard = name == "dmt_4tone_equal_amplitude";
    // Two tones at equal amplitude do not determine p1 to 30 % in one window, noise-free or not.
    EXPECT_TRUE(result.status == FitStatus::converged || result.status == FitStatus::ill_conditioned ||
                result.status == FitStatus::ambiguous)
        << name;
    EXPECT_NEAR(result.parameters[0], truth[0], 1e-3) << name;
    for (std::size_t k = 1; k < truth.size(); ++k)
      EXPECT_NEAR(result.parameters[k] / truth[k], 1.0, hard ? 1e-3 : 2e-4) << name << ", parameter " << k;
    for (std::size_t k = 0; k < truth.size(); ++k)
      EXPECT_LT(std::abs(result.quadrature_errors[k]), 1e-4) << name << ", parameter " << k;
  }
}

// Substituting the model's own motion again and again diverges there (by 1.06, 1.39 and 1.7 a round).
TEST(RefinedFit, ConvergesWhereSubstitutionDiverges) {
  const SimulatedPixels pixels = SimulatedPixels::paper({234, 1348});
  PixelFitter fitter(pixels.conditions("hertz", refine));
  for (const std::vector<double>& truth : {std::vector{-40.0, 4.0}, {-25.0, 1.0}, {-30.0, 10.0}}) {
    const auto tones = pixels.tones("hertz", truth);
    ASSERT_TRUE(tones);
    FitResult result;
    fitter.fit(*tones, result);
    EXPECT_TRUE(result.status == FitStatus::converged || result.status == FitStatus::ill_conditioned);
    EXPECT_LT(greatest_error(result, truth), 1e-3) << truth[0] << ", " << truth[1];
  }
}

// Products about one mode: the cost of a motion that is not the force's yet may be less than that of the
// solution, which is found all the same.
TEST(RefinedFit, FollowsAViscousContactByProductsOfIntermodulation) {
  const SimulatedPixels pixels{{{{70e3, 150.0, 2.0, 1.0}}},
                               {139, 141},
                               {133, 135, 137, 139, 141, 143, 145, 147},
                               DriveScheme::equal_amplitude};
  PixelFitter fitter(pixels.conditions("kelvin_voigt", refine));
  for (const std::vector<double>& truth :
       {std::vector{-31.0, 1.0, 0.3}, {-33.0, 0.5, 0.8}, {-35.0, 1.5, 0.4}}) {
    const auto tones = pixels.tones("kelvin_voigt", truth);
    ASSERT_TRUE(tones);
    FitResult result;
    fitter.fit(*tones, result);
    EXPECT_EQ(result.status, FitStatus::converged) << truth[0];
    EXPECT_LT(greatest_error(result, truth), 1e-3) << truth[0];
  }
}

TEST(RefinedFit, SaysWhenTheModelDoesNotExplainThePixel) {
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  const auto tones = pixels.tones("dmt", {-40.0, 1.0, 1.5, 0.5});
  ASSERT_TRUE(tones);
  PixelFitter fitter(pixels.conditions("hertz", refine));  // 1.5 nN of adhesion are far above the noise
  FitResult result;
  fitter.fit(*tones, result);
  EXPECT_EQ(result.status, FitStatus::misfit);
  EXPECT_GT(result.chi2_reduced, 5.0);
}

// Without adhesion a DMT contact is a Hertz contact, its contact distance without meaning: from step to step
// it changes beyond all measure, and chi^2 by nothing.
TEST(RefinedFit, FindsASurfaceWithoutTheAdhesionOfItsModel) {
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  PixelFitter fitter(pixels.conditions("dmt", refine));
  for (const std::vector<double>& truth : {std::vector{-40.0, 1.0}, {-42.5, 0.6}, {-38.0, 2.4}}) {
    FitResult result;
    fitter.fit(pixels.tones("hertz", truth).value(), result);
    EXPECT_EQ(result.status, FitStatus::ill_conditioned);
    // A tenth of the standard error of the adhesion is left of it at most; a quarter of that was seen to move
    // the surface by 2e-4 nm and the strength by 3e-5.
    EXPECT_NEAR(result.parameters[0], truth[0], 2e-3);
    EXPECT_NEAR(result.parameters[1], truth[1], 1e-3 * truth[1]);
    EXPECT_LT(result.parameters[2], 1e-3);
    EXPECT_GT(result.std_errors[2], 1e-2) << "what the bound above was taken for";
  }
}

// The drive repeats each millisecond, the motion each two: by 4 nm the halves of the window differ. Without
// noise there is no chi^2 to say so.
TEST(RefinedFit, SaysWhenTheMotionHasDoubledItsPeriod) {
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  FitConditions conditions = pixels.conditions("dmt", refine);
  conditions.noise.reset();
  PixelFitter fitter(conditions);
  FitResult result;
  fitter.fit(pixels.tones("dmt", {-37.0575, 1.49094, 8.65134, 0.75024}).value(), result);
  EXPECT_EQ(result.status, FitStatus::misfit);
  fitter.fit(pixels.tones("dmt", {-40.0, 1.0, 5.0, 0.5}).value(), result);
  EXPECT_EQ(result.status, FitStatus::converged);
}

TEST(RefinedFit, SaysWhenTheIterationsDoNotSuffice) {
  const SimulatedPixels pixels = SimulatedPixels::paper({234, 1348});
  const auto tones = pixels.tones("hertz", {-40.0, 1.0});
  ASSERT_TRUE(tones);
  PixelFitter fitter(pixels.conditions("hertz", 1));
  FitResult result;
  fitter.fit(*tones, result);
  EXPECT_EQ(result.status, FitStatus::not_converged);
}

void expect_pure_function(const FitConditions& conditions, const Phasors& tones, const Phasors& others) {
  PixelFitter fresh(conditions), used(conditions);
  FitResult expected, result;
  fresh.fit(tones, expected);
  std::size_t allocations = 0;
  {
    const test::ForbidAllocation guard;
    used.fit(others, result);
    used.fit(tones, result);
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_EQ(result.status, FitStatus::converged);
  for (std::size_t k = 0; k < expected.parameters_count; ++k) {
    EXPECT_EQ(result.parameters[k], expected.parameters[k]);
    EXPECT_EQ(result.std_errors[k], expected.std_errors[k]);
  }
  EXPECT_EQ(result.iterations, expected.iterations);
}

TEST(RefinedFit, IsAPureFunctionAndDoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  const auto tones = pixels.tones("dmt", {-40.0, 1.0, 5.0, 0.5}),
             others = pixels.tones("dmt", {-38.0, 2.0, 3.0, 0.4});
  ASSERT_TRUE(tones && others);
  expect_pure_function(pixels.conditions("dmt", refine), *tones, *others);
}

// Heat moves this lever by 0.3 nm: its force is averaged, and its intervals are those of that force.
TEST(RefinedFit, IsAPureFunctionOfASoftLeversPixelToo) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const SimulatedPixels pixels{
      {{{20e3, 2.0, 0.05, 1.0}}}, {40}, {40, 80, 120, 160}, DriveScheme::equal_amplitude};
  const auto tones = pixels.tones("hertz", {-35.0, 0.05}), others = pixels.tones("hertz", {-40.0, 0.03});
  ASSERT_TRUE(tones && others);
  FitConditions conditions = pixels.conditions("hertz", refine);
  conditions.settings.profile_intervals = true;
  expect_pure_function(conditions, *tones, *others);
}

// Four tones at equal energy determine DMT so well that the linear approximation holds for the widths; the
// trench of E bends, so the sides differ by a fifth: twice that is allowed.
TEST(RefinedFit, IntervalsAreTheStandardErrorsWherePixelsAreLinear) {
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  const std::vector<double> truth{-40.0, 1.0, 5.0, 0.5};
  const auto tones = pixels.tones("dmt", truth);
  ASSERT_TRUE(tones);
  FitConditions conditions = pixels.conditions("dmt", refine);
  conditions.settings.profile_intervals = true;
  FitResult result;
  PixelFitter(conditions).fit(*tones, result);
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const double below = (truth[k] - result.intervals[k][0]) / result.std_errors[k],
                 above = (result.intervals[k][1] - truth[k]) / result.std_errors[k];
    EXPECT_NEAR(0.5 * (below + above), 1.0, 0.05) << k;
    EXPECT_NEAR(above - below, 0.0, 0.4) << k;
  }
}

TEST(RefinedFit, HasNoIntervalsUnlessAsked) {
  const SimulatedPixels pixels = SimulatedPixels::paper({234, 1348});
  const auto tones = pixels.tones("hertz", {-40.0, 1.0});
  ASSERT_TRUE(tones);
  FitResult result;
  PixelFitter(pixels.conditions("hertz", refine)).fit(*tones, result);
  EXPECT_TRUE(std::isnan(result.intervals[0][0]));
  FitConditions conditions = pixels.conditions("hertz", 0);
  conditions.settings.profile_intervals = true;
  EXPECT_THROW(PixelFitter{conditions}, std::invalid_argument);
}

// The same motion, and the same noise, in a window that begins in the middle of a period.
TEST(RefinedFit, DoesNotDependOnWhereTheWindowBegins) {
  SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  pixels.bins = {232, 234, 236, 1348, 3516, 6470};
  const auto tones = pixels.tones("dmt", {-40.0, 1.0, 5.0, 0.5});
  ASSERT_TRUE(tones);
  FitConditions conditions = pixels.conditions("dmt", refine);
  FitResult expected, result;
  PixelFitter(conditions).fit(*tones, expected);
  const std::uint64_t first_sample = 1'234'567'890'123;
  Phasors later = *tones;  // as they are when time 0 lies so much earlier
  for (std::size_t i = 0; i < later.size(); ++i) {
    const auto back = std::polar(
        1.0, -phase_radians(phase_index(pixels.bins[i], first_sample, SimulatedPixels::window_samples),
                            SimulatedPixels::window_samples));
    later[i] *= back;
    conditions.free_response->mean_nm[i] *= back;
  }
  PixelFitter fitter(conditions);
  fitter.fit(later, result, first_sample);
  for (std::size_t k = 0; k < expected.parameters_count; ++k) {
    EXPECT_NEAR(result.parameters[k] / expected.parameters[k], 1.0, 1e-5) << k;
    EXPECT_NEAR(result.std_errors[k] / expected.std_errors[k], 1.0, 1e-4) << k;
  }
  fitter.fit(later, result);  // as if it began at sample 0: other correlations, other errors
  EXPECT_GT(std::abs(result.std_errors[0] / expected.std_errors[0] - 1.0), 1e-2);
}

// Only relative weights matter for the parameters; what needs the noise is unknown.
TEST(RefinedFit, WorksWithoutANoiseModel) {
  const SimulatedPixels pixels = SimulatedPixels::paper(four_tones);
  const std::vector<double> truth{-40.0, 1.0, 5.0, 0.5};
  const auto tones = pixels.tones("dmt", truth);
  ASSERT_TRUE(tones);
  FitConditions conditions = pixels.conditions("dmt", refine);
  conditions.noise.reset();
  PixelFitter fitter(conditions);
  FitResult result;
  fitter.fit(*tones, result);
  EXPECT_EQ(result.status, FitStatus::converged);
  EXPECT_LT(greatest_error(result, truth), 1e-3);
  EXPECT_TRUE(std::isnan(result.std_errors[1]));
  EXPECT_TRUE(std::isnan(result.chi2_reduced));
}

}  // namespace
}  // namespace combforce
