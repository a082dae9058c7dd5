// The fit beyond the paper: parameters and the motion off the comb, found together.
//
// The paper takes the measured tones for the whole motion. But the model's force acts at every frequency, and
// what it moves off the comb (mean, sidebands, harmonics) changes the force. Here the motion is the measured
// tones and, at every other harmonic n of the period up to a band limit, o_n = chi_n F_n(p, motion); the
// parameters minimise the whitened residuals of the force balance (paper, equation 8) at the tones under that
// constraint.
//
// Gauss-Newton on p and o together. With G the spectrum of F'(d(t)), a change of motion changes the force at
// n by sum_m G_(n-m) o_m + conjugate part, so the constraint linearised is (1 - chi G) do = chi dF/dp dp +
// rho, which coupled_motion.hpp solves for all harmonics at once: substitution diverges for stiff contacts
// and low set-points.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "fit/coupled_motion.hpp"
#include "fit/fit_result.hpp"
#include "fit/harmonic_balance.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class SelfConsistentFit {
 public:
  static constexpr std::size_t count = Model::parameters;
  using Parameters = std::array<double, count>;

  struct Solution {
    Parameters p{};
    double cost = std::numeric_limits<double>::infinity();  // |L^-1 residuals|^2
    std::uint32_t iterations = 0;
    bool converged = false;
    std::array<bool, max_parameters> fixed{};  // at a bound
  };

  // `balance` outlives the fit and holds the motion it starts from, and ends with.
  explicit SelfConsistentFit(HarmonicBalance<Model>& balance)
      : balance_(&balance),
        harmonics_(&balance.harmonics()),
        rows_(balance.rows()),
        coupled_(*harmonics_),
        moved_(harmonics_->band() + 1),
        forces_(harmonics_->tones().size()),
        slopes_(harmonics_->tones().size()) {
    const std::size_t size = harmonics_->band() + 1;
    for (Linearized* at : {&current_, &best_}) {
      at->base.resize(size);
      for (auto& response : at->response) response.resize(size);
      at->residuals.resize(rows_);
      at->jacobian.resize(rows_, count);
    }
  }

  // What the cost must promise to fall by for a step longer than linear ones to be gone, and for another to
  // be tried after a step that failed, at first 0. What noise hides so well has no minimum worth finding, as
  // the reach of a force that is not there; nor one that the Jacobian, good to a percent, cannot tell from
  // the best so far.
  void set_insignificant(double decrease) { insignificant_ = decrease; }

  // From p and the motion off the comb that the balance holds, at most `most` iterations.
  Solution solve(const Parameters& p, std::size_t level, std::uint32_t most) {
    Solution solution;
    Coordinates x = balance_->coordinates(p), step = Coordinates::Zero(), whole = step;
    best_.x = x;
    best_.cost = best_.inconsistency = std::numeric_limits<double>::infinity();
    double damping = 0.0;
    std::size_t watched = 0;
    while (solution.iterations < most && !solution.converged) {
      ++solution.iterations;
      linearize(x, level);
      const bool better = is_better(current_, best_), finite = std::isfinite(current_.cost);
      if (better) {
        std::swap(current_, best_);
        damping = damping > least_damping ? 0.1 * damping : 0.0;
        watched = 0;
      } else if (finite && is_consistent(best_) && is_small(step, best_)) {
        solution.converged = true;
        break;
      } else if (finite && is_consistent(best_) && watched == 0 && damping <= little_damping &&
                 decrease(step, best_) <= insignificant_) {
        go_back(level);
        x = best_.x;
        solution.converged = true;
        break;
      } else if (finite && current_.inconsistency < best_.inconsistency && is_small(step, best_)) {
        std::swap(current_, best_);  // so small a step tells the cost of the motion, not of the parameters
        watched = 0;
      } else if (++watched > watch || !finite) {
        damping = std::max(30.0 * damping, least_damping);
        watched = 0;
      }
      const Linearized& from = watched > 0 ? current_ : best_;
      if (!std::isfinite(from.cost)) break;
      Coordinates next = damped_step(from, damping);
      const double shortening = balance_->shortening(from.x, next);
      if (better && shortening < 1.0 && decrease(next, from) <= insignificant_ && is_consistent(from)) {
        solution.converged = true;
        break;
      }
      next *= shortening;
      step = better || watched > 0 ? relaxed(next, whole, step) : next;
      whole = next;
      x = from.x + step;
      solution.converged = better && is_small(step, from) && is_consistent(from);
      move(x, from);
    }
    if (!solution.converged) x = best_.x;
    solution.p = balance_->parameters(x);
    for (std::size_t k = 0; k < count; ++k) solution.fixed[k] = balance_->bounded(k).at_bound(x(index(k)));
    solution.cost = best_.cost;
    return solution;
  }

  // Until release(), solutions keep this parameter where they start.
  void hold(std::size_t parameter) { held_ = parameter; }
  void release() { held_ = count; }

  // Of the last solution: F_model - F_measured, rows (re, im) of every tone, and its total derivative with
  // respect to the parameters, the motion off the comb following; both whitened.
  const Eigen::VectorXd& residuals() const { return best_.residuals; }
  const Eigen::MatrixXd& jacobian() const { return best_.jacobian; }

  // Of the last solution, when it converged: dF_model/dd, nN/nm, by (re, im) of every tone's motion, the
  // motion off the comb following. rows x rows.
  void stiffness_at_tones(Eigen::MatrixXd& derivative) {
    const auto tones = harmonics_->tones();
    for (Eigen::Index column = 0; column < rows_; ++column) {
      std::ranges::fill(moved_, 0.0);
      const Complex one = column % 2 == 0 ? Complex(1.0, 0.0) : Complex(0.0, 1.0);
      moved_[tones[static_cast<std::size_t>(column / 2)]] = one;
      coupled_.force(moved_, forces_);
      coupled_.respond(moved_);
      coupled_.solve(moved_, response_tolerance);
      coupled_.force(moved_, slopes_);
      for (std::size_t i = 0; i < tones.size(); ++i) {
        derivative(index(2 * i), column) = (forces_[i] + slopes_[i]).real();
        derivative(index(2 * i + 1), column) = (forces_[i] + slopes_[i]).imag();
      }
    }
  }

  // Of the last solution: what a change of the model's force, harmonics 0 … band, changes at the tones, the
  // motion off the comb following; rows as above, whitened.
  void follow(const ForceSpectrum::Spectrum& force, Eigen::VectorXd& change) {
    respond(force, {}, moved_, response_tolerance);
    coupled_.force(moved_, forces_);
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      const Complex whole = force[harmonics_->tones()[i]] + forces_[i];
      change(index(2 * i)) = whole.real();
      change(index(2 * i + 1)) = whole.imag();
    }
    balance_->whiten(change);
  }

  // Of the last solution: virial and dissipated power of the force that moves the tip off the comb.
  struct Exchange {
    double virial_nn_nm = 0.0, dissipated_fw = 0.0;
  };
  Exchange off_comb_exchange() const {
    Exchange sum;
    for (std::size_t n = 0; n < best_.base.size(); ++n) {
      if (harmonics_->is_tone(n)) continue;
      const Complex product = std::norm(best_.base[n]) / harmonics_->response()[n];  // F conj(o)
      sum.virial_nn_nm += (n == 0 ? 1.0 : 0.5) * product.real();
      sum.dissipated_fw -= 0.5 * harmonics_->angular_frequency(n) * product.imag() * 1e-3;
    }
    return sum;
  }

  // Of the last solution: by how much the next finer quadrature changes the model's phasors, rows as above,
  // whitened.
  void refine_quadrature(const Parameters& p, std::size_t level, Eigen::VectorXd& change) {
    change.setZero();
    for (const double sign : {-1.0, 1.0}) {
      balance_->evaluate(p, sign < 0.0 ? level : level + 1);
      for (Eigen::Index i = 0; i < rows_ / 2; ++i) {
        const Complex force = balance_->force()[harmonics_->tones()[static_cast<std::size_t>(i)]];
        change(2 * i) += sign * force.real();
        change(2 * i + 1) += sign * force.imag();
      }
    }
    balance_->whiten(change);
  }

 private:
  using Coordinates = typename HarmonicBalance<Model>::Coordinates;
  using Spectrum = ForceSpectrum::Spectrum;
  using Complex = std::complex<double>;

  struct Linearized {  // at x and a motion
    Coordinates x = Coordinates::Zero();
    Spectrum base;                         // motion off the comb after the Newton step at fixed parameters
    std::array<Spectrum, count> response;  // its derivatives
    Eigen::VectorXd residuals;             // at `base`, to first order; whitened
    Eigen::MatrixXd jacobian;              // total, by parameters; whitened
    double cost = std::numeric_limits<double>::infinity();
    double inconsistency = 0.0;  // sum of the squares of the motion's Newton step and of what it leaves, nm^2
  };

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  // Evaluates the model at x along the motion, and solves the linearised constraint.
  void linearize(const Coordinates& x, std::size_t level) {
    balance_->linearize(balance_->parameters(x), level);
    current_.x = x;
    coupled_.set_gradient(balance_->gradient());
    const double left = respond(balance_->force(), balance_->motion(), current_.base, motion_tolerance);
    current_.inconsistency = left * left;
    for (std::size_t n = 0; n < current_.base.size(); ++n)
      if (!harmonics_->is_tone(n))
        current_.inconsistency += std::norm(current_.base[n] - balance_->motion()[n]);
    for (std::size_t k = 0; k < count; ++k)
      respond(balance_->derivative(k), {}, current_.response[k], response_tolerance);
    project();
  }

  // The cost is that of a motion to first order only: one a little greater is worth as much where the motion
  // is closer to what the force makes of it (as in a filter: Fletcher, Leyffer 2002, Math. Program. 91, 239).
  static bool is_better(const Linearized& one, const Linearized& other) {
    return one.cost < other.cost || (!is_consistent(other) && one.cost < forgiven * other.cost &&
                                     one.inconsistency < closer * other.inconsistency);
  }

  // The cost is that of the motion to 1e-3 or so.
  static bool is_consistent(const Linearized& at) { return at.inconsistency < consistent_nm * consistent_nm; }

  // motion + do where (1 - chi G) do = chi force - motion; returns what of that is left.
  double respond(const Spectrum& force, std::span<const Complex> motion, Spectrum& out, double relative) {
    const auto& chi = harmonics_->response();
    for (std::size_t n = 0; n < out.size(); ++n)
      out[n] = chi[n] * force[n] - (motion.empty() ? 0.0 : motion[n]);
    const double left = coupled_.solve(out, relative);
    for (std::size_t n = 0; n < motion.size(); ++n)
      if (!harmonics_->is_tone(n)) out[n] += motion[n];
    return left;
  }

  // Everything as at the best point, its motion a step further.
  void go_back(std::size_t level) {
    move(best_.x, best_);
    linearize(Coordinates(best_.x), level);
    std::swap(current_, best_);
  }

  // Residuals at the tones after the motion's step, and their total derivatives.
  void project() {
    const auto tones = harmonics_->tones();
    std::ranges::transform(current_.base, balance_->motion(), moved_.begin(), std::minus{});
    for (const std::size_t tone : tones) moved_[tone] = 0.0;
    coupled_.force(moved_, forces_);
    for (std::size_t i = 0; i < tones.size(); ++i) {
      const Complex residual = balance_->residual(i) + forces_[i];
      current_.residuals(index(2 * i)) = residual.real();
      current_.residuals(index(2 * i + 1)) = residual.imag();
    }
    for (std::size_t k = 0; k < count; ++k) {
      coupled_.force(current_.response[k], slopes_);
      for (std::size_t i = 0; i < tones.size(); ++i) {
        const Complex slope = balance_->derivative(k)[tones[i]] + slopes_[i];
        current_.jacobian(index(2 * i), index(k)) = slope.real();
        current_.jacobian(index(2 * i + 1), index(k)) = slope.imag();
      }
    }
    balance_->whiten(current_.residuals);
    balance_->whiten(current_.jacobian);
    current_.cost = current_.residuals.squaredNorm();
  }

  // Levenberg-Marquardt step of the coordinates, however long.
  Coordinates damped_step(const Linearized& at, double damping) const {
    Eigen::Matrix<double, count, count> normal = Eigen::Matrix<double, count, count>::Zero();
    Coordinates right = Coordinates::Zero(), scale;
    for (Eigen::Index row = 0; row < rows_; ++row) {
      for (std::size_t k = 0; k < count; ++k) {
        const double at_k = held_ == k ? 0.0 : at.jacobian(row, index(k)) * balance_->slope(k, at.x);
        right(index(k)) -= at_k * at.residuals(row);
        for (std::size_t l = 0; l < count; ++l)
          normal(index(k), index(l)) += at_k * at.jacobian(row, index(l)) * balance_->slope(l, at.x);
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const double diagonal = normal(index(k), index(k));
      scale(index(k)) = diagonal > 0.0 ? 1.0 / std::sqrt(diagonal) : 0.0;
    }
    normal = scale.asDiagonal() * normal * scale.asDiagonal();
    normal.diagonal().setConstant(1.0 + damping);
    const Coordinates scaled = scale.asDiagonal() * right;
    return scale.asDiagonal() * normal.ldlt().solve(scaled);
  }

  // Where the residuals are large Gauss-Newton steps overshoot, even to and fro without end. Near the minimum
  // they change linearly, by `next` - `whole` over the last step `taken`: so far as that says, `next` ends in
  // the minimum.
  static Coordinates relaxed(const Coordinates& next, const Coordinates& whole, const Coordinates& taken) {
    const double overshoot = (whole - next).dot(taken) / taken.squaredNorm();
    return overshoot > 1.0 ? Coordinates(next / std::min(overshoot, most_relaxation)) : next;
  }

  // Nothing changes any more: the parameters, or where the residuals are not small, their squares.
  bool is_small(const Coordinates& step, const Linearized& at) const {
    bool still = true;
    for (std::size_t k = 0; k < count; ++k) {
      const double change = std::abs(step(index(k)) * balance_->slope(k, at.x));
      const double p = std::abs(balance_->bounded(k).value(at.x(index(k))));
      still = still && change <= tolerance * (k == 0 ? 1.0 : p);
    }
    return still || decrease(step, at) <= cost_tolerance * at.cost;
  }

  // Of the cost by a step, where it is nearly linear.
  double decrease(const Coordinates& step, const Linearized& at) const {
    double decrease = 0.0;
    for (Eigen::Index row = 0; row < rows_; ++row) {
      double change = 0.0;
      for (std::size_t k = 0; k < count; ++k)
        change += at.jacobian(row, index(k)) * balance_->slope(k, at.x) * step(index(k));
      decrease += change * change;
    }
    return decrease;
  }

  // The motion at x, to first order.
  void move(const Coordinates& x, const Linearized& from) {
    const Parameters to = balance_->parameters(x), p = balance_->parameters(from.x);
    Spectrum& motion = balance_->motion();
    for (std::size_t n = 0; n < motion.size(); ++n) {
      Complex value = from.base[n];
      for (std::size_t k = 0; k < count; ++k) value += (to[k] - p[k]) * from.response[k][n];
      motion[n] = value;
    }
  }

  // Of what CoupledMotion is to solve: its answer is a step, of a search that goes on.
  static constexpr double motion_tolerance = 1e-2, response_tolerance = 1e-2;
  static constexpr double consistent_nm = 1e-4;
  static constexpr double forgiven = 1.1, closer = 0.5;  // of cost and inconsistency
  static constexpr double cost_tolerance = 1e-6;         // relative
  static constexpr double tolerance = 2e-6;              // nm, or relative
  // A step along a curved trench first leads up its wall: so many iterations may pass before a better one,
  // then the search goes back (watchdog technique, Chamberlain et al. 1982).
  static constexpr std::size_t watch = 3;
  static constexpr double least_damping = 1e-8;
  static constexpr double little_damping = 1.0;  // up to which a step promises a quarter of what there is
  static constexpr double most_relaxation = 10.0;

  std::size_t held_ = count;  // none
  double insignificant_ = 0.0;
  HarmonicBalance<Model>* balance_;
  const Harmonics* harmonics_;
  Eigen::Index rows_;
  CoupledMotion coupled_;
  Spectrum moved_;
  std::vector<Complex> forces_, slopes_;  // one a tone
  Linearized current_, best_;
};

}  // namespace combforce
