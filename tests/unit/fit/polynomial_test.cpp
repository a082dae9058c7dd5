// The polynomial's fit: forces of one tone by the textbook's multiple angles, random pixels, and what the
// tones do not tell.
#include "fit/polynomial.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/failing_allocator.hpp"
#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

constexpr std::size_t count = Polynomial::parameters;

FitResult fitted(const ModelPixel& pixel) {
  PixelFitter fitter(pixel.conditions);
  FitResult result;
  fitter.fit(pixel.tip_nm, result);
  return result;
}

// Motion of 12 nm at two drive tones in the first mode's resonance and less at the others; each power makes 1
// to 10 nN of either sign where the tip turns at 25 nm.
class Draw : public RandomPixels {
 public:
  using RandomPixels::RandomPixels;

  ModelPixel pixel(const std::vector<std::uint64_t>& bins) {
    std::vector<double> amplitudes_nm;
    for (const std::uint64_t bin : bins)
      amplitudes_nm.push_back(bin == 234 || bin == 235 ? 12.0 : uniform(0.05, 0.5));
    return pixel(bins, amplitudes_nm);
  }

  ModelPixel pixel(const std::vector<std::uint64_t>& bins, const std::vector<double>& amplitudes_nm) {
    Phasors tones;
    for (const double amplitude_nm : amplitudes_nm)
      tones.push_back(std::polar(amplitude_nm, uniform(-std::numbers::pi, std::numbers::pi)));
    std::vector<double> truth;
    for (std::size_t k = 0; k < count; ++k)
      truth.push_back(std::copysign(uniform(1.0, 10.0), uniform(-1.0, 1.0)) /
                      std::pow(25.0, static_cast<double>(k + 1)));
    return pixel_of<Polynomial>(bins, std::move(tones), std::move(truth));
  }
};

const std::vector<std::uint64_t> around_one_mode{229, 230, 231, 232, 233, 234, 235, 236, 237, 238, 239, 240};

std::vector<std::uint64_t> with_sidebands() {
  std::vector<std::uint64_t> bins{1, 2, 3};
  bins.insert(bins.end(), around_one_mode.begin(), around_one_mode.end());
  bins.insert(bins.end(), {467, 468, 469, 470, 471});
  return bins;
}

// One tone of 10 nm, and the harmonics of the force:
//     cos^2 = (1 + cos 2)/2, cos^3 = (3 cos + cos 3)/4, cos^4 = (3 + 4 cos 2 + cos 4)/8,
//     cos^5 = (10 cos + 5 cos 3 + cos 5)/16.
ModelPixel one_tone() {
  const std::vector<std::uint64_t> bins{234, 468, 702, 936, 1170};
  const std::vector<double> p{0.5, -0.02, 2e-3, 2e-4, -2e-5};
  const Phasors tones{10.0, 0.0, 0.0, 0.0, 0.0};
  const Phasors forces{5.0 + 0.75 * 2.0 - 10.0 / 16.0 * 2.0, -0.5 * 2.0 + 0.5 * 2.0,
                       0.25 * 2.0 - 5.0 / 16.0 * 2.0, 2.0 / 8.0, -2.0 / 16.0};
  FitConditions conditions = paper_conditions("polynomial", bins, {});
  conditions.free_response->mean_nm = free_response_of(conditions, tones, forces);
  return {conditions, tones, p};
}

TEST(Polynomial, IsTheSumOfPowers) {
  const std::array<double, 5> p{1.0, 2.0, 3.0, 4.0, 5.0};
  EXPECT_EQ(Polynomial::force(p.data(), 2.0), 2.0 + 8.0 + 24.0 + 64.0 + 160.0);
  EXPECT_EQ(Polynomial::force(p.data(), -2.0), -2.0 + 8.0 - 24.0 + 64.0 - 160.0);
  EXPECT_EQ(Polynomial::powers(2.0), (std::array{2.0, 4.0, 8.0, 16.0, 32.0}));
}

TEST(PolynomialFit, HarmonicsOfOneToneGiveEveryPower) {
  const ModelPixel pixel = one_tone();
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::converged);
  EXPECT_EQ(result.free_parameters, count);
  // A motion exact to 5e-11, in powers up to the fifth.
  for (std::size_t k = 0; k < count; ++k)
    EXPECT_NEAR(result.parameters[k] / pixel.truth[k], 1.0, 1e-8) << Polynomial::info[k].name;
  PixelFitter fitter(pixel.conditions);
  EXPECT_LT(fitter.error(pixel.tip_nm, pixel.truth), 1e-16);
  std::vector<double> other = pixel.truth;
  other[4] += 16e-6;  // 1.6 nN at 10 nm: 1, 0.5 and 0.1 nN at the first, third and fifth harmonic
  EXPECT_NEAR(fitter.error(pixel.tip_nm, other) / (1.6 * 1.6), (100.0 + 25.0 + 1.0) / 256.0, 1e-8);
}

void expect_odd_powers_alone(const ModelPixel& pixel) {
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::ill_conditioned);
  EXPECT_EQ(result.free_parameters, 3U);
  for (const std::size_t k : {1, 3}) {
    EXPECT_TRUE(std::isnan(result.parameters[k]));
    EXPECT_TRUE(std::isnan(result.std_errors[k]));
  }
  for (const std::size_t k : {0, 2, 4}) {
    EXPECT_NEAR(result.parameters[k] / pixel.truth[k], 1.0, 1e-8);
    EXPECT_GT(result.std_errors[k], 0.0);
  }
}

void expect_nothing(const ModelPixel& pixel) {
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::ill_conditioned);
  EXPECT_TRUE(std::isnan(result.chi2_reduced));
  for (std::size_t k = 0; k < count; ++k) {
    EXPECT_TRUE(std::isnan(result.parameters[k]));
    EXPECT_TRUE(std::isnan(result.std_errors[k]));
  }
}

TEST(PolynomialFit, SidebandsAndTheSecondHarmonicGiveEveryPower) {
  Draw draw(41);
  for (int i = 0; i < 60; ++i) {
    SCOPED_TRACE(i);
    const ModelPixel pixel = draw.pixel(with_sidebands());
    const FitResult result = fitted(pixel);
    EXPECT_EQ(result.status, FitStatus::converged);  // nanonewtons against piconewtons of noise
    for (std::size_t k = 0; k < count; ++k)
      EXPECT_NEAR(result.parameters[k] / pixel.truth[k], 1.0, 1e-8) << Polynomial::info[k].name;
  }
}

TEST(PolynomialFit, TonesAroundOneModeTellOddPowersAlone) {
  Draw draw(42);
  for (int i = 0; i < 10; ++i) expect_odd_powers_alone(draw.pixel(around_one_mode));
}

// Four of one amplitude have one force over motion: nothing is told apart.
TEST(PolynomialFit, FourTonesTellOddPowersAloneUnlessTheyAreEqual) {
  Draw draw(44);
  const std::vector<std::uint64_t> bins{234, 1348, 3516, 6470};
  expect_odd_powers_alone(draw.pixel(bins, {30.0, 7.0, 3.0, 1.5}));
  expect_nothing(draw.pixel(bins, {10.0, 10.0, 10.0, 10.0}));
  expect_nothing(draw.pixel(bins, {10.0, 10.0, 5.0, 5.0}));
}

TEST(PolynomialFit, TwoTonesDoNotTellThreeOddPowersApart) {
  Draw draw(43);
  expect_nothing(draw.pixel({234, 1348}));
}

TEST(PolynomialFit, KeepsToItsBoundsAndSaysSo) {
  ModelPixel pixel = one_tone();
  pixel.conditions.settings.bounds = {{"cubic_nn_per_nm3", -1.0, 1.5e-3}};
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::at_bound);
  EXPECT_EQ(result.parameters[2], 1.5e-3);
  EXPECT_TRUE(std::isnan(result.std_errors[2]));
  // The even powers are at other harmonics; of the odd ones the first harmonic alone has the gradient, which
  // takes up what the others leave there: 0.75 * 0.5 nN less of the cubic, the quintic following at two
  // others.
  EXPECT_NEAR(result.parameters[1], pixel.truth[1], 1e-9);
  EXPECT_NEAR(result.parameters[3], pixel.truth[3], 1e-11);
  const double quintic_nn = -2.0 + 0.25 * 0.5 * (5.0 / 16.0) / ((25.0 + 1.0) / 256.0);
  EXPECT_NEAR(result.parameters[4], 1e-5 * quintic_nn, 1e-12);
}

// Even powers that no tone tells are no reason not to say so.
TEST(PolynomialFit, SaysThatItIsAtABoundWhereEvenPowersAreNotToldEither) {
  Draw draw(44);
  ModelPixel pixel = draw.pixel({234, 1348, 3516, 6470}, {30.0, 7.0, 3.0, 1.5});
  const bool positive = pixel.truth[2] > 0.0;
  const double beside = positive ? -1e-9 : 1e-9;
  pixel.conditions.settings.bounds = {
      {"cubic_nn_per_nm3", positive ? -1.0 : beside, positive ? beside : 1.0}};
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::at_bound);
  EXPECT_EQ(result.parameters[2], beside);
  EXPECT_TRUE(std::isnan(result.parameters[1]));
}

TEST(PolynomialFit, WithoutNoiseHasNoErrors) {
  ModelPixel pixel = one_tone();
  pixel.conditions.noise.reset();
  const FitResult result = fitted(pixel);
  EXPECT_EQ(result.status, FitStatus::converged);
  EXPECT_NEAR(result.parameters[0], pixel.truth[0], 1e-8);
  EXPECT_TRUE(std::isnan(result.std_errors[0]));
  EXPECT_TRUE(std::isnan(result.chi2_reduced));
}

TEST(PolynomialFit, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const ModelPixel pixel = one_tone();
  PixelFitter fitter(pixel.conditions);
  FitResult result;
  std::size_t allocations = 0;
  {
    const ForbidAllocation guard;
    fitter.fit(pixel.tip_nm, result);
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_EQ(result.status, FitStatus::converged);
}

}  // namespace
}  // namespace combforce::test
