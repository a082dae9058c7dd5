// The fit of one model: starts, solver, quadrature control, status. Compiled for each model; pixel_fitter.hpp
// is the door.
#pragma once

#include <ceres/tiny_solver.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <span>
#include <vector>

#include "fit/bounded.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_balance.hpp"
#include "fit/measured_force.hpp"
#include "fit/start_values.hpp"
#include "fit/uncertainty.hpp"

namespace combforce {

// sqrt(weight) (F_model - F_measured) as TinySolver wants it: a function of the unbounded x. Scaled so that
// the measured forces have the norm 1.
template <typename Model>
class Residuals {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Model::parameters };
  using Parameters = std::array<double, Model::parameters>;

  Residuals(ForceBalance& balance, std::size_t tones)
      : balance_(&balance),
        derivatives_(static_cast<Eigen::Index>(tones), Model::parameters),
        forces_(tones),
        scales_(tones) {}

  void set_measured(std::span<const std::complex<double>> forces, std::span<const double> weights) {
    double square = 0.0;
    for (std::size_t i = 0; i < forces_.size(); ++i) square += weights[i] * std::norm(forces[i]);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      forces_[i] = forces[i];
      scales_[i] = std::sqrt(weights[i] / square);
    }
  }
  void set_bounds(std::size_t k, Bounded bounds) { bounds_[k] = bounds; }
  const Bounded& bounds(std::size_t k) const { return bounds_[k]; }
  // The balance has been prepared anew.
  void invalidate() { valid_ = false; }

  Parameters parameters(const double* x) const {
    Parameters p;
    for (std::size_t k = 0; k < p.size(); ++k) p[k] = bounds_[k].value(x[k]);
    return p;
  }

  int NumResiduals() const { return static_cast<int>(2 * forces_.size()); }

  bool operator()(const double* x, double* residuals, double* jacobian) const {
    const Parameters p = parameters(x);
    if (!(p[0] <= balance_->ceiling_nm())) {  // beyond what is prepared: never a step to accept
      std::fill_n(residuals, 2 * forces_.size(), 1e3);
      if (jacobian != nullptr) std::fill_n(jacobian, 2 * forces_.size() * Model::parameters, 0.0);
      return true;
    }
    update(p);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      const std::complex<double> residual = scales_[i] * (model_phasor(p, i) - forces_[i]);
      residuals[2 * i] = residual.real();
      residuals[2 * i + 1] = residual.imag();
      if (jacobian == nullptr) continue;
      for (std::size_t k = 0; k < Model::parameters; ++k) {
        const std::complex<double> slope =
            scales_[i] * bounds_[k].slope(x[k], p[k]) * derivatives_(index(i), index(k));
        jacobian[2 * (k * forces_.size() + i)] = slope.real();
        jacobian[2 * (k * forces_.size() + i) + 1] = slope.imag();
      }
    }
    return true;
  }

  // At p: dF/dp and F_model - F_measured in nN, rows (re, im) of each tone.
  void linearize(const Parameters& p, Eigen::MatrixXd& jacobian, Eigen::VectorXd& residuals) const {
    update(p);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      const std::complex<double> residual = model_phasor(p, i) - forces_[i];
      residuals(index(2 * i)) = residual.real();
      residuals(index(2 * i + 1)) = residual.imag();
      for (std::size_t k = 0; k < Model::parameters; ++k) {
        jacobian(index(2 * i), index(k)) = derivatives_(index(i), index(k)).real();
        jacobian(index(2 * i + 1), index(k)) = derivatives_(index(i), index(k)).imag();
      }
    }
  }

 private:
  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  void update(const Parameters& p) const {
    if (valid_ && p == last_) return;
    balance_->evaluate<Model>(p.data(), derivatives_);
    last_ = p;
    valid_ = true;
  }

  std::complex<double> model_phasor(const Parameters& p, std::size_t tone) const {
    std::complex<double> sum = 0.0;
    for (const std::size_t k : Model::linear) sum += p[k] * derivatives_(index(tone), index(k));
    return sum;
  }

  ForceBalance* balance_;
  mutable Eigen::MatrixXcd derivatives_;  // at last_, when valid_
  mutable Parameters last_{};
  mutable bool valid_ = false;
  std::vector<std::complex<double>> forces_;
  std::vector<double> scales_;
  std::array<Bounded, Model::parameters> bounds_;
};

struct Bounds {
  double lower, upper;
};

// Thread-bound. Only the constructor allocates.
template <typename Model>
class ModelFitter {
 public:
  using Parameters = std::array<double, Model::parameters>;

  ModelFitter(ForceBalance& balance, std::size_t tones, std::span<const Bounds> bounds)
      : balance_(&balance),
        starts_(tones),
        residuals_(balance, tones),
        jacobian_(static_cast<Eigen::Index>(2 * tones), Model::parameters),
        differences_(static_cast<Eigen::Index>(2 * tones)),
        finer_(static_cast<Eigen::Index>(2 * tones)),
        bounds_(bounds.begin(), bounds.end()) {}

  // The balance holds the motion. Fills everything of `result` but virial and power. `start`: empty to scan.
  void fit(const MeasuredForce& measured, std::span<const double> weights, std::span<const double> start,
           FitResult& result) {
    residuals_.set_measured(measured.phasors(), weights);
    bound_to_motion();
    iterations_ = 0;
    Parameters p;
    if (start.empty())
      p = best_of_starts(measured, weights);
    else
      std::copy_n(start.begin(), p.size(), p.begin());
    result = unfitted(FitStatus::not_converged, Model::parameters);
    refine(p, measured, weights, result);
    result.iterations = iterations_;
  }

  // E at p (paper, equation 9) with these weights, on the first quadrature that the next finer one confirms
  // to 1e-6.
  double error(const MeasuredForce& measured, std::span<const double> weights,
               std::span<const double> parameters) {
    residuals_.set_measured(measured.phasors(), weights);
    Parameters p;
    std::copy_n(parameters.begin(), p.size(), p.begin());
    double coarse = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t level = 1; level < ForceBalance::levels; ++level) {
      balance_->prepare(p[0], level, Model::has_tail);
      residuals_.invalidate();
      residuals_.linearize(p, jacobian_, finer_);
      double sum = 0.0;
      for (Eigen::Index row = 0; row < finer_.size(); ++row)
        sum += weights[static_cast<std::size_t>(row / 2)] * finer_(row) * finer_(row);
      if (std::abs(sum - coarse) <= 1e-6 * sum) return sum;
      coarse = sum;
    }
    return coarse;
  }

 private:
  using Solver = ceres::TinySolver<Residuals<Model>>;

  // Aims of the quadrature: surface position, nm; other parameters, of their value. Ten times that is
  // accepted at the finest level, and whatever is below a hundredth of the standard error.
  static constexpr double position_tolerance_nm = 1e-4;
  static constexpr double relative_tolerance = 5e-5;
  static constexpr double ill_conditioned_error = 0.3;

  // The surface is sought no farther from the motion than the motion's span.
  void bound_to_motion() {
    const double lowest = balance_->motion().lowest_nm(), highest = balance_->motion().highest_nm();
    const double span = highest - lowest;
    Bounds surface{std::max(bounds_[0].lower, lowest - span), std::min(bounds_[0].upper, highest + span)};
    if (!(surface.lower < surface.upper)) surface = bounds_[0];
    residuals_.set_bounds(0, Bounded(surface.lower, surface.upper));
    for (std::size_t k = 1; k < Model::parameters; ++k)
      residuals_.set_bounds(k, Bounded(bounds_[k].lower, bounds_[k].upper));
  }

  Parameters best_of_starts(const MeasuredForce& measured, std::span<const double> weights) {
    std::array<Parameters, StartValues::most> starts;
    starts_.set_motion(balance_->motion());
    const std::size_t count = starts_.template scan<Model>(measured.phasors(), weights, starts);
    Parameters best = starts[0];
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < count; ++i) {
      Parameters p = starts[i];
      solve(p, 0, 30, 1e-5);
      if (!(solver_.summary.final_cost < least)) continue;
      least = solver_.summary.final_cost;
      best = p;
    }
    return best;
  }

  // Solves on quadrature `level` from p, which becomes the minimum found; prepares the balance again as p0
  // moves.
  bool solve(Parameters& p, std::size_t level, int most_iterations, double tolerance) {
    solver_.options.max_num_iterations = most_iterations;
    solver_.options.parameter_tolerance = tolerance;
    solver_.options.gradient_tolerance = 0.0;
    solver_.options.function_tolerance = 0.0;
    solver_.options.cost_threshold = 0.0;
    for (int attempt = 0; attempt < 10; ++attempt) {
      for (std::size_t k = 0; k < p.size(); ++k)
        x_(static_cast<Eigen::Index>(k)) = residuals_.bounds(k).inverse(p[k]);
      p = residuals_.parameters(x_.data());
      const double about = p[0];
      balance_->prepare(about, level, Model::has_tail);
      residuals_.invalidate();
      solver_.Solve(residuals_, &x_);
      iterations_ += static_cast<std::uint32_t>(solver_.summary.iterations);
      p = residuals_.parameters(x_.data());
      if (std::abs(p[0] - about) > 0.5 * balance_->margin_nm()) continue;
      return solver_.summary.status != Solver::HIT_MAX_ITERATIONS &&
             std::isfinite(solver_.summary.final_cost);
    }
    return false;
  }

  // Solves on finer and finer quadratures until the next finer one would not move the minimum.
  void refine(Parameters p, const MeasuredForce& measured, std::span<const double> weights,
              FitResult& result) {
    bool solved = false, good = false;
    Linearization at{jacobian_, weights, {}};
    for (std::size_t level = 1; !good && level + 1 < ForceBalance::levels; ++level) {
      solved = solve(p, level, 100, 1e-10);
      residuals_.linearize(p, jacobian_, differences_);
      balance_->prepare(p[0], level + 1, Model::has_tail);
      residuals_.invalidate();
      residuals_.linearize(p, jacobian_, finer_);
      for (std::size_t k = 0; k < p.size(); ++k)
        at.fixed[k] = residuals_.bounds(k).at_bound(x_(static_cast<Eigen::Index>(k)));
      differences_ = finer_ - differences_;
      result.quadrature_errors = minimum_shift(at, differences_);
      good = solved && within(p, result, 1.0);
    }
    std::copy(p.begin(), p.end(), result.parameters.begin());
    const bool determined =
        estimate_uncertainty(at, finer_, measured.variances(), measured.noise_known(), result);
    const bool bounded = std::any_of(at.fixed.begin(), at.fixed.end(), [](bool fixed) { return fixed; });
    if (!(good || (solved && (within(p, result, 10.0) || !determined))))
      result.status = FitStatus::not_converged;
    else if (bounded)
      result.status = FitStatus::at_bound;
    else if (!determined || weakly_determined(p, result))
      result.status = FitStatus::ill_conditioned;
    else
      result.status = FitStatus::converged;
  }

  static bool within(const Parameters& p, const FitResult& result, double factor) {
    for (std::size_t k = 0; k < p.size(); ++k) {
      double tolerance = factor * (k == 0 ? position_tolerance_nm : relative_tolerance * std::abs(p[k]));
      if (result.std_errors[k] > 0.0) tolerance = std::max(tolerance, 0.01 * result.std_errors[k]);
      if (!(std::abs(result.quadrature_errors[k]) <= tolerance)) return false;
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
  Residuals<Model> residuals_;
  Solver solver_;
  typename Solver::Parameters x_;
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd differences_, finer_;
  std::vector<Bounds> bounds_;
  std::uint32_t iterations_ = 0;
};

}  // namespace combforce
