// The paper's fit of a polynomial: linear least squares without start or search. What the tones do not tell
// is NaN.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "fit/box_least_squares.hpp"
#include "fit/fit_result.hpp"
#include "fit/fitter.hpp"
#include "fit/force_model.hpp"
#include "fit/measured_force.hpp"
#include "fit/motion.hpp"
#include "fit/quadrature.hpp"
#include "fit/uncertainty.hpp"
#include "fit/whitening.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <IsPolynomial Model>
class LinearFitter : public Fitter {
 public:
  explicit LinearFitter(const FitterSetup& setup)
      : motion_(&setup.balance.motion()),
        rule_(gauss_legendre(nodes)),
        phasors_(index(setup.tones), index(count)),
        jacobian_(index(2 * setup.tones), index(count)),
        residuals_(index(2 * setup.tones)) {
    std::ranges::copy(setup.bounds, bounds_.begin());
  }

  // `start` is not used: the minimum is one.
  void fit(const MeasuredForce& measured, std::span<const std::complex<double>> /*tones*/,
           std::span<const double> weights, const Whitening& whitening, std::span<const double> /*start*/,
           FitResult& result) override {
    set_jacobian();
    result = unfitted(FitStatus::ill_conditioned, count);
    result.virial_nn_nm = measured.virial_nn_nm();
    result.dissipated_fw = measured.dissipated_fw();
    result.iterations = 1;
    if (!determined(measured, weights)) return;
    const Solution solution = solve(measured, weights);
    const std::span<const double> p(solution.x.data(), count);
    set_residuals(measured, p);
    Linearization at{jacobian_, weights, {}};
    for (std::size_t k = 0; k < count; ++k) at.fixed[k] = solution.holds[k] != Hold::free;
    estimate_uncertainty(at, measured.covariance(), chi2(whitening), measured.noise_known(), result);
    for (std::size_t k = 0; k < count; ++k)
      if (felt_[k]) {
        result.parameters[k] = p[k];
        result.quadrature_errors[k] = 0.0;  // exact but for rounding
      }
    result.status = status(at.fixed, result);
  }

  double error(const MeasuredForce& measured, std::span<const double> weights,
               std::span<const double> parameters) override {
    set_jacobian();
    set_residuals(measured, parameters);
    double sum = 0.0;
    for (Eigen::Index row = 0; row < residuals_.size(); ++row)
      sum += weights[static_cast<std::size_t>(row / 2)] * residuals_(row) * residuals_(row);
    return sum;
  }

 private:
  static constexpr std::size_t count = Model::parameters;
  using Solution = BoxSolution<count>;

  // A cell turns the fastest tone by pi/2, d^5 by 5 times that: 16 nodes integrate that and the ninth power
  // of time beside it to rounding.
  static constexpr std::size_t nodes = 16;
  // Of a power at the turning point. A cell's motion is exact to 5e-11 (motion.hpp); a tone of 1e-6 of the
  // motion makes more.
  static constexpr double unfelt = 1e-8;
  static constexpr double ill_conditioned_error = 0.3;  // relative standard error

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  // Phasors of the powers of d along the motion; 0 for those that the tones do not feel.
  void set_jacobian() {
    phasors_.setZero();
    for (std::size_t cell = 0; cell < motion_->cells(); ++cell) {
      std::array<Motion::Moments, count> moments{};
      for (std::size_t j = 0; j < nodes; ++j) {
        const double s = 2.0 * rule_.nodes[j] - 1.0;
        const std::array<double, count> powers = Model::powers(value_at(motion_->polynomial(cell), s));
        double weight = 2.0 * rule_.weights[j];
        for (std::size_t m = 0; m < Motion::order; ++m, weight *= s)
          for (std::size_t k = 0; k < count; ++k) moments[k][m] += weight * powers[k];
      }
      motion_->add_moments(cell, moments, phasors_.data());
    }
    const auto greatest = Model::powers(std::max(-motion_->lowest_nm(), motion_->highest_nm()));
    for (std::size_t k = 0; k < count; ++k) {
      felt_[k] = phasors_.col(index(k)).cwiseAbs().maxCoeff() > unfelt * greatest[k];
      if (!felt_[k]) phasors_.col(index(k)).setZero();
    }
    for (Eigen::Index row = 0; row < jacobian_.rows(); ++row)
      for (Eigen::Index k = 0; k < jacobian_.cols(); ++k) jacobian_(row, k) = part(phasors_(row / 2, k), row);
  }

  // Whether the tones tell all powers apart that they feel. Bounds are no measurement: they are not asked.
  bool determined(const MeasuredForce& measured, std::span<const double> weights) const {
    Linearization at{jacobian_, weights, {}};
    for (std::size_t k = 0; k < count; ++k) at.fixed[k] = !felt_[k];
    FitResult unused;
    return estimate_uncertainty(at, measured.covariance(), 0.0, false, unused);
  }

  // Powers that the tones do not feel are held at a bound, and make no difference.
  Solution solve(const MeasuredForce& measured, std::span<const double> weights) const {
    Eigen::Matrix<double, count, count> normal = Eigen::Matrix<double, count, count>::Zero();
    Eigen::Matrix<double, count, 1> right = Eigen::Matrix<double, count, 1>::Zero();
    for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
      const auto tone = static_cast<std::size_t>(row / 2);
      for (Eigen::Index k = 0; k < jacobian_.cols(); ++k) {
        const double weighted = weights[tone] * jacobian_(row, k);
        right(k) += weighted * part(measured.phasors()[tone], row);
        for (Eigen::Index l = 0; l < jacobian_.cols(); ++l) normal(k, l) += weighted * jacobian_(row, l);
      }
    }
    return solve_box<count>(normal, right, bounds_);
  }

  void set_residuals(const MeasuredForce& measured, std::span<const double> p) {
    for (Eigen::Index row = 0; row < residuals_.size(); ++row) {
      residuals_(row) = -part(measured.phasors()[static_cast<std::size_t>(row / 2)], row);
      for (Eigen::Index k = 0; k < jacobian_.cols(); ++k)
        residuals_(row) += p[static_cast<std::size_t>(k)] * jacobian_(row, k);
    }
  }

  // NaN without a noise model.
  double chi2(const Whitening& whitening) {
    if (!whitening.by_noise) return std::numeric_limits<double>::quiet_NaN();
    whitening.root.template triangularView<Eigen::Lower>().solveInPlace(residuals_);
    return residuals_.squaredNorm();
  }

  FitStatus status(const std::array<bool, max_parameters>& fixed, const FitResult& result) const {
    for (std::size_t k = 0; k < count; ++k)
      if (felt_[k] && fixed[k]) return FitStatus::at_bound;
    if (std::ranges::find(felt_, false) != felt_.end()) return FitStatus::ill_conditioned;
    for (std::size_t k = 0; k < count; ++k)
      if (result.std_errors[k] > ill_conditioned_error * std::abs(result.parameters[k]))
        return FitStatus::ill_conditioned;
    return FitStatus::converged;
  }

  static double part(std::complex<double> value, Eigen::Index row) {
    return row % 2 == 0 ? value.real() : value.imag();
  }

  const Motion* motion_;
  GaussRule rule_;
  std::array<Bounds, count> bounds_{};
  Eigen::MatrixXcd phasors_;  // tones x parameters
  std::array<bool, count> felt_{};
  Eigen::MatrixXd jacobian_;  // (re, im a tone) x parameters
  Eigen::VectorXd residuals_;
};

template <IsPolynomial Model>
std::unique_ptr<Fitter> make_fitter(const FitterSetup& setup) {
  return std::make_unique<LinearFitter<Model>>(setup);
}

}  // namespace combforce
