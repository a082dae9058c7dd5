// Models whose force depends on history: phasors along the partial motion and fits of it, against a reference
// that follows contact by itself and has its own formulas.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "fit/capillary.hpp"
#include "fit/force_balance.hpp"
#include "fit/jkr.hpp"
#include "fit/residuals.hpp"
#include "tests/support/failing_allocator.hpp"
#include "tests/unit/fit/random_pixel.hpp"
#include "tests/unit/fit/reference_history.hpp"
#include "tests/unit/fit/terms_of_balance.hpp"

namespace combforce::test {
namespace {

const std::vector<std::uint64_t> four_tones{234, 1348, 3516, 6470}, two_tones{234, 1348},
    twelve_tones{228, 229, 230, 231, 232, 233, 234, 235, 236, 237, 238, 239};

template <typename Model>
HistoryForce force_of(const std::vector<double>& p);
template <>
HistoryForce force_of<Jkr>(const std::vector<double>& p) {
  return jkr_force(p);
}

template <>
HistoryForce force_of<Capillary>(const std::vector<double>& p) {
  return capillary_force(p);
}

struct Pixel {
  std::vector<std::uint64_t> bins;
  Phasors tip_nm;
  std::vector<double> truth;
};

// Soft to stiff polymers, as the pixels of DMT.
template <typename Model>
std::vector<double> draw_truth(RandomPixels& draw);
template <>
std::vector<double> draw_truth<Jkr>(RandomPixels& draw) {
  const double p0 = draw.uniform(-43.0, -37.0), p1 = draw.uniform(0.4, 2.5);
  return {p0, p1, draw.uniform(2.0, 9.0)};
}

template <>
std::vector<double> draw_truth<Capillary>(RandomPixels& draw) {
  std::vector<double> p = draw_truth<Jkr>(draw);
  p.push_back(draw.uniform(1.0, 3.0));
  p.push_back(p[3] * draw.uniform(0.7, 1.5));
  return p;
}

template <typename Model>
Pixel draw_pixel(RandomPixels& draw, const std::vector<std::uint64_t>& bins) {
  Phasors tones = bins.size() == 2   ? draw.hertz().tip_nm
                  : bins.size() == 4 ? draw.dmt().tip_nm
                                     : draw.intermodulation<Hertz>(bins.size()).tip_nm;
  std::vector<double> truth = draw_truth<Model>(draw);
  if (bins.size() > 4) truth[0] = ReferenceMotion(bins, tones).lowest_nm() + draw.uniform(1.5, 6.0);
  return {bins, std::move(tones), std::move(truth)};
}

// `forces`: measured on the pixel's motion.
template <typename Model>
FitConditions conditions_of(const Pixel& pixel, const Phasors& forces) {
  FitConditions conditions = paper_conditions(std::string(Model::model.name), pixel.bins, {});
  conditions.free_response->mean_nm = free_response_of(conditions, pixel.tip_nm, forces);
  return conditions;
}

template <typename Model>
Phasors forces_of(const Pixel& pixel) {
  return history_phasors(ReferenceMotion(pixel.bins, pixel.tip_nm), force_of<Model>(pixel.truth));
}

Eigen::VectorXd rows_of(const Phasors& phasors) {
  Eigen::VectorXd rows(static_cast<Eigen::Index>(2 * phasors.size()));
  for (std::size_t i = 0; i < phasors.size(); ++i) {
    rows(static_cast<Eigen::Index>(2 * i)) = phasors[i].real();
    rows(static_cast<Eigen::Index>(2 * i + 1)) = phasors[i].imag();
  }
  return rows;
}

template <typename Model>
class History : public testing::Test {};
using HistoryModels = testing::Types<Jkr, Capillary>;
TYPED_TEST_SUITE(History, HistoryModels);

TYPED_TEST(History, PhasorsAndDerivativesApproachTheReference) {
  RandomPixels draw(31);
  for (int i = 0; i < 2; ++i) {
    SCOPED_TRACE(i);
    const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
    const ReferenceMotion motion(pixel.bins, pixel.tip_nm);
    const Eigen::VectorXd expected = rows_of(forces_of<TypeParam>(pixel));
    ForceBalance balance(pixel.bins);
    balance.set_motion(pixel.tip_nm);
    Eigen::MatrixXd found;
    for (std::size_t level = 0; level < ForceBalance::levels; ++level) {
      balance.prepare(contact_top_nm<TypeParam>(pixel.truth.data()), level, false);
      found = terms_of_balance<TypeParam>(balance, pixel.truth);
      const double error = (found.col(0) - expected).norm() / expected.norm();
      EXPECT_LE(error, level == 0 ? 1e-4 : 1e-6) << "level " << level;
    }
    for (std::size_t k = 0; k < TypeParam::parameters; ++k) {
      // Central differences: 1e-4 of a parameter leaves (1e-4)^2 of its slope, more where a turning point is
      // close to a switch. Where a cycle more or less is held it is none.
      const double step = 1e-4 * (k == 0 ? 1.0 : pixel.truth[k]);
      std::vector<double> before = pixel.truth, after = pixel.truth;
      before[k] -= step;
      after[k] += step;
      const HistoryForce force_before = force_of<TypeParam>(before), force_after = force_of<TypeParam>(after);
      if (engagements(motion, force_before).size() != engagements(motion, force_after).size()) continue;
      const Eigen::VectorXd difference = (rows_of(history_phasors(motion, force_after, 1e-10)) -
                                          rows_of(history_phasors(motion, force_before, 1e-10))) /
                                         (2.0 * step);
      const Eigen::VectorXd slope = found.col(static_cast<Eigen::Index>(1 + k));
      EXPECT_LE((slope - difference).norm(), 1e-5 * difference.norm()) << "p" << k;
    }
  }
}

// Nothing in common but the formula. Each of some hundred switches is met to a sample, by chance either way:
// 2 p2 0.3e-6 sqrt(200) in a tone, twice that in all; three times that.
TYPED_TEST(History, PhasorsAreThoseOfSamplesInTime) {
  RandomPixels draw(32);
  const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
  const ReferenceMotion motion(pixel.bins, pixel.tip_nm);
  const Eigen::VectorXd sampled = rows_of(sampled_phasors(
      motion, std::vector<std::uint64_t>{117, 674, 1758, 3235}, force_of<TypeParam>(pixel.truth), 1'000'000));
  EXPECT_LE((sampled - rows_of(forces_of<TypeParam>(pixel))).norm(), 5e-5 * pixel.truth[2]);
}

// A surface that the motion does not reach, one near which it always stays, and one that it never leaves; all
// numbers.
TYPED_TEST(History, HoldsWithoutContactAndWithoutRelease) {
  const std::vector<std::uint64_t> bins{3, 10};
  const Phasors tones{{20.0, 0.0}, {0.0, 4.0}};
  const ReferenceMotion motion(bins, tones);
  ForceBalance balance(bins);
  balance.set_motion(tones);
  RandomPixels draw(33);
  std::vector<double> p = draw_truth<TypeParam>(draw);
  for (const double p0 : {-60.0, -24.5, -23.0, 0.0, 25.0, 60.0}) {
    p[0] = p0;
    balance.prepare(contact_top_nm<TypeParam>(p.data()), ForceBalance::levels - 1, false);
    const Eigen::MatrixXd found = terms_of_balance<TypeParam>(balance, p);
    EXPECT_TRUE(found.allFinite()) << p0;
    if (p0 > motion.at(0.0) + 4.0) continue;  // never free: the reference has no event to begin from
    const Eigen::VectorXd expected = rows_of(history_phasors(motion, force_of<TypeParam>(p)));
    EXPECT_LE((found.col(0) - expected).norm(), 1e-6 * expected.norm() + 1e-12) << p0;
  }
}

// What the solver sees, the linear parameters following: with all parameters free, and with each of the
// others than p0 held by its bound.
TYPED_TEST(History, ResidualsHaveTheirDerivatives) {
  constexpr std::size_t count = TypeParam::parameters;
  RandomPixels draw(37);
  const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
  const Phasors forces = forces_of<TypeParam>(pixel);
  ForceBalance balance(pixel.bins);
  balance.set_motion(pixel.tip_nm);
  Residuals<TypeParam> residuals(balance, forces.size());
  residuals.set_measured(forces, std::vector<double>{1.0, 2.0, 3.0, 4.0});
  std::array<double, count> p;
  std::ranges::copy(pixel.truth, p.begin());
  p[0] += 0.02;
  p[count - 1] *= 1.1;
  for (std::size_t held = 0; held < count; ++held) {
    std::array<Bounds, count> bounds;
    for (std::size_t k = 0; k < count; ++k)
      bounds[k] =
          k == 0 ? Bounds{p[0] - 20.0, p[0] + 20.0} : Bounds{0.1 * p[k], (k == held ? 0.5 : 20.0) * p[k]};
    balance.prepare(contact_top_nm<TypeParam>(p.data()), 3, false);
    residuals.set_bounds(bounds);
    const auto x = residuals.coordinates(p);
    const auto found = residuals.parameters(x);
    for (std::size_t k = 1; k < count; ++k) {
      EXPECT_GE(found[k], bounds[k].lower * (1.0 - 1e-9)) << "p" << k;
      EXPECT_LE(found[k], bounds[k].upper * (1.0 + 1e-9)) << "p" << k;
    }
    const Eigen::Index rows = residuals.NumResiduals();
    Eigen::VectorXd here(rows), before(rows), after(rows);
    Eigen::MatrixXd jacobian(rows, x.size());
    residuals(x.data(), here.data(), jacobian.data());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      constexpr double step = 1e-6;
      auto shifted = x;
      shifted(k) -= step;
      residuals(shifted.data(), before.data(), nullptr);
      shifted(k) += 2.0 * step;
      residuals(shifted.data(), after.data(), nullptr);
      const Eigen::VectorXd difference = (after - before) / (2.0 * step);
      EXPECT_LE((jacobian.col(k) - difference).norm(), 1e-5 * difference.norm() + 1e-7)
          << "coordinate " << k << ", p" << held << " held";
    }
  }
}

// The surface takes, each time it is touched and let go, the area between the branches.
TYPED_TEST(History, DissipatedPowerIsTheHysteresis) {
  RandomPixels draw(34);
  const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
  PixelFitter fitter(conditions_of<TypeParam>(pixel, forces_of<TypeParam>(pixel)));
  FitResult result;
  fitter.fit_from(pixel.tip_nm, pixel.truth, result);
  const double work = work_nn_nm(ReferenceMotion(pixel.bins, pixel.tip_nm), force_of<TypeParam>(pixel.truth));
  EXPECT_GT(work, 0.0);
  // 1e-18 J in a period of 1 ms are 1 fW. The work is summed over 1e5 heights, coarse at a square root.
  EXPECT_NEAR(result.dissipated_fw / work, 1.0, 1e-4);
}

TYPED_TEST(History, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  RandomPixels draw(35);
  const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
  PixelFitter fitter(conditions_of<TypeParam>(pixel, forces_of<TypeParam>(pixel)));
  FitResult result;
  std::size_t allocations = 0;
  {
    const ForbidAllocation guard;
    fitter.fit(pixel.tip_nm, result);
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(result.iterations, 0U);
}

TYPED_TEST(History, IsFittedToThePartialMotionAlone) {
  RandomPixels draw(36);
  const Pixel pixel = draw_pixel<TypeParam>(draw, four_tones);
  FitConditions conditions = conditions_of<TypeParam>(pixel, Phasors(4));
  conditions.settings.refine = 3;
  try {
    validate(conditions);
    ADD_FAILURE() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("settings.refine: 3"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("partial fit only"), std::string::npos) << error.what();
  }
}

struct HistoryTally {
  std::map<FitStatus, std::array<int, 2>> count;  // exact, or not
  int wrong = 0;                                  // converged, but off by more than two standard errors

  static constexpr double exact = 1e-4;  // of a parameter; p0 of 1 nm

  void add(const Pixel& pixel, const FitResult& result) {
    double error = 0.0, standard_errors = 0.0;
    if (std::isnan(result.parameters[0])) error = std::numeric_limits<double>::infinity();  // no contact
    for (std::size_t k = 0; k < pixel.truth.size(); ++k) {
      const double off = std::abs(result.parameters[k] - pixel.truth[k]);
      error = std::max(error, off / (k == 0 ? 1.0 : std::abs(pixel.truth[k])));
      standard_errors = std::max(standard_errors, off / result.std_errors[k]);
    }
    ++count[result.status][error <= exact ? 0 : 1];
    if (result.status != FitStatus::converged || error <= exact) return;
    if (!(standard_errors <= 2.0)) ++wrong;
    fmt::print("converged, but off by {:.2g} or {:.2g} standard errors; reduced chi^2 {:.2g}\n", error,
               standard_errors, result.chi2_reduced);
  }
  int all_exact() const {
    int sum = 0;
    for (const auto& [status, pair] : count) sum += pair[0];
    return sum;
  }
};

#ifdef COMBFORCE_SLOW
constexpr int history_pixels = 200;
#else
constexpr int history_pixels = 2;
#endif

template <typename Model>
HistoryTally fit_all(const std::vector<std::uint64_t>& bins, std::uint64_t seed) {
  RandomPixels draw(seed);
  HistoryTally tally;
  for (int i = 0; i < history_pixels; ++i) {
    const Pixel pixel = draw_pixel<Model>(draw, bins);
    PixelFitter fitter(conditions_of<Model>(pixel, forces_of<Model>(pixel)));
    FitResult result;
    fitter.fit(pixel.tip_nm, result);
    tally.add(pixel, result);
  }
  for (const auto& [status, pair] : tally.count)
    fmt::print("status {}: {} pixels exact, {} not\n", static_cast<int>(status), pair[0], pair[1]);
  return tally;
}

TEST(HistoryPixels, JkrAtFourTonesGivesTheTruthOrSaysSo) {
  const HistoryTally tally = fit_all<Jkr>(four_tones, 90201);
  EXPECT_LE(tally.wrong, history_pixels / 200);  // one is known: it ends in another minimum, at a chi^2 of 67
  EXPECT_GE(tally.all_exact(), 9 * history_pixels / 10);
}

TEST(HistoryPixels, JkrAtTwoTonesGivesTheTruthOrSaysSo) {
  const HistoryTally tally = fit_all<Jkr>(two_tones, 90202);
  // Three parameters from four numbers: beyond jumps of E other minima may explain the pixel to a millionth
  // of the noise, and the search miss the truth.
  EXPECT_LE(tally.wrong, history_pixels / 100);  // two of 200 are known
  EXPECT_GE(tally.all_exact(), 8 * history_pixels / 10);
}

TEST(HistoryPixels, JkrAroundOneModeGivesTheTruthOrSaysSo) {
  const HistoryTally tally = fit_all<Jkr>(twelve_tones, 90206);
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.all_exact(), 9 * history_pixels / 10);
}

TEST(HistoryPixels, CapillaryAroundOneModeGivesTheTruthOrSaysSo) {
  const HistoryTally tally = fit_all<Capillary>(twelve_tones, 90207);
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.all_exact(), 7 * history_pixels / 10);
}

TEST(HistoryPixels, CapillaryAtFourTonesGivesTheTruthOrSaysSo) {
  const HistoryTally tally = fit_all<Capillary>(four_tones, 90205);
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.all_exact(), 7 * history_pixels / 10);
}

// Five parameters from four numbers.
TEST(HistoryPixels, CapillaryIsNotDeterminedByTwoTones) {
  RandomPixels draw(90208);
  const Pixel pixel = draw_pixel<Capillary>(draw, two_tones);
  PixelFitter fitter(conditions_of<Capillary>(pixel, forces_of<Capillary>(pixel)));
  FitResult result;
  fitter.fit(pixel.tip_nm, result);
  EXPECT_EQ(result.status, FitStatus::ill_conditioned);
}

#ifdef COMBFORCE_SLOW

// Thermal forces on the tones of one pixel, whose parameters are known to a few percent.
template <typename Model>
void scatter_is_the_claim(const Pixel& pixel) {
  const Phasors forces = forces_of<Model>(pixel);
  const FitConditions exact = conditions_of<Model>(pixel, forces);
  std::mt19937_64 random(90203);
  std::normal_distribution<double> normal;
  constexpr std::size_t count = Model::parameters;
  constexpr int draws = 200;
  std::vector<std::array<double, count>> found;
  std::array<double, count> claim{};
  std::map<FitStatus, int> statuses;
  for (int n = 0; n < draws; ++n) {
    Phasors noisy = forces;
    for (std::size_t i = 0; i < noisy.size(); ++i) {
      const double frequency_hz = static_cast<double>(pixel.bins[i]) * paper_delta_f_hz;
      const double sigma = std::sqrt(
          force_quadrature_variance(exact.cantilever, *exact.noise, i, frequency_hz, paper_delta_f_hz, 1));
      noisy[i] += std::complex<double>(sigma * normal(random), sigma * normal(random));
    }
    PixelFitter fitter(conditions_of<Model>(pixel, noisy));
    FitResult result;
    fitter.fit(pixel.tip_nm, result);
    ++statuses[result.status];
    std::array<double, count> p;
    std::copy_n(result.parameters.begin(), count, p.begin());
    found.push_back(p);
    for (std::size_t k = 0; k < count; ++k) claim[k] += result.std_errors[k] / draws;
  }
  for (const auto& [status, number] : statuses)
    fmt::print("status {}: {} pixels\n", static_cast<int>(status), number);
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double> deviations;
    for (const auto& p : found) deviations.push_back(std::abs(p[k] - pixel.truth[k]));
    std::ranges::nth_element(deviations, deviations.begin() + draws / 2);
    const double sigma = deviations[draws / 2] / 0.6745;
    fmt::print("p{}: scatter {:.3g}, claim {:.3g}\n", k, sigma, claim[k]);
    // The median of 200 deviations is known to 1/sqrt(200) * 0.5/(0.6745 * 2 * 0.318) = 8 %; 4 of these. The
    // jumps of E, of which the linear claim knows nothing, pin the surface: the scatter may be less than half
    // the claim.
    EXPECT_LE(sigma / claim[k], 1.33) << "p" << k;
    EXPECT_GE(sigma / claim[k], 0.25) << "p" << k;
  }
}

TEST(HistoryPixels, JkrScattersByNoMoreThanItsStandardErrors) {
  RandomPixels draw(90204);
  Pixel pixel = draw_pixel<Jkr>(draw, four_tones);
  pixel.truth = {-40.0, 1.0, 5.0};
  scatter_is_the_claim<Jkr>(pixel);
}

#endif

}  // namespace
}  // namespace combforce::test
