// On from a self-consistent solution (self_consistent.hpp) with what heat does over the surface found
// (engaged_heat.hpp): to the noise of the tones and, for levers that it moves much, to the mean of the force
// over the tip's thermal motion.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "fit/engaged_heat.hpp"
#include "fit/harmonic_balance.hpp"
#include "fit/measured_force.hpp"
#include "fit/self_consistent.hpp"
#include "fit/uncertainty.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class WarmFit {
 public:
  using Solution = typename SelfConsistentFit<Model>::Solution;

  // `fit`, from this `balance`'s motion and whitening, found the solutions, on this `level` of the quadrature
  // and in at most `most` iterations. All outlive this.
  WarmFit(EngagedHeat& heat, HarmonicBalance<Model>& balance, SelfConsistentFit<Model>& fit,
          std::size_t level, std::uint32_t most)
      : heat_(&heat),
        balance_(&balance),
        fit_(&fit),
        level_(level),
        most_(most),
        stiffness_(balance.rows(), balance.rows()),
        covariance_(balance.rows(), balance.rows()),
        root_(balance.rows(), balance.rows()),
        cold_root_(balance.rows(), balance.rows()),
        factor_(balance.rows()),
        shift_(balance.rows()),
        deviation_(balance.motion().size()),
        deviation_before_(balance.motion().size()),
        change_(balance.motion().size()),
        cold_motion_(balance.motion().size()),
        ones_(balance.harmonics().tones().size(), 1.0) {}

  // From the last solution of the fit, until what heat does stays as it is. Where the search for this does
  // not end, back to the force along the mean motion if the difference is small. As it was where heat's
  // motion over that solution is not stable. Adds to `iterations`.
  void search(const MeasuredForce& measured, Solution& solution, std::uint32_t& iterations) {
    const Parameters cold = solution.p;
    cold_motion_ = balance_->motion();
    double first_change = 0.0;
    for (std::size_t round = 0; round < most_rounds; ++round) {
      if (!heat_->engage(balance_->gradient())) {
        if (round == 0) return;
        break;
      }
      fit_->stiffness_at_tones(stiffness_);
      const double change = spread_at_solution(solution);
      if (round > 0 && std::isnan(change)) break;
      if (round > 0 && change == 0.0) return;
      if (!whiten_at_solution(measured)) {
        balance_->set_deviation(deviation_before_);
        return;
      }
      if (round == 0) {
        first_change = std::isnan(change) ? 0.0 : change;
        cold_root_ = root_;
      }
      solve_on(solution.p, solution, iterations);
      if (first_change == 0.0) return;
      if (!solution.converged) break;
    }
    solution.converged = false;
    if (first_change > tolerable) return;
    balance_->remove_deviation();
    balance_->set_whitening(cold_root_);
    balance_->motion() = cold_motion_;
    solve_on(cold, solution, iterations);
  }

 private:
  using Parameters = typename SelfConsistentFit<Model>::Parameters;

  // A lever that heat moves less than this feels the force of its mean motion, to a tenth of the standard
  // errors of one window.
  static constexpr double felt_nm = 0.05;
  static constexpr std::size_t most_rounds = 20;     // of the force's mean over heat
  static constexpr double negligible = 0.05 * 0.05;  // of chi^2: a twentieth of a standard error
  static constexpr double tolerable = 0.25;          // of chi^2: half a standard error

  void solve_on(const Parameters& from, Solution& solution, std::uint32_t& iterations) {
    solution = fit_->solve(from, level_, most_);
    iterations += solution.iterations;
  }

  // Heat carries the tip about its mean motion, and the mean force is not the force on the mean motion. Lets
  // the balance know where this moves the parameters by more than nothing beside noise; by how much of chi^2,
  // or 0. NaN where the parameters are not determined.
  double spread_at_solution(const Solution& solution) {
    deviation_before_ = balance_->deviation();
    if (heat_->free_variance() < felt_nm * felt_nm) return 0.0;
    heat_->standard_deviation(0.5 * heat_->covariance().trace(), deviation_);
    balance_->evaluate(solution.p, level_);
    std::ranges::transform(balance_->force(), change_.begin(), std::negate{});
    balance_->set_deviation(deviation_);
    balance_->evaluate(solution.p, level_);
    std::ranges::transform(balance_->force(), change_, change_.begin(), std::plus{});
    fit_->follow(change_, shift_);
    const auto moved = minimum_shift(Linearization{fit_->jacobian(), ones_, solution.fixed}, shift_);
    const Eigen::Map<const Eigen::Matrix<double, Model::parameters, 1>> step(moved.data());
    shift_.noalias() = fit_->jacobian().lazyProduct(step);
    const double change = shift_.squaredNorm();
    if (change > negligible) return change;
    balance_->set_deviation(deviation_before_);
    return std::isfinite(change) ? 0.0 : std::numeric_limits<double>::quiet_NaN();
  }

  // What noise does depends on how the surface answers.
  bool whiten_at_solution(const MeasuredForce& measured) {
    measured.covariance_at(stiffness_, heat_->covariance(), covariance_);
    factor_.compute(covariance_);
    if (factor_.info() != Eigen::Success || !covariance_.allFinite()) return false;
    root_ = factor_.matrixL();
    balance_->set_whitening(root_);
    return true;
  }

  EngagedHeat* heat_;
  HarmonicBalance<Model>* balance_;
  SelfConsistentFit<Model>* fit_;
  std::size_t level_;
  std::uint32_t most_;
  Eigen::MatrixXd stiffness_, covariance_, root_, cold_root_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd shift_;
  typename HarmonicBalance<Model>::Spectrum deviation_, deviation_before_, change_, cold_motion_;
  std::vector<double> ones_;
};

}  // namespace combforce
