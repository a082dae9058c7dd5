// Standard errors, correlations, chi^2 and weighting of the fit against draws of noise on the measured forces
// and against generalised least squares with the reference's Jacobian.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "tests/unit/fit/random_pixel.hpp"

namespace combforce::test {
namespace {

// About the paper's equal-energy pixels: every parameter is determined to 15 % or better in one window.
ModelPixel hertz_pixel() {
  return pixel_of<Hertz>({234, 1348}, {{17.05, -31.58}, {1.95, -8.78}}, {-40.0, 1.0});
}
ModelPixel dmt_pixel() {
  return pixel_of<Dmt>({234, 1348, 3516, 6470},
                       {{3.78, -35.82}, {0.573, -8.106}, {0.2204, -3.7627}, {0.0356, -1.9773}},
                       {-40.0, 1.0, 5.0, 0.5});
}

// Forces of the truth, their Jacobian, and variances from the noise model.
struct Reference {
  Eigen::VectorXd forces, variances;
  Eigen::MatrixXd jacobian;
};

template <typename Model>
Reference reference_of(const ModelPixel& pixel) {
  const FitConditions& conditions = pixel.conditions;
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : conditions.comb.tones) bins.push_back(tone.bin);
  const Eigen::MatrixXd sum = reference_force<Model>(ReferenceMotion(bins, pixel.tip_nm), pixel.truth);
  Reference reference{sum.col(0), Eigen::VectorXd(sum.rows()), sum.rightCols<Model::parameters>()};
  for (Eigen::Index row = 0; row < sum.rows(); ++row) {
    const auto tone = static_cast<std::size_t>(row / 2);
    reference.variances(row) = force_quadrature_variance(conditions.cantilever, *conditions.noise, tone,
                                                         static_cast<double>(bins[tone]) * paper_delta_f_hz,
                                                         paper_delta_f_hz, conditions.windows);
  }
  return reference;
}

// The pixel with these forces measured instead, on the same motion.
FitResult fit_with_forces(const ModelPixel& pixel, const Eigen::VectorXd& rows) {
  Phasors forces;
  for (Eigen::Index row = 0; row < rows.size(); row += 2) forces.emplace_back(rows(row), rows(row + 1));
  FitConditions conditions = pixel.conditions;
  conditions.free_response->mean_nm = free_response_of(conditions, pixel.tip_nm, forces);
  PixelFitter fitter(conditions);
  FitResult result;
  fitter.fit(pixel.tip_nm, result);
  return result;
}

Eigen::VectorXd parameters_of(const FitResult& result) {
  return Eigen::Map<const Eigen::VectorXd>(result.parameters.data(),
                                           static_cast<Eigen::Index>(result.parameters_count));
}

// Least squares with weights w: dp = (J'WJ)^-1 J'W dF.
Eigen::MatrixXd gain(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& weights) {
  const Eigen::MatrixXd weighted = jacobian.transpose() * weights.asDiagonal();
  return (weighted * jacobian).ldlt().solve(weighted);
}

Eigen::VectorXd weights_of(const ModelPixel& pixel, const Reference& reference) {
  if (pixel.conditions.settings.weighting == Weighting::none)
    return Eigen::VectorXd::Ones(reference.forces.size());
  return reference.variances.cwiseInverse();
}

template <typename Model>
void small_changes_move_the_fit_as_least_squares_does(ModelPixel pixel) {
  // Detector noise that differs between tones by more than thermal noise does.
  pixel.conditions.noise->detector_nm_per_sqrt_hz.assign(pixel.tip_nm.size(), 0.0);
  pixel.conditions.noise->detector_nm_per_sqrt_hz[0] = 1e-3;
  const Reference reference = reference_of<Model>(pixel);
  std::mt19937_64 engine(41);
  std::normal_distribution<double> normal;
  Eigen::VectorXd change(reference.forces.size());
  // 1 % of a standard error: the fit is linear over it to a few times 1 %.
  for (Eigen::Index row = 0; row < change.size(); ++row)
    change(row) = 1e-2 * std::sqrt(reference.variances(row)) * normal(engine);
  const Eigen::VectorXd truth =
      Eigen::Map<const Eigen::VectorXd>(pixel.truth.data(), static_cast<Eigen::Index>(pixel.truth.size()));
  std::vector<Eigen::VectorXd> moves;
  for (const Weighting weighting : {Weighting::none, Weighting::noise}) {
    pixel.conditions.settings.weighting = weighting;
    const Eigen::VectorXd expected = gain(reference.jacobian, weights_of(pixel, reference)) * change;
    const FitResult result = fit_with_forces(pixel, reference.forces + change);
    const Eigen::VectorXd move = parameters_of(result) - truth;
    for (Eigen::Index k = 0; k < move.size(); ++k)
      EXPECT_NEAR(move(k), expected(k),
                  0.03 * std::abs(expected(k)) + 5e-4 * result.std_errors[static_cast<std::size_t>(k)])
          << "p" << k << (weighting == Weighting::none ? " unweighted" : " weighted");
    moves.push_back(expected);
  }
  EXPECT_GT((moves[0] - moves[1]).norm(), 0.05 * moves[0].norm()) << "weighting must matter here";
}

TEST(Weighting, HertzMovesAsLeastSquaresPredicts) {
  // A conservative force leaves one quadrature a tone that tells: two tones determine two parameters whatever
  // the weights, four overdetermine them.
  small_changes_move_the_fit_as_least_squares_does<Hertz>(pixel_of<Hertz>(
      {234, 1348, 3516, 6470}, {{8.0, -34.9}, {1.2, -8.0}, {0.45, -3.74}, {0.07, -1.97}}, {-40.0, 1.0}));
}

TEST(Weighting, DmtMovesAsLeastSquaresPredicts) {
  small_changes_move_the_fit_as_least_squares_does<Dmt>(dmt_pixel());
}

// cov = G S G', G the gain of the weights that were used (the sandwich formula).
template <typename Model>
void errors_are_those_of_the_sandwich_formula(ModelPixel pixel) {
  for (const Weighting weighting : {Weighting::none, Weighting::noise}) {
    pixel.conditions.settings.weighting = weighting;
    const Reference reference = reference_of<Model>(pixel);
    const Eigen::MatrixXd g = gain(reference.jacobian, weights_of(pixel, reference));
    const Eigen::MatrixXd covariance = g * reference.variances.asDiagonal() * g.transpose();
    const FitResult result = fit_with_forces(pixel, reference.forces);
    std::size_t pair = 0;
    for (Eigen::Index k = 0; k < covariance.rows(); ++k) {
      const double sigma = std::sqrt(covariance(k, k));
      // The Jacobian of a quadrature that aims at 5e-5 of the parameters.
      EXPECT_NEAR(result.std_errors[static_cast<std::size_t>(k)], sigma, 2e-3 * sigma) << "p" << k;
      for (Eigen::Index l = k + 1; l < covariance.rows(); ++l, ++pair)
        EXPECT_NEAR(result.correlation[pair], covariance(k, l) / (sigma * std::sqrt(covariance(l, l))), 2e-3)
            << "p" << k << ", p" << l;
    }
  }
}

TEST(Uncertainty, HertzErrorsAreThoseOfTheSandwichFormula) {
  errors_are_those_of_the_sandwich_formula<Hertz>(hertz_pixel());
}

TEST(Uncertainty, DmtErrorsAreThoseOfTheSandwichFormula) {
  errors_are_those_of_the_sandwich_formula<Dmt>(dmt_pixel());
}

TEST(Uncertainty, WindowsAveragedDivideTheVariance) {
  ModelPixel pixel = dmt_pixel();
  const Eigen::VectorXd forces = reference_of<Dmt>(pixel).forces;
  const FitResult one = fit_with_forces(pixel, forces);
  pixel.conditions.windows = 16;
  const FitResult many = fit_with_forces(pixel, forces);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(many.std_errors[k], one.std_errors[k] / 4.0, 1e-4 * one.std_errors[k]) << "p" << k;
    EXPECT_NEAR(many.parameters[k], one.parameters[k], 1e-5 * std::abs(one.parameters[k])) << "p" << k;
  }
}

TEST(Uncertainty, WithoutANoiseModelNothingIsClaimed) {
  ModelPixel pixel = hertz_pixel();
  for (const auto& noise : {std::optional<Noise>{}, std::optional(Noise{0.0, {0.0}})}) {
    pixel.conditions.noise = noise;
    PixelFitter fitter(pixel.conditions);
    FitResult result;
    fitter.fit(pixel.tip_nm, result);
    EXPECT_EQ(result.status, FitStatus::converged);
    EXPECT_TRUE(std::isnan(result.std_errors[0]));
    EXPECT_TRUE(std::isnan(result.correlation[0]));
    EXPECT_TRUE(std::isnan(result.chi2_reduced));
  }
}

TEST(Uncertainty, MoreThanThirtyPercentIsIllConditioned) {
  ModelPixel pixel = hertz_pixel();
  const Eigen::VectorXd forces = reference_of<Hertz>(pixel).forces;
  const double relative = fit_with_forces(pixel, forces).std_errors[1] / pixel.truth[1];
  for (const double aim : {0.29, 0.31}) {
    // Variances are proportional to the temperature.
    pixel.conditions.noise->temperature_k = 300.0 * std::pow(aim / relative, 2.0);
    EXPECT_EQ(fit_with_forces(pixel, forces).status,
              aim < 0.3 ? FitStatus::converged : FitStatus::ill_conditioned);
  }
}

// Draws of the stated noise on the forces. `windows` makes it small enough for the fit to be linear over it.
template <typename Model>
void scatter_is_what_the_fit_states(ModelPixel pixel, unsigned windows, int draws) {
  pixel.conditions.windows = windows;
  pixel.conditions.settings.weighting = Weighting::noise;
  const Reference reference = reference_of<Model>(pixel);
  constexpr auto count = static_cast<Eigen::Index>(Model::parameters);
  std::mt19937_64 engine(43);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd found(draws, count), stated(draws, count);
  double chi2 = 0.0;
  Eigen::VectorXd correlation = Eigen::VectorXd::Zero(count * (count - 1) / 2);
  for (int i = 0; i < draws; ++i) {
    Eigen::VectorXd forces = reference.forces;
    for (Eigen::Index row = 0; row < forces.size(); ++row)
      forces(row) += std::sqrt(reference.variances(row)) * normal(engine);
    const FitResult result = fit_with_forces(pixel, forces);
    ASSERT_EQ(result.status, FitStatus::converged) << i;
    found.row(i) = parameters_of(result);
    for (Eigen::Index k = 0; k < count; ++k) stated(i, k) = result.std_errors[static_cast<std::size_t>(k)];
    for (Eigen::Index pair = 0; pair < correlation.size(); ++pair)
      correlation(pair) += result.correlation[static_cast<std::size_t>(pair)] / draws;
    chi2 += result.chi2_reduced / draws;
  }
  const Eigen::MatrixXd centred = found.rowwise() - found.colwise().mean();
  const Eigen::MatrixXd covariance = centred.transpose() * centred / (draws - 1);
  Eigen::Index pair = 0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double scatter = std::sqrt(covariance(k, k)), claim = stated.col(k).mean();
    // A standard deviation of n draws is known to 1/sqrt(2n); four of that, and 2 % for what is not linear.
    EXPECT_NEAR(scatter, claim, (4.0 / std::sqrt(2.0 * draws) + 0.02) * claim) << "p" << k;
    const double bias = found.col(k).mean() - pixel.truth[static_cast<std::size_t>(k)];
    EXPECT_LT(std::abs(bias), (4.0 / std::sqrt(draws) + 0.05) * claim) << "p" << k;
    for (Eigen::Index l = k + 1; l < count; ++l, ++pair) {
      const double seen = covariance(k, l) / std::sqrt(covariance(k, k) * covariance(l, l));
      EXPECT_NEAR(seen, correlation(pair), 4.0 * (1.0 - seen * seen) / std::sqrt(draws) + 0.01)
          << "p" << k << ", p" << l;
    }
  }
  const auto degrees = static_cast<double>(reference.forces.size() - count);
  EXPECT_NEAR(chi2, 1.0, 4.0 * std::sqrt(2.0 / (degrees * draws)) + 0.01);
}

TEST(UncertaintyStatistics, HertzScatterIsWhatTheFitStates) {
  scatter_is_what_the_fit_states<Hertz>(hertz_pixel(), 4, 1000);
}

TEST(UncertaintyStatistics, DmtScatterIsWhatTheFitStates) {
  scatter_is_what_the_fit_states<Dmt>(dmt_pixel(), 25, 400);
}

}  // namespace
}  // namespace combforce::test
