#include "fit/thermal_beam.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <numbers>

namespace combforce {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;
using ::testing::HasSubstr;

// Oracle: the plate's flow solved as a boundary integral (Tuck 1969). Point forces of density f along the
// plate, |x| <= 1, make its velocity uniform: int f(y) A(lambda |x - y|) dy = 2 pi, with the transverse
// unsteady Stokeslet A(s) = K0(s) + K1(s)/s - 1/s^2 and lambda^2 = -i Re; then Gamma = i int f/(pi Re).

// A(s) = log_part(s) ln(s/2) + smooth_part(s), by the ascending series of K0 and K1 (DLMF 10.31.1): good for
// |s| < 8 in double precision.
struct Stokeslet {
  Complex log_part, smooth_part;
};
Stokeslet stokeslet(Complex s) {
  const Complex quarter = 0.25 * s * s;
  Stokeslet sum{0.0, 0.0};
  Complex term = 1.0;                      // (s^2/4)^k/k!^2
  double digamma = -std::numbers::egamma;  // psi(k + 1)
  for (int k = 0; k < 60; ++k) {
    const double next = digamma + 1.0 / (k + 1.0);  // psi(k + 2)
    sum.log_part += term * (-1.0 + 0.5 / (k + 1.0));
    sum.smooth_part += term * (digamma - 0.25 * (digamma + next) / (k + 1.0));
    term *= quarter / ((k + 1.0) * (k + 1.0));
    digamma = next;
  }
  return sum;
}

// f(cos t) sin t is smooth: nodes at the zeros of a Chebyshev polynomial, the logarithm by its series
// ln|cos t - cos u| = -ln 2 - 2 sum_m cos(mt) cos(mu)/m.
Complex plate_hydrodynamic_function(double reynolds) {
  constexpr int nodes = 40;
  const Complex lambda = std::polar(std::sqrt(reynolds), -0.25 * pi);
  Eigen::MatrixXcd matrix(nodes, nodes);
  for (int i = 0; i < nodes; ++i)
    for (int j = 0; j < nodes; ++j) {
      const double t = (i + 0.5) * pi / nodes, u = (j + 0.5) * pi / nodes;
      double logarithm = -std::numbers::ln2;
      for (int m = 1; m < nodes; ++m) logarithm -= 2.0 * std::cos(m * t) * std::cos(m * u) / m;
      const Stokeslet at = stokeslet(lambda * std::abs(std::cos(t) - std::cos(u)));
      matrix(i, j) =
          (at.log_part * (logarithm + std::log(0.5 * lambda)) + at.smooth_part) * pi / double{nodes};
    }
  const Eigen::VectorXcd force = matrix.partialPivLu().solve(Eigen::VectorXcd::Constant(nodes, 2.0 * pi));
  return Complex(0.0, 1.0) * force.sum() * (pi / nodes) / (pi * reynolds);
}

TEST(HydrodynamicFunction, IsThatOfAPlateSolvedAsABoundaryIntegral) {
  for (const double reynolds : {1e-4, 1e-2, 0.3, 1.0, 3.0, 12.0}) {
    const Complex fitted = hydrodynamic_function(reynolds);
    const Complex solved = plate_hydrodynamic_function(reynolds);
    // What Sader states of the correction: 0.1 %.
    EXPECT_NEAR(fitted.real() / solved.real(), 1.0, 1e-3) << reynolds;
    EXPECT_NEAR(fitted.imag() / solved.imag(), 1.0, 1e-3) << reynolds;
  }
}

// Boundary layers of no thickness: added mass alone, drag by Stokes's layer falling as 1/sqrt(Re), to order
// 1/sqrt(Re) itself.
TEST(HydrodynamicFunction, TendsToThatOfAnIdealFluid) {
  EXPECT_NEAR(hydrodynamic_function(1e4).real(), 1.0, 0.05);
  EXPECT_LT(hydrodynamic_function(1e4).imag(), 0.05);
  EXPECT_NEAR(hydrodynamic_function(1e4).imag() / hydrodynamic_function(1e3).imag(), std::sqrt(0.1),
              2.0 / std::sqrt(1e3));
}

TEST(HydrodynamicFunction, SaysWhereItHolds) {
  for (const double reynolds : {0.0, -1.0, 0.9e-6, 1.1e4, std::nan("")}) {
    try {
      hydrodynamic_function(reynolds);
      FAIL() << reynolds;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr("Reynolds number"));
      EXPECT_THAT(error.what(), HasSubstr("[1e-06, 10000]"));
    }
  }
}

const BeamInFluid in_air{200.0, 40.0, 1.18, 1.86e-5};

TEST(SaderStiffness, IsTheModesNotTheStaticOne) {
  const double f = 50e3, quality = 150.0, w = 2.0 * pi * f;
  const double drag = hydrodynamic_function(1.18 * w * 1.6e-9 / (4.0 * 1.86e-5)).imag();
  const double statical = 0.1906 * 1.18 * 1.6e-9 * 200e-6 * quality * w * w * drag;
  // 0.1906 has four digits.
  EXPECT_NEAR(sader_stiffness(in_air, f, quality).stiffness_n_per_m, 1.0302 * statical, 5e-4 * statical);
}

TEST(SaderStiffness, KnowsHowItMovesWithFrequency) {
  const double h = 1e-3;
  const auto log_k = [](double f) { return std::log(sader_stiffness(in_air, f, 100.0).stiffness_n_per_m); };
  EXPECT_NEAR(sader_stiffness(in_air, 5e4, 100.0).log_by_log_frequency,
              (log_k(5e4 * std::exp(h)) - log_k(5e4 * std::exp(-h))) / (2.0 * h), 5e-3);
}

TEST(SaderStiffness, RefusesBadDimensions) {
  for (BeamInFluid bad : {BeamInFluid{0.0, 40.0, 1.2, 1.8e-5},
                          {200.0, -1.0, 1.2, 1.8e-5},
                          {200.0, 40.0, std::nan(""), 1.8e-5},
                          {200.0, 40.0, 1.2, 0.0}})
    EXPECT_THROW(sader_stiffness(bad, 5e4, 100.0), std::invalid_argument);
}

// Known: roots 1.8751, 4.6941, 7.8548; k_2/k_1 39.31, k_3/k_1 307.9 (39.3 and 308 in Melcher et al. 2007);
// 1.0897 between the first mode's sensitivity and the static one (Butt and Jaschke 1995: 0.817 =
// 0.971/1.09^2).
TEST(Beam, HasTheKnownRatios) {
  EXPECT_NEAR(beam_eigenvalue(1), 1.87510407, 1e-8);
  EXPECT_NEAR(beam_eigenvalue(2), 4.69409113, 1e-8);
  EXPECT_NEAR(beam_eigenvalue(3), 7.85475744, 1e-8);
  EXPECT_NEAR(beam_stiffness_ratio(2), 39.275, 0.005);
  EXPECT_NEAR(beam_stiffness_ratio(3), 307.91, 0.02);
  EXPECT_NEAR(1.5 / beam_end_slope(1), 1.0897, 1e-4);
  EXPECT_NEAR(12.0 / std::pow(beam_eigenvalue(1), 4) / std::pow(1.5 / beam_end_slope(1), 2), 0.817, 5e-4);
  EXPECT_THROW(beam_eigenvalue(0), std::invalid_argument);
}

// The slope from the mode's shape itself.
TEST(Beam, SlopeIsThatOfTheModesShape) {
  for (unsigned mode = 1; mode <= 5; ++mode) {
    const double c = beam_eigenvalue(mode);
    const double ratio = (std::cosh(c) + std::cos(c)) / (std::sinh(c) + std::sin(c));
    const auto shape = [&](double x) {
      return std::cosh(c * x) - std::cos(c * x) - ratio * (std::sinh(c * x) - std::sin(c * x));
    };
    const double h = 1e-4;
    // Backward difference of second order; cosh and sinh cancel to exp(-c) of themselves.
    const double slope = (3.0 * shape(1.0) - 4.0 * shape(1.0 - h) + shape(1.0 - 2.0 * h)) / (2.0 * h);
    EXPECT_NEAR(beam_end_slope(mode), slope / shape(1.0), 1e-4 * c) << mode;
  }
}

}  // namespace
}  // namespace combforce
