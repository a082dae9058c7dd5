// PixelFitter against ceres::Solve on random pixels that no parameters fit exactly: forces of a model and a
// share of something else. Other draws, and more, under the label slow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/fit/ceres_oracle.hpp"
#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

std::vector<std::uint64_t> bins_of(const Comb& comb) {
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : comb.tones) bins.push_back(tone.bin);
  return bins;
}

// Replaces a pixel's free response by one whose forces no parameters give, and returns these forces.
Phasors disturb(ModelPixel& pixel, RandomPixels& draw, double share) {
  Phasors& free_nm = pixel.conditions.free_response->mean_nm;
  Phasors forces(free_nm.size());
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const double frequency_hz = static_cast<double>(pixel.conditions.comb.tones[i].bin) * paper_delta_f_hz;
    forces[i] = (pixel.tip_nm[i] - free_nm[i]) / tip_response(pixel.conditions.cantilever, frequency_hz);
    forces[i] *= 1.0 + std::complex(draw.uniform(-share, share), draw.uniform(-share, share));
  }
  free_nm = free_response_of(pixel.conditions, pixel.tip_nm, forces);
  return forces;
}

// The fitter's aims, which it states: 1e-4 nm, 5e-5, or a hundredth of the standard error.
double tolerance(const FitResult& result, std::size_t k) {
  const double aim = k == 0 ? 1e-4 : 5e-5 * std::abs(result.parameters[k]);
  return result.std_errors[k] > 0.0 ? std::max(aim, 0.01 * result.std_errors[k]) : aim;
}

// Where the fitter says that it converged, the deepest minimum that ceres finds from the truth and from what
// the fitter found is the fitter's. `share`: of the forces that no parameters explain. Returns whether it
// says so.
template <typename Model>
bool has_the_same_minimum(ModelPixel pixel, RandomPixels& draw, double share) {
  const Phasors forces = disturb(pixel, draw, share);
  PixelFitter fitter(pixel.conditions);
  FitResult result;
  fitter.fit(pixel.tip_nm, result);
  if (result.status != FitStatus::converged) return false;
  const ReferenceMotion motion(bins_of(pixel.conditions.comb), pixel.tip_nm);
  const std::vector<double> weights(forces.size(), 1.0);
  const std::vector<double> found(result.parameters.begin(), result.parameters.begin() + Model::parameters);
  const Minimum from_truth = solve_by_ceres<Model>(motion, forces, weights, pixel.truth);
  const Minimum from_found = solve_by_ceres<Model>(motion, forces, weights, found);
  EXPECT_LE(from_found.error, from_truth.error * (1.0 + 1e-6)) << "a deeper minimum lies near the truth";
  for (std::size_t k = 0; k < Model::parameters; ++k)
    EXPECT_NEAR(found[k], from_found.parameters[k], tolerance(result, k)) << "p" << k;
  return true;
}

// Of the draws of DMT one in four determines every parameter.
template <typename Compare>
void compare_some(Compare compare) {
  int compared = 0;
  for (int i = 0; i < 40 && compared < 2; ++i) {
    SCOPED_TRACE(i);
    if (compare()) ++compared;
  }
  EXPECT_EQ(compared, 2);
}

class CeresOracle : public testing::TestWithParam<int> {};

TEST_P(CeresOracle, HertzFindsItsMinimum) {
  RandomPixels draw(static_cast<std::uint64_t>(3000 + GetParam()));
  compare_some([&] { return has_the_same_minimum<Hertz>(draw.hertz(), draw, 0.02); });
}

TEST_P(CeresOracle, DmtFindsItsMinimum) {
  RandomPixels draw(static_cast<std::uint64_t>(4000 + GetParam()));
  compare_some([&] { return has_the_same_minimum<Dmt>(draw.dmt(), draw, 0.002); });
}

#ifdef COMBFORCE_SLOW
INSTANTIATE_TEST_SUITE_P(Slow, CeresOracle, testing::Range(100, 120));
#else
INSTANTIATE_TEST_SUITE_P(Draws, CeresOracle, testing::Range(0, 3));

// The contact strength held below its true value: what remains moves to the minimum along the bound.
TEST(Bounds, AMinimumOnABoundIsCeresMinimumUnderThatBound) {
  RandomPixels draw(31);
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    ModelPixel pixel = draw.hertz();
    const double upper = 0.8 * pixel.truth[1];
    pixel.conditions.settings.bounds = {{"contact_strength_gpa_sqrt_nm", 0.01, upper}};
    PixelFitter fitter(pixel.conditions);
    FitResult result;
    fitter.fit(pixel.tip_nm, result);
    EXPECT_EQ(result.status, FitStatus::at_bound);
    EXPECT_DOUBLE_EQ(result.parameters[1], upper);
    EXPECT_TRUE(std::isnan(result.std_errors[1]));
    const std::vector<std::uint64_t> bins = bins_of(pixel.conditions.comb);
    const ReferenceMotion motion(bins, pixel.tip_nm);
    const Minimum expected = solve_by_ceres<Hertz>(motion, reference_phasors<Hertz>(motion, pixel.truth),
                                                   {1.0, 1.0}, {pixel.truth[0], upper}, {1});
    EXPECT_NEAR(result.parameters[0], expected.parameters[0], tolerance(result, 0));
  }
}

// Whatever bound cuts the truth off, the parameters stay within.
TEST(Bounds, AreRespectedByEveryParameterOnBothSides) {
  RandomPixels draw(32);
  for (int i = 0; i < 2; ++i) {
    const ModelPixel pixel = draw.dmt();
    for (std::size_t k = 0; k < 4; ++k)
      for (const bool above : {false, true}) {
        SCOPED_TRACE(testing::Message() << "pixel " << i << ", p" << k << (above ? " above" : " below"));
        FitConditions conditions = pixel.conditions;
        const double t = pixel.truth[k],
                     near = k == 0 ? (above ? t + 1.0 : t - 1.0) : (above ? 1.3 * t : 0.7 * t);
        const ParameterBounds bounds{std::string(Dmt::info[k].name),
                                     above ? near : (k == 0 ? t - 30.0 : 0.1 * t),
                                     above ? (k == 0 ? t + 30.0 : 10.0 * t) : near};
        conditions.settings.bounds = {bounds};
        PixelFitter fitter(conditions);
        FitResult result;
        fitter.fit(pixel.tip_nm, result);
        EXPECT_GE(result.parameters[k], bounds.lower);
        EXPECT_LE(result.parameters[k], bounds.upper);
        EXPECT_NE(result.status, FitStatus::converged);
      }
  }
}
#endif

}  // namespace
}  // namespace combforce::test
