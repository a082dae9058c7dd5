// Phasors of model forces along the partial motion, and their derivatives, at every level of the quadrature,
// against the reference that shares nothing with it.
#include "fit/force_balance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/fit/random_pixel.hpp"
#include "tests/unit/fit/terms_of_balance.hpp"

namespace combforce {
namespace {

std::vector<std::uint64_t> bins_of(const FitConditions& conditions) {
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : conditions.comb.tones) bins.push_back(tone.bin);
  return bins;
}

template <typename Model>
void levels_approach_the_reference(const test::ModelPixel& pixel) {
  const std::vector<std::uint64_t> bins = bins_of(pixel.conditions);
  const Eigen::MatrixXd expected = test::reference_force<Model>(
      test::ReferenceMotion(bins, pixel.tip_nm, test::paper_delta_f_hz), pixel.truth);
  ForceBalance balance(bins, test::paper_delta_f_hz);
  balance.set_motion(pixel.tip_nm);
  std::vector<Eigen::MatrixXd> found;
  for (std::size_t level = 0; level < ForceBalance::levels; ++level) {
    balance.prepare(pixel.truth[0], level, !Model::tail_terms.empty());
    found.push_back(test::terms_of_balance<Model>(balance, pixel.truth));
  }
  // What the cells' polynomials leave: 5e-11 of 50 nm of motion, against lengths of 0.3 nm, and the far grid.
  constexpr double floor = 1e-6;
  for (Eigen::Index column = 0; column < expected.cols(); ++column) {
    const double norm = expected.col(column).norm();
    for (std::size_t level = 0; level < ForceBalance::levels; ++level) {
      const double error = (found[level].col(column) - expected.col(column)).norm() / norm;
      if (level + 1 < ForceBalance::levels) {
        const double estimate = (found[level + 1].col(column) - found[level].col(column)).norm() / norm;
        EXPECT_LE(error, 2.0 * estimate + floor) << "column " << column << ", level " << level;
      } else {
        EXPECT_LE(error, floor) << "column " << column << ", finest level";
      }
    }
    // The coarsest level is meant to be good to a thousandth: starts rely on it.
    EXPECT_LE((found[0].col(column) - expected.col(column)).norm() / norm, 2e-3) << "column " << column;
  }
}

TEST(ForceBalance, HertzPhasorsApproachTheReferenceAsTheEstimateSays) {
  test::RandomPixels draw(11);
  for (int i = 0; i < 20; ++i) {
    SCOPED_TRACE(i);
    levels_approach_the_reference<Hertz>(draw.hertz());
  }
}

TEST(ForceBalance, KelvinVoigtPhasorsApproachTheReferenceAsTheEstimateSays) {
  test::RandomPixels draw(14);
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    levels_approach_the_reference<KelvinVoigt>(draw.kelvin_voigt());
  }
}

TEST(ForceBalance, ExponentialPhasorsApproachTheReferenceAsTheEstimateSays) {
  test::RandomPixels draw(15);
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    levels_approach_the_reference<Exponential>(draw.exponential());
  }
}

TEST(ForceBalance, DmtPhasorsApproachTheReferenceAsTheEstimateSays) {
  test::RandomPixels draw(12);
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    levels_approach_the_reference<Dmt>(draw.dmt());
  }
}

// A surface that the motion does not reach, and one that it never leaves.
TEST(ForceBalance, HoldsWithoutContactAndWithoutRelease) {
  const std::vector<std::uint64_t> bins{3, 10};
  const test::Phasors tones{{20.0, 0.0}, {0.0, 4.0}};
  const test::ReferenceMotion motion(bins, tones);
  ForceBalance balance(bins);
  balance.set_motion(tones);
  for (const double p0 : {-24.5, -23.0, 0.0, 25.0, 40.0}) {
    const std::vector<double> p{p0, 1.0, 5.0, 0.5};
    balance.prepare(p0, ForceBalance::levels - 1, true);
    const Eigen::MatrixXd expected = test::reference_force<Dmt>(motion, p);
    const Eigen::MatrixXd found = test::terms_of_balance<Dmt>(balance, p);
    for (Eigen::Index column = 0; column < expected.cols(); ++column)
      EXPECT_LE((found.col(column) - expected.col(column)).norm(), 1e-6 * expected.col(column).norm() + 1e-9)
          << "p0 " << p0 << ", column " << column;
  }
}

// What was prepared for one surface position serves others nearby: up to the ceiling.
TEST(ForceBalance, OnePreparationServesSurfacesUpToItsCeiling) {
  test::RandomPixels draw(13);
  const test::ModelPixel pixel = draw.dmt();
  const std::vector<std::uint64_t> bins = bins_of(pixel.conditions);
  ForceBalance prepared(bins), anew(bins);
  prepared.set_motion(pixel.tip_nm);
  anew.set_motion(pixel.tip_nm);
  prepared.prepare(pixel.truth[0], ForceBalance::levels - 1, true);
  for (const double p0 : {pixel.truth[0] - 3.0, pixel.truth[0] + 1.0, prepared.ceiling_nm()}) {
    std::vector<double> p = pixel.truth;
    p[0] = p0;
    anew.reset();
    anew.prepare(p0, ForceBalance::levels - 1, true);
    const Eigen::MatrixXd one = test::terms_of_balance<Dmt>(prepared, p),
                          other = test::terms_of_balance<Dmt>(anew, p);
    for (Eigen::Index column = 0; column < one.cols(); ++column)
      EXPECT_LE((one.col(column) - other.col(column)).norm(), 2e-6 * other.col(column).norm())
          << "p0 " << p0 << ", column " << column;
  }
}

}  // namespace
}  // namespace combforce
