// The fit beyond the paper, from starts to status: self_consistent.hpp from every start that the partial
// motion offers, the best of the solutions, its uncertainty, and whether another one explains the pixel as
// well.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ranges>
#include <span>
#include <vector>

#include "fit/engaged_heat.hpp"
#include "fit/fit_result.hpp"
#include "fit/harmonic_balance.hpp"
#include "fit/loosened_balance.hpp"
#include "fit/measured_force.hpp"
#include "fit/self_consistent.hpp"
#include "fit/trench.hpp"
#include "fit/uncertainty.hpp"
#include "fit/warm_fit.hpp"
#include "fit/whitening.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class RefinedFit {
 public:
  using Parameters = std::array<double, Model::parameters>;

  // `most`: iterations from each start, at least 1. `harmonics` and `heat` outlive the fit.
  RefinedFit(const Harmonics& harmonics, EngagedHeat& heat, std::uint32_t most, bool profile_intervals)
      : profile_intervals_(profile_intervals),
        balance_(harmonics),
        fit_(balance_),
        loosened_(balance_),
        heat_(&heat),
        warm_(heat, balance_, fit_, quadrature_level, most),
        most_(most),
        rows_(balance_.rows()),
        jacobian_(rows_, Model::parameters),
        shift_(rows_),
        best_root_(rows_, rows_),
        best_deviation_(harmonics.band() + 1),
        ones_(harmonics.tones().size(), 1.0) {}

  // Fills `result`. `starts`: best first, at least one, all tried; `further`, the softest surface last: tried
  // until one explains the pixel when none of `starts` does. When all of them lead astray, `starts` and the
  // softer half of `further` by loosened_balance.hpp, until that leads where another start has led: then
  // there is no more to find. `tones`: nm, one a tone.
  void fit(const MeasuredForce& measured, std::span<const std::complex<double>> tones,
           const Whitening& whitening, std::span<const Bounds> bounds, std::span<const Parameters> starts,
           std::span<const Parameters> further, FitResult& result) {
    result = unfitted(FitStatus::not_converged, Model::parameters);
    balance_.set_bounds(bounds);
    balance_.set_measured(tones, measured.phasors());
    known_count_ = 0;
    jacobian_.setZero();
    fit_.set_insignificant(whitening.by_noise ? insignificant : 0.0);
    Solution best, other;
    for (const Parameters& start : starts) try_start(start, measured, whitening, best, other, result);
    for (const Parameters& start : further)
      if (!explains(measured, best)) try_start(start, measured, whitening, best, other, result);
    bool again = false;
    const auto loosen = [&](auto&& list, double looseness) {
      for (const Parameters& start : list)
        if (astray(best) && !again)
          again = try_loosened(start, looseness, measured, whitening, best, other, result);
    };
    loosen(starts, loose);
    loosen(further.last(further.size() / 2) | std::views::reverse, loose);
    loosen(starts, looser);
    bool determined = estimate(measured, whitening, best, result);
    if (const Trench<Model::parameters> trench(best.p, result); best.converged && trench.is_long()) {
      const std::array starts_along{trench.start(1.0), trench.start(-1.0)};
      for (const Parameters& start : starts_along) try_start(start, measured, whitening, best, other, result);
      determined = estimate(measured, whitening, best, result);
    }
    result.status = status(measured, best, determined, result);
    result.virial_nn_nm = measured.virial_nn_nm() + (best.converged ? off_comb_.virial_nn_nm : 0.0);
    result.dissipated_fw = measured.dissipated_fw() + (best.converged ? off_comb_.dissipated_fw : 0.0);
    // Costs are chi^2 when the weights come from noise.
    if (measured.noise_known() && other.converged && !within_noise(other.p, result))
      report_alternative(other.p, other.cost - best.cost, result);
    if (profile_intervals_ && whitening.by_noise && best.converged) profile(bounds, best, result);
  }

 private:
  using Solution = typename SelfConsistentFit<Model>::Solution;

  static constexpr std::size_t quadrature_level = 1;
  static constexpr double misfit_deviate =
      4.0;  // standard deviations: one good pixel in 30,000 is called a misfit
  // Of 120 pixels of intermodulation half needed none of these, all but one at most 8, that one `looser`;
  // none came by them to where another start had led before it came to the truth.
  static constexpr double loose = 10.0, looser = 100.0;
  static constexpr double insignificant = 1e-3;         // of chi^2: a thirtieth of a standard error
  static constexpr double ill_conditioned_error = 0.3;  // relative standard error
  static constexpr int most_profile_trials = 8;
  static constexpr double profile_tolerance = 0.01;           // of a standard error
  static constexpr double same_nm = 1e-3, same_share = 1e-3;  // far above what solutions differ by
  static constexpr double same_errors = 0.1;                  // sqrt(`insignificant`) either way, and some

  // From a start and no motion off the comb.
  void try_start(const Parameters& start, const MeasuredForce& measured, const Whitening& whitening,
                 Solution& best, Solution& other, FitResult& result) {
    std::ranges::fill(balance_.motion(), 0.0);
    solve(start, measured, whitening, best, other, result);
  }

  // From where the loosened balance leads from a start. Whether another start has led to the solution.
  bool try_loosened(Parameters start, double looseness, const MeasuredForce& measured,
                    const Whitening& whitening, Solution& best, Solution& other, FitResult& result) {
    balance_.set_whitening(whitening.root);
    balance_.remove_deviation();
    return loosened_.approach(start, quadrature_level, looseness, result.iterations) &&
           !solve(start, measured, whitening, best, other, result);
  }

  // Whether no other start has led to the solution.
  bool solve(const Parameters& start, const MeasuredForce& measured, const Whitening& whitening,
             Solution& best, Solution& other, FitResult& result) {
    balance_.set_whitening(whitening.root);
    balance_.remove_deviation();
    Solution solution = fit_.solve(start, quadrature_level, most_);
    result.iterations += solution.iterations;
    if (solution.converged) {
      if (is_known(solution.p)) return false;
      const Parameters led = solution.p;
      if (measured.noise_known()) warm_.search(measured, solution, result.iterations);
      if (solution.converged) remember(led);
    }
    if (!better(solution, best)) {
      if (solution.converged && !same(solution.p, best.p) && solution.cost < other.cost) other = solution;
      return true;
    }
    if (best.converged && !same(solution.p, best.p)) other = best;
    best = solution;
    jacobian_ = fit_.jacobian();
    best_root_ = balance_.whitening();
    best_deviation_ = balance_.deviation();
    off_comb_ = fit_.off_comb_exchange();
    lasting_ = heat_->engage(balance_.gradient());
    estimate_quadrature_error(best, result);
    return true;
  }

  // Whether another start has led here: what follows takes as long as all before it.
  bool is_known(const Parameters& p) const {
    const auto known = std::span(known_).first(std::min(known_count_, known_.size()));
    return std::ranges::any_of(known, [&](const Parameters& other) { return same(p, other); });
  }
  void remember(const Parameters& p) { known_[known_count_++ % known_.size()] = p; }

  // Both ends of every parameter's interval. Uses up what fit_ and balance_ hold.
  void profile(std::span<const Bounds> bounds, const Solution& best, FitResult& result) {
    balance_.set_whitening(best_root_);
    balance_.set_deviation(best_deviation_);
    for (std::size_t k = 0; k < Model::parameters; ++k)
      for (const double side : {-1.0, 1.0})
        result.intervals[k][side < 0.0 ? 0 : 1] = profile_end(bounds, best, k, side, result);
    fit_.release();
  }

  // Where the root of the rise of chi^2, which is nearly linear, is 1. NaN when it is not found.
  double profile_end(std::span<const Bounds> bounds, const Solution& best, std::size_t k, double side,
                     FitResult& result) {
    const double end = side < 0.0 ? bounds[k].lower : bounds[k].upper;
    double away = side * result.std_errors[k];
    if (!(std::abs(away) > 0.0)) return std::numeric_limits<double>::quiet_NaN();
    for (int trial = 0; trial < most_profile_trials; ++trial) {
      const bool beyond = !(side * (best.p[k] + away) < side * end);
      if (beyond) away = end - best.p[k];
      const double rise = profiled_cost(best, k, away, result) - best.cost;
      const double root = std::sqrt(rise);
      if (!(root > 0.0)) break;
      if (std::abs(root - 1.0) <= profile_tolerance || (beyond && root < 1.0)) return best.p[k] + away;
      away /= root;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

  // The least cost with parameter k held `away` from its best.
  double profiled_cost(const Solution& best, std::size_t k, double away, FitResult& result) {
    Parameters start = best.p;
    start[k] += away;
    fit_.hold(k);
    std::ranges::fill(balance_.motion(), 0.0);
    const Solution solution = fit_.solve(start, quadrature_level, most_);
    result.iterations += solution.iterations;
    return solution.converged ? solution.cost : std::numeric_limits<double>::quiet_NaN();
  }

  bool estimate(const MeasuredForce& measured, const Whitening& whitening, const Solution& best,
                FitResult& result) const {
    result.refinements = best.iterations;
    std::ranges::copy(best.p, result.parameters.begin());
    const double chi2 = whitening.by_noise ? best.cost : std::numeric_limits<double>::quiet_NaN();
    return estimate_uncertainty(Linearization{jacobian_, ones_, best.fixed}, whitening.covariance, chi2,
                                measured.noise_known(), result);
  }

  // Converged inside the bounds, with a plausible chi^2 where the noise is known.
  bool explains(const MeasuredForce& measured, const Solution& solution) const {
    const auto degrees = static_cast<double>(rows_) - static_cast<double>(Model::parameters);
    return solution.converged && count_free(solution) == Model::parameters &&
           !measured.misfit(solution.cost / degrees, Model::parameters, misfit_deviate);
  }

  // Leaves so much of the measured forces that it is none of a noisy pixel's minima: the search got lost.
  bool astray(const Solution& best) const {
    return !best.converged || best.cost > LoosenedBalance<Model>::explained * balance_.measured_square();
  }

  static bool better(const Solution& a, const Solution& b) {
    return a.converged != b.converged ? a.converged : a.cost < b.cost;
  }
  static bool same(const Parameters& a, const Parameters& b) {
    for (std::size_t k = 0; k < Model::parameters; ++k)
      if (!(std::abs(a[k] - b[k]) <= (k == 0 ? same_nm : same_share * std::abs(b[k])))) return false;
    return true;
  }
  // Nearer to the result than two searches may end from one minimum.
  static bool within_noise(const Parameters& p, const FitResult& result) {
    for (std::size_t k = 0; k < Model::parameters; ++k)
      if (!(std::abs(p[k] - result.parameters[k]) <= same_errors * result.std_errors[k])) return false;
    return true;
  }

  // How far the solution moves on the next finer quadrature.
  void estimate_quadrature_error(const Solution& solution, FitResult& result) {
    fit_.refine_quadrature(solution.p, quadrature_level, shift_);
    result.quadrature_errors = minimum_shift(Linearization{jacobian_, ones_, solution.fixed}, shift_);
  }

  FitStatus status(const MeasuredForce& measured, const Solution& best, bool determined,
                   const FitResult& result) const {
    if (!best.converged) return FitStatus::not_converged;
    if (!lasting_ || measured.misfit(result.chi2_reduced, count_free(best), misfit_deviate))
      return FitStatus::misfit;
    if (std::ranges::find(best.fixed, true) != best.fixed.end()) return FitStatus::at_bound;
    if (!determined) return FitStatus::ill_conditioned;
    for (std::size_t k = 1; k < Model::parameters; ++k)
      if (result.std_errors[k] > ill_conditioned_error * std::abs(best.p[k]))
        return FitStatus::ill_conditioned;
    return FitStatus::converged;
  }
  static std::size_t count_free(const Solution& solution) {
    return Model::parameters - static_cast<std::size_t>(std::ranges::count(solution.fixed, true));
  }

  bool profile_intervals_;
  HarmonicBalance<Model> balance_;
  SelfConsistentFit<Model> fit_;
  LoosenedBalance<Model> loosened_;
  EngagedHeat* heat_;
  WarmFit<Model> warm_;
  std::uint32_t most_;
  Eigen::Index rows_;
  Eigen::MatrixXd jacobian_;  // whitened, of the best solution
  Eigen::VectorXd shift_;
  Eigen::MatrixXd best_root_;
  typename HarmonicBalance<Model>::Spectrum best_deviation_;
  std::vector<double> ones_;
  typename SelfConsistentFit<Model>::Exchange off_comb_;
  bool lasting_ = true;  // of the best solution
  // Where starts led of late, by the whitening that does not know the surface.
  std::array<Parameters, 8> known_{};
  std::size_t known_count_ = 0;
};

}  // namespace combforce
