// The covariance of the measured forces: thermal noise in the window and at its ends, and how the model's
// forces follow the motion.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "fit/hertz.hpp"
#include "fit/measured_force.hpp"
#include "fit/self_consistent.hpp"
#include "fit/units.hpp"
#include "tests/unit/fit/paper_cantilever.hpp"

namespace combforce::test {
namespace {

using Complex = std::complex<double>;

// Peak phasor over [0, T], at w, of a mode that decays freely from position q and velocity v: the exact
// integral of exp((-w_m/2Q +- i w_d) t).
Complex phasor_of_decay(const Mode& mode, double q, double v, double w, double t_end, double& q_end,
                        double& v_end) {
  const double w_mode = 2.0 * std::numbers::pi * mode.frequency_hz;
  const double rate = w_mode / (2.0 * mode.quality_factor);
  const double turning = std::sqrt(w_mode * w_mode - rate * rate);
  // q(t) = Re[a exp(s t)], s = -rate + i turning.
  const Complex s(-rate, turning), a(q, -(v + rate * q) / turning);
  const Complex end = a * std::exp(s * t_end);
  q_end = end.real();
  v_end = (s * end).real();
  const auto integral = [&](Complex amplitude, Complex exponent) {
    return amplitude * (std::exp(exponent * t_end) - 1.0) / exponent;
  };
  const Complex at_minus_w(0.0, -w);
  return (integral(a, s + at_minus_w) + integral(std::conj(a), std::conj(s) + at_minus_w)) / t_end;
}

// Nothing acts on a mode that decays freely: what chi^-1 makes of its phasors is the window's end alone. Two
// decays give the forces of a unit dq and of a unit dv.
TEST(ThermalForceCovariance, WindowEndIsTheForceThatAFreeDecaySeemsToFeel) {
  const Cantilever cantilever{{{117e3, 212.0, 4.0, 1.0}}};
  const Mode& mode = cantilever.modes[0];
  const std::vector<double> frequencies_hz{115e3, 116.5e3, 117e3, 119e3};
  const double window_s = 2e-3, temperature_k = 300.0, w_mode = 2.0 * std::numbers::pi * mode.frequency_hz;
  Eigen::MatrixXd forces(8, 2);
  Eigen::Matrix2d changes;
  for (Eigen::Index decay = 0; decay < 2; ++decay)
    for (std::size_t i = 0; i < 4; ++i) {
      const double q = decay == 0 ? 1.0 : 0.0, v = decay == 0 ? 0.0 : w_mode;
      double q_end = 0.0, v_end = 0.0;
      const Complex force =
          phasor_of_decay(mode, q, v, 2.0 * std::numbers::pi * frequencies_hz[i], window_s, q_end, v_end) /
          tip_response(cantilever, frequencies_hz[i]);
      forces(static_cast<Eigen::Index>(2 * i), decay) = force.real();
      forces(static_cast<Eigen::Index>(2 * i + 1), decay) = force.imag();
      changes(0, decay) = q_end - q;
      changes(1, decay) = (v_end - v) / w_mode;
    }
  const double nm = 2.0 * std::sqrt(2.0 * boltzmann_nn_nm_per_k * temperature_k / mode.stiffness_n_per_m);
  const Eigen::MatrixXd of_unit = nm * forces * changes.inverse();
  Eigen::MatrixXd expected = of_unit * of_unit.transpose();
  for (Eigen::Index i = 0; i < 8; ++i)
    expected(i, i) += thermal_force_density(mode, temperature_k) / window_s;
  const Eigen::MatrixXd covariance =
      thermal_force_covariance(cantilever, frequencies_hz, temperature_k, 1.0 / window_s, 1);
  EXPECT_LT((covariance - expected).norm(), 1e-9 * expected.norm());
  // Contiguous windows are one longer window: the ends' share falls as its square, the rest as its length.
  const Eigen::MatrixXd longer =
      thermal_force_covariance(cantilever, frequencies_hz, temperature_k, 1.0 / window_s, 4);
  EXPECT_NEAR(longer(0, 4), covariance(0, 4) / 16.0, 1e-9 * covariance(0, 4));
}

TEST(ThermalForceCovariance, IsDiagonalWithOneToneAMode) {
  const std::vector<double> frequencies_hz{117e3, 674e3, 1758e3, 3235e3};
  const Eigen::MatrixXd covariance =
      thermal_force_covariance(paper_cantilever(), frequencies_hz, 300.0, 500.0, 1);
  for (Eigen::Index i = 0; i < 8; ++i) {
    const double variance =
        500.0 * tip_force_density(paper_cantilever(), frequencies_hz[static_cast<std::size_t>(i / 2)], 300.0);
    EXPECT_NEAR(covariance.row(i).norm(), variance, 1e-12 * variance) << i;
    EXPECT_DOUBLE_EQ(covariance(i, i), variance) << i;
  }
}

class HertzBalance {
 public:
  HertzBalance()
      : conditions_(paper_conditions("hertz", bins_, Phasors(4))),
        harmonics_(conditions_.comb, conditions_.cantilever, paper_delta_f_hz),
        balance_(harmonics_),
        fit_(balance_) {
    balance_.set_whitening(Eigen::MatrixXd::Identity(8, 8));
    // Held at these parameters, the fit finds the motion alone.
    const std::vector<Bounds> bounds{{-40.0 - 1e-9, -40.0 + 1e-9}, {1.0 - 1e-9, 1.0 + 1e-9}};
    balance_.set_bounds(bounds);
  }

  // F_model at the tones, the motion off the comb in equilibrium.
  Eigen::VectorXd forces(const Phasors& tip_nm) {
    balance_.set_measured(tip_nm, Phasors(4));
    fit_.solve({-40.0, 1.0}, 1, 20);
    return fit_.residuals();
  }
  Eigen::MatrixXd stiffness() {
    Eigen::MatrixXd derivative(8, 8);
    fit_.stiffness_at_tones(derivative);
    return derivative;
  }

 private:
  std::vector<std::uint64_t> bins_{232, 234, 236, 1348};
  FitConditions conditions_;
  Harmonics harmonics_;
  HarmonicBalance<Hertz> balance_;
  SelfConsistentFit<Hertz> fit_;
};

TEST(StiffnessAtTones, IsTheDerivativeOfTheModelsForces) {
  HertzBalance balance;
  const Phasors tip_nm{{0.3, -0.2}, {2.0, -36.0}, {-0.1, 0.4}, {1.0, -8.5}};
  balance.forces(tip_nm);
  const Eigen::MatrixXd stiffness = balance.stiffness();
  const double step_nm = 1e-3;
  Eigen::MatrixXd expected(8, 8);
  for (std::size_t column = 0; column < 8; ++column) {
    Phasors up = tip_nm, down = tip_nm;
    const Complex step = column % 2 == 0 ? Complex(step_nm, 0.0) : Complex(0.0, step_nm);
    up[column / 2] += step;
    down[column / 2] -= step;
    expected.col(static_cast<Eigen::Index>(column)) =
        (balance.forces(up) - balance.forces(down)) / (2.0 * step_nm);
  }
  // Weakly coupled harmonics do not follow, and derivatives are good to 1e-3.
  EXPECT_LT((stiffness - expected).norm(), 2e-2 * expected.norm());
}

// By its definition, with dense products: a motion seen of the tip pulls at it by the model, and by chi^-1.
TEST(MeasuredForce, CovarianceOverASurfaceTakesMotionThroughBothForces) {
  FitConditions conditions = paper_conditions("hertz", {232, 234}, Phasors(2));
  conditions.noise = Noise{300.0, {2e-3, 1e-3}};
  const MeasuredForce measured(conditions);
  Eigen::MatrixXd stiffness(4, 4), root(4, 4), covariance(4, 4);
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (double& value : stiffness.reshaped()) value = normal(random);
  for (double& value : root.reshaped()) value = 0.1 * normal(random);
  const Eigen::MatrixXd heat = root * root.transpose();
  measured.covariance_at(stiffness, heat, covariance);
  Eigen::MatrixXd seen = heat, gain = stiffness;
  seen.diagonal() += paper_delta_f_hz * Eigen::Vector4d(4e-6, 4e-6, 1e-6, 1e-6);
  for (Eigen::Index tone = 0; tone < 2; ++tone) {
    const Complex inverse =
        1.0 / tip_response(conditions.cantilever, paper_delta_f_hz * (tone == 0 ? 232.0 : 234.0));
    gain.block<2, 2>(2 * tone, 2 * tone) -=
        (Eigen::Matrix2d() << inverse.real(), -inverse.imag(), inverse.imag(), inverse.real()).finished();
  }
  const Eigen::MatrixXd expected = gain * seen * gain.transpose();
  EXPECT_LT((covariance - expected).norm(), 1e-12 * expected.norm());
}

}  // namespace
}  // namespace combforce::test
