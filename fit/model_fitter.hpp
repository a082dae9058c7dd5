// The paper's fit of one model: starts, solver, quadrature control, status; with refinement, the starts of
// what goes beyond it (refined_fit.hpp). Compiled for each model, in a unit of its own (fitters/), since that
// takes long; pixel_fitter.hpp is the door.
#pragma once

#include <ceres/tiny_solver.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "fit/fit_result.hpp"
#include "fit/fitter.hpp"
#include "fit/force_balance.hpp"
#include "fit/measured_force.hpp"
#include "fit/refined_fit.hpp"
#include "fit/residuals.hpp"
#include "fit/start_values.hpp"
#include "fit/touch_search.hpp"
#include "fit/trench.hpp"
#include "fit/uncertainty.hpp"
#include "fit/whitening.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class ModelFitter : public Fitter {
 public:
  using Parameters = std::array<double, Model::parameters>;

  explicit ModelFitter(const FitterSetup& setup)
      : balance_(&setup.balance),
        starts_(setup.balance.motion(), StartValues::kind_of<Model>, setup.balance.velocity_per_slope()),
        touches_([&] {
          if constexpr (DependsOnHistory<Model>)
            return TouchSearch<Model>(setup.balance);
          else
            return Nothing{};
        }()),
        residuals_(setup.balance, setup.tones),
        jacobian_(static_cast<Eigen::Index>(2 * setup.tones), Model::parameters),
        differences_(static_cast<Eigen::Index>(2 * setup.tones)),
        finer_(static_cast<Eigen::Index>(2 * setup.tones)),
        bounds_(setup.bounds.begin(), setup.bounds.end()),
        in_force_(bounds_),
        beyond_paper_(bounds_) {
    // The solver sizes its workspace when it is first called: here, not at the first pixel.
    residuals_.set_bounds(in_force_);
    x_.setZero();
    solver_.options.max_num_iterations = 0;
    solver_.Solve(residuals_, &x_);
    if constexpr (refines)
      if (setup.harmonics != nullptr)
        refined_.emplace(*setup.harmonics, *setup.heat, setup.refine, setup.profile_intervals);
  }

  void fit(const MeasuredForce& measured, std::span<const std::complex<double>> tones,
           std::span<const double> weights, const Whitening& whitening, std::span<const double> start,
           FitResult& result) override {
    residuals_.set_measured(measured.phasors(), weights);
    bound_to_motion();
    balance_->reset();
    iterations_ = 0;
    std::array<Parameters, StartValues::most<Model>> starts;
    std::size_t count = 1;
    if (start.empty()) {
      starts_.set_motion(balance_->motion());
      count = starts_.template scan<Model>(measured.phasors(), weights, in_force_, starts);
    } else {
      std::copy_n(start.begin(), starts[0].size(), starts[0].begin());
    }
    if (refined_) {
      if constexpr (refines) {
        std::array<Parameters, StartValues::dispersed_depths> further;
        if (start.empty()) starts_.template dispersed<Model>(measured.phasors(), weights, in_force_, further);
        refined_->fit(measured, tones, whitening, beyond_paper_, std::span(starts).first(count),
                      std::span(further).first(start.empty() ? further.size() : 0), result);
      }
    } else {
      if (start.empty()) count = polish(std::span(starts).first(count));
      fit_paper(std::span(starts).first(count), measured, weights, whitening, start.empty(), result);
      result.virial_nn_nm = measured.virial_nn_nm();
      result.dissipated_fw = measured.dissipated_fw();
    }
    result.iterations += iterations_;
  }

  double error(const MeasuredForce& measured, std::span<const double> weights,
               std::span<const double> parameters) override {
    residuals_.set_measured(measured.phasors(), weights);
    balance_->reset();
    Parameters p;
    std::copy_n(parameters.begin(), p.size(), p.begin());
    double coarse = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t level = 0; level < ForceBalance::levels; ++level) {
      balance_->prepare(contact_top_nm<Model>(p.data()), level, has_tail);
      residuals_.linearize(p, jacobian_, finer_);
      const double sum = error_of_finer(weights);
      if (std::abs(sum - coarse) <= 1e-6 * sum) return sum;
      coarse = sum;
    }
    return coarse;
  }

 private:
  using Solver = ceres::TinySolver<Residuals<Model>>;
  static constexpr bool has_tail = !Model::tail_terms.empty() && !DependsOnHistory<Model>;
  struct Nothing {};
  static constexpr bool refines = !DependsOnHistory<Model>;

  // Aims of the quadrature: surface position, nm; other parameters, of their value. Ten times that is
  // accepted at the finest level, and whatever is below a hundredth of the standard error.
  static constexpr double position_tolerance_nm = 1e-4;
  static constexpr double relative_tolerance = 5e-5;
  static constexpr double ill_conditioned_error = 0.3;
  // Minima from which jumps are crossed; how far, of the motion's span, and how often from the least.
  static constexpr std::size_t crossed = 3;
  static constexpr double far_of_span = 0.02, near_of_span = 0.005;
  static constexpr int most_rounds = 5;
  static constexpr double as_good =
      1.1;  // errors E that coarse quadratures, or unfinished solutions, differ by
  static constexpr double clearly_less = 0.5;  // of E: more than they differ by

  // The surface is sought no farther from the motion than the motion's span. A force that decays may be 1 nN
  // much farther away, the farther the more slowly it decays.
  void bound_to_motion() {
    const double lowest = balance_->motion().lowest_nm(), highest = balance_->motion().highest_nm();
    const double reach = (Decays<Model> ? 100.0 : 1.0) * (highest - lowest);
    in_force_ = bounds_;
    in_force_[0] = {std::max(bounds_[0].lower, lowest - reach), std::min(bounds_[0].upper, highest + reach)};
    if (!(in_force_[0].lower < in_force_[0].upper)) in_force_[0] = bounds_[0];
    beyond_paper_ = in_force_;
    if constexpr (StaysAboveSurface<Model>)  // the partial motion does; the whole one is not known yet
      in_force_[0].upper = std::min(in_force_[0].upper, lowest - Model::least_height_nm);
    residuals_.set_bounds(in_force_);
  }

  // Replaces the starts by the local minima of the paper's error that they lead to, each once, least first;
  // returns how many.
  std::size_t polish(std::span<Parameters> starts) {
    std::array<Parameters, StartValues::most<Model>> minima;
    std::array<double, StartValues::most<Model>> costs{};
    std::size_t found = 0;
    for (Parameters p : starts) {
      residuals_.release();
      solve(p, 0, 30, 1e-4);
      const double cost = std::isfinite(solver_.summary.final_cost) ? solver_.summary.final_cost
                                                                    : std::numeric_limits<double>::max();
      if (std::any_of(minima.begin(), minima.begin() + found, [&](const auto& one) { return alike(one, p); }))
        continue;
      std::size_t place = found++;
      for (; place > 0 && cost < costs[place - 1]; --place) {
        costs[place] = costs[place - 1];
        minima[place] = minima[place - 1];
      }
      costs[place] = cost;
      minima[place] = p;
    }
    if constexpr (DependsOnHistory<Model>) cross_jumps(std::span(minima).first(found), costs);
    std::copy_n(minima.begin(), found, starts.begin());
    return found;
  }

  // On from the least minima across the jumps of E (touch_search.hpp); from the least of what that finds, as
  // long as there is a lower one beside it.
  void cross_jumps(std::span<Parameters> minima, std::span<double> costs) {
    const double span = balance_->motion().highest_nm() - balance_->motion().lowest_nm();
    for (std::size_t i = 0; i < std::min(minima.size(), crossed); ++i) {
      cross_jumps(minima[i], costs[i], far_of_span * span);
      if (costs[i] < costs[0]) {
        std::swap(costs[i], costs[0]);
        std::swap(minima[i], minima[0]);
      }
    }
    for (int round = 0; round < most_rounds; ++round)
      if (!cross_jumps(minima[0], costs[0], near_of_span * span)) break;
  }

  // Whether that has lowered the cost.
  bool cross_jumps(Parameters& p, double& cost, double reach) {
    std::array<Parameters, TouchSearch<Model>::most> places;
    const std::size_t count = touches_.search(residuals_, solver_, p, reach, places);
    bool lower = false;
    for (Parameters& q : std::span(places).first(count)) {
      residuals_.release();
      if (!solve(q, 0, 30, 1e-4) || !(solver_.summary.final_cost < (1.0 - 1e-3) * cost)) continue;
      cost = solver_.summary.final_cost;
      p = q;
      lower = true;
    }
    return lower;
  }

  // Closer than a polished start is to its minimum.
  static bool alike(const Parameters& a, const Parameters& b) {
    for (std::size_t k = 0; k < a.size(); ++k)
      if (!(std::abs(a[k] - b[k]) <= (k == 0 ? 0.02 : 0.02 * std::abs(b[k])))) return false;
    return true;
  }

  // What a minimum of the paper's error comes to.
  struct Minimum {
    Parameters p{};
    double error = std::numeric_limits<double>::infinity();  // what was minimised
    double chi2 = std::numeric_limits<double>::infinity();   // by the noise model
    FitResult result;
    FitResult extent;  // standard errors and correlations as of search_covariance()
  };

  // From the least of the minima, and those that rival it; then, where the trench is long, also from places
  // along it.
  void fit_paper(std::span<const Parameters> minima, const MeasuredForce& measured,
                 std::span<const double> weights, const Whitening& whitening, bool seek, FitResult& result) {
    Minimum best = minimum(minima[0], measured, weights, whitening), other;
    if (seek) {
      for (const Parameters& p : minima.subspan(1))
        if (rivals(p, best, weights, whitening))
          keep_best(minimum(p, measured, weights, whitening), best, other);
      if (const Trench<Model::parameters> trench(best.p, best.extent); trench.is_long()) {
        const std::array starts{trench.start(1.0), trench.start(-1.0)};
        residuals_.release();
        for (Parameters p : starts) {
          if (!solve(p, 0, 30, 1e-4) || alike(p, other.p)) continue;
          // Not where the way along the trench leads back: near the best one, and no better.
          if (within_noise(p, best, 0.25) && !(coarse_error(p, weights) < clearly_less * best.error))
            continue;
          if (rivals(p, best, weights, whitening))
            keep_best(minimum(p, measured, weights, whitening), best, other);
        }
      }
    }
    result = best.result;
    report_alternative(other.p, other.chi2 - best.chi2, result);
  }

  Minimum minimum(const Parameters& p, const MeasuredForce& measured, std::span<const double> weights,
                  const Whitening& whitening) {
    Minimum minimum;
    minimum.result = unfitted(FitStatus::not_converged, Model::parameters);
    minimum.chi2 = refine(p, measured, weights, whitening, minimum.result, minimum.extent);
    std::copy_n(minimum.result.parameters.begin(), minimum.p.size(), minimum.p.begin());
    minimum.error = error_of_finer(weights);
    return minimum;
  }

  // E on the coarsest quadrature, whose residuals are then in finer_.
  double coarse_error(const Parameters& p, std::span<const double> weights) {
    balance_->prepare(contact_top_nm<Model>(p.data()), 0, has_tail);
    residuals_.linearize(p, jacobian_, finer_);
    return error_of_finer(weights);
  }

  // Whether a minimum of the coarsest quadrature may yet turn out the least one, or explain the pixel as well
  // as the best: the margins are far above what a finer quadrature adds to E, and to chi^2.
  bool rivals(const Parameters& p, const Minimum& best, std::span<const double> weights,
              const Whitening& whitening) {
    return coarse_error(p, weights) < as_good * best.error ||
           chi2_of_finer(whitening) < best.chi2 + std::max(10.0, 0.1 * best.chi2);
  }

  // Nearer than so many standard errors, if these are known.
  static bool within_noise(const Parameters& p, const Minimum& best, double standard_errors) {
    for (std::size_t k = 0; k < p.size(); ++k)
      if (!(std::abs(p[k] - best.p[k]) <= standard_errors * best.extent.std_errors[k]))
        return alike(p, best.p);
    return true;
  }

  double error_of_finer(std::span<const double> weights) const {
    double error = 0.0;
    for (Eigen::Index row = 0; row < finer_.size(); ++row)
      error += weights[static_cast<std::size_t>(row / 2)] * finer_(row) * finer_(row);
    return error;
  }
  // NaN without a noise model.
  double chi2_of_finer(const Whitening& whitening) {
    if (!whitening.by_noise) return std::numeric_limits<double>::quiet_NaN();
    differences_ = finer_;
    whitening.root.triangularView<Eigen::Lower>().solveInPlace(differences_);
    return differences_.squaredNorm();
  }

  // The least error is the best, but for one that did not converge and has a neighbour that did; of the
  // others the one with the least chi^2 stays.
  static void keep_best(Minimum one, Minimum& best, Minimum& other) {
    if (one.result.status == FitStatus::not_converged || alike(one.p, best.p)) return;
    if (DependsOnHistory<Model> && within_noise(one.p, best, 2.0)) {  // beyond a jump of E, but no farther
      if (one.error < best.error) best = one;
      return;
    }
    const bool unsolved = best.result.status == FitStatus::not_converged;
    if (one.error < (unsolved ? as_good : 1.0) * best.error) std::swap(one, best);
    if (one.result.status != FitStatus::not_converged && one.chi2 < other.chi2) other = one;
  }

  // Solves on quadrature `level` from p, which becomes the minimum found, until a step changes x, or E, by
  // less than `tolerance` of itself (cuts that come and go make E jump by 1e-10 or so). Prepares the balance
  // again when p0 comes close to its ceiling; holds what creeps along its bound.
  bool solve(Parameters& p, std::size_t level, int most_iterations, double tolerance) {
    solver_.options.max_num_iterations = most_iterations;
    solver_.options.parameter_tolerance = tolerance;
    solver_.options.gradient_tolerance = 0.0;
    solver_.options.cost_threshold = 0.0;
    solver_.options.initial_trust_region_radius = 1e6;
    for (int attempt = 0; attempt < 10; ++attempt) {
      x_ = residuals_.coordinates(p);
      balance_->prepare(residuals_.contact_top(x_), level, has_tail);
      residuals_.invalidate();
      solver_.options.function_tolerance = tolerance * residuals_.squared_norm(x_);
      solver_.Solve(residuals_, &x_);
      iterations_ += static_cast<std::uint32_t>(solver_.summary.iterations);
      p = residuals_.parameters(x_);
      if (contact_top_nm<Model>(p.data()) > balance_->ceiling_nm() - 0.5 * balance_->margin_nm()) continue;
      if (solver_.summary.status == Solver::HIT_MAX_ITERATIONS && residuals_.hold_at_edges(x_)) continue;
      return solver_.summary.status != Solver::HIT_MAX_ITERATIONS &&
             std::isfinite(solver_.summary.final_cost);
    }
    return false;
  }

  // Solves on finer and finer quadratures until the next finer one would not move the minimum. Returns chi^2,
  // NaN without a noise model.
  double refine(Parameters p, const MeasuredForce& measured, std::span<const double> weights,
                const Whitening& whitening, FitResult& result, FitResult& extent) {
    bool solved = false, good = false;
    Linearization at{jacobian_, weights, {}};
    residuals_.release();
    for (std::size_t level = 0; !good && level + 1 < ForceBalance::levels; ++level) {
      solved = solve(p, level, 100, 1e-9);
      std::ranges::copy(residuals_.held(x_), at.fixed.begin());
      residuals_.linearize(p, jacobian_, differences_);
      balance_->prepare(contact_top_nm<Model>(p.data()), level + 1, has_tail);
      residuals_.linearize(p, jacobian_, finer_);
      differences_ = finer_ - differences_;
      result.quadrature_errors = minimum_shift(at, differences_);
      good = solved && within(p, result.quadrature_errors, result, 1.0);
    }
    const double chi2 = chi2_of_finer(whitening);
    const bool determined =
        estimate_uncertainty(at, measured.covariance(), chi2, measured.noise_known(), result);
    estimate_uncertainty(at, measured.search_covariance(), chi2, true, extent);
    // What remains of the way to the minimum of the finest quadrature evaluated: one Gauss-Newton step. Where
    // E jumps there is none to go to; that place is as good where the noise cannot tell.
    const auto left = minimum_shift(at, finer_);
    const bool at_jump = DependsOnHistory<Model> && !within(p, left, result, 10.0);
    if (good && !at_jump) step(left, p);
    std::ranges::copy(p, result.parameters.begin());
    const bool bounded = std::ranges::any_of(at.fixed, [](bool fixed) { return fixed; }) ||
                         (at_jump && determined && !within(p, left, result, 10.0, 1.0));
    if (!(good || (solved && (within(p, result.quadrature_errors, result, 10.0) || !determined))))
      result.status = FitStatus::not_converged;
    else if (bounded)
      result.status = FitStatus::at_bound;
    else if (!determined || weakly_determined(p, result))
      result.status = FitStatus::ill_conditioned;
    else
      result.status = FitStatus::converged;
    return chi2;
  }

  void step(const std::array<double, max_parameters>& way, Parameters& p) const {
    for (std::size_t k = 0; k < p.size(); ++k) {
      const double next = p[k] + way[k];
      if (next > in_force_[k].lower && next < in_force_[k].upper) p[k] = next;
    }
  }

  // Changes within `factor` times the aims, or below a share of the standard errors.
  static bool within(const Parameters& p, const std::array<double, max_parameters>& changes,
                     const FitResult& result, double factor, double share = 0.01) {
    for (std::size_t k = 0; k < p.size(); ++k) {
      double tolerance = factor * (k == 0 ? position_tolerance_nm : relative_tolerance * std::abs(p[k]));
      if (result.std_errors[k] > 0.0) tolerance = std::max(tolerance, share * result.std_errors[k]);
      if (!(std::abs(changes[k]) <= tolerance)) return false;
    }
    return true;
  }

  // The surface position has no scale of its own: its zero is arbitrary.
  static bool weakly_determined(const Parameters& p, const FitResult& result) {
    for (std::size_t k = 1; k < p.size(); ++k)
      if (result.std_errors[k] > ill_conditioned_error * std::abs(p[k])) return true;
    return false;
  }

  ForceBalance* balance_;
  StartValues starts_;
  [[no_unique_address]] std::conditional_t<DependsOnHistory<Model>, TouchSearch<Model>, Nothing> touches_;
  Residuals<Model> residuals_;
  Solver solver_;
  typename Solver::Parameters x_;
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd differences_, finer_;
  std::vector<Bounds> bounds_, in_force_, beyond_paper_;  // as set, and for this motion
  std::optional<std::conditional_t<refines, RefinedFit<Model>, Nothing>> refined_;
  std::uint32_t iterations_ = 0;
};

template <NeedsSearch Model>
std::unique_ptr<Fitter> make_fitter(const FitterSetup& setup) {
  return std::make_unique<ModelFitter<Model>>(setup);
}

}  // namespace combforce
