// Starts for self_consistent.hpp where the force moves the tip much off the comb, as between the products of
// intermodulation about one mode: there Gauss-Newton from the measured motion alone goes astray.
//
// The force balance of the strongly coupled harmonics off the comb is not a constraint here but residuals
// beside those of the tones, whose weight grows in stages (quadratic penalty method: Nocedal and Wright,
// Numerical Optimization, 2006, 17.1). At first the motion off the comb may be what explains the tones; as
// the weight grows it becomes what the force makes of it. Each stage is solved for the parameters and that
// motion together by Levenberg-Marquardt with Nielsen's damping (Madsen, Nielsen, Tingleff 2004, 3.2); the
// motion elsewhere off the comb follows by substitution.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>

#include "fit/harmonic_balance.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class LoosenedBalance {
 public:
  using Parameters = typename HarmonicBalance<Model>::Parameters;

  // `balance` outlives this.
  explicit LoosenedBalance(HarmonicBalance<Model>& balance)
      : balance_(&balance),
        harmonics_(&balance.harmonics()),
        rows_(balance.rows()),
        strong_(index(2 * harmonics_->strong().size())),
        residuals_(rows_ + strong_),
        trial_(rows_ + strong_),
        jacobian_(rows_ + strong_, count + strong_),
        normal_(count + strong_, count + strong_),
        damped_(count + strong_, count + strong_),
        factor_(count + strong_),
        gradient_(count + strong_),
        step_(count + strong_),
        coupling_(std::max(rows_, strong_), strong_),
        motion_(harmonics_->band() + 1),
        force_(harmonics_->band() + 1) {}

  // From p and no motion off the comb; `looseness`: of the first stage, in units of the tones' noise, >= 1.
  // True when the forces at the tones are explained but for some percent: then p and the balance's motion are
  // a start. Adds to `iterations`.
  bool approach(Parameters& p, std::size_t level, double looseness, std::uint32_t& iterations) {
    Spectrum& motion = balance_->motion();
    std::ranges::fill(motion, 0.0);
    Coordinates x = balance_->coordinates(p);
    double logarithm = 0.0;
    for (Eigen::Index i = 0; i < rows_; ++i) logarithm += std::log(balance_->whitening()(i, i));
    const double noise_nn = std::exp(logarithm / static_cast<double>(rows_));
    double cost = 0.0;
    for (double loose = looseness; loose > 1.0; loose /= stage_ratio) {
      cost = tighten(x, level, loose * noise_nn, stage_iterations, iterations);
      if (cost > hopeless * balance_->measured_square()) return false;
    }
    cost = tighten(x, level, noise_nn, last_iterations, iterations);
    p = balance_->parameters(x);
    return cost <= explained * balance_->measured_square();
  }

  // Of the squares of the whitened measured forces, to be left in the end; and what no stage that led there
  // has left (two thirds at most, of 120 pixels of intermodulation).
  static constexpr double explained = 0.01, hopeless = 0.8;

 private:
  using Coordinates = typename HarmonicBalance<Model>::Coordinates;
  using Spectrum = ForceSpectrum::Spectrum;
  using Complex = std::complex<double>;
  static constexpr Eigen::Index count = Model::parameters;
  static constexpr double stage_ratio = 3.2;
  static constexpr std::uint32_t stage_iterations = 15, last_iterations = 40;
  static constexpr double solved = 1e-3;  // |residuals|^2, far below what noise leaves
  static constexpr double least_decrease = 1e-3;
  static constexpr int most_stalled = 5;
  static constexpr double most_damping = 1e8;
  static constexpr Eigen::Index tile = 32;

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  // Levenberg-Marquardt at one weight, from x and the balance's motion; returns the least cost.
  double tighten(Coordinates& x, std::size_t level, double noise_nn, std::uint32_t most,
                 std::uint32_t& iterations) {
    double damping = 1e-3, growth = 2.0;
    int stalled = 0;
    bool moved = true;
    double cost = 0.0;
    for (std::uint32_t i = 0; i < most && stalled < most_stalled && damping < most_damping; ++i) {
      ++iterations;
      if (moved) {
        balance_->linearize(balance_->parameters(x), level);
        set_residuals(noise_nn, residuals_);
        cost = residuals_.squaredNorm();
        if (!std::isfinite(cost) || cost < solved) break;
        set_jacobian(x, noise_nn);
        set_normal();
      }
      damped_ = normal_;
      damped_.diagonal() *= 1.0 + damping;
      factor_.compute(damped_);
      step_ = factor_.solve(gradient_);
      step_ *= balance_->shortening(x, step_);
      motion_ = balance_->motion();
      force_ = balance_->force();
      const Coordinates next = x - step_.template head<count>();
      move();
      balance_->evaluate(balance_->parameters(next), level);
      set_residuals(noise_nn, trial_);
      const double trial = trial_.squaredNorm();
      moved = trial < cost;
      if (moved) {
        trial_.noalias() = residuals_ - jacobian_ * step_;
        const double gain = (cost - trial) / (cost - trial_.squaredNorm());
        stalled = cost - trial < least_decrease * cost ? stalled + 1 : 0;
        damping *= std::max(0.2, 1.0 - std::pow(2.0 * gain - 1.0, 3.0));
        growth = 2.0;
        x = next;
        cost = trial;
      } else {
        balance_->motion() = motion_;
        damping *= growth;
        growth *= 2.0;
      }
    }
    return cost;
  }

  // Those of the tones whitened; those of the strong harmonics F - o/chi over noise_nn.
  void set_residuals(double noise_nn, Eigen::VectorXd& out) const {
    for (std::size_t i = 0; i < harmonics_->tones().size(); ++i) set(out, 2 * i, balance_->residual(i));
    balance_->whiten(out.head(rows_));
    const auto strong = harmonics_->strong();
    for (std::size_t s = 0; s < strong.size(); ++s) {
      const std::size_t n = strong[s];
      const Complex residual =
          (balance_->force()[n] - balance_->motion()[n] / harmonics_->response()[n]) / noise_nn;
      set(out, static_cast<std::size_t>(rows_) + 2 * s, n == 0 ? residual.real() : residual);
    }
  }
  static void set(Eigen::Ref<Eigen::VectorXd> out, std::size_t row, Complex value) {
    out(index(row)) = value.real();
    out(index(row + 1)) = value.imag();
  }

  // Columns: coordinates of the parameters, then (re, im) of the motion at every strong harmonic.
  void set_jacobian(const Coordinates& x, double noise_nn) {
    const auto strong = harmonics_->strong();
    const auto tones = harmonics_->tones();
    for (Eigen::Index k = 0; k < count; ++k) {
      const Spectrum& derivative = balance_->derivative(static_cast<std::size_t>(k));
      const double slope = balance_->slope(static_cast<std::size_t>(k), x);
      for (std::size_t i = 0; i < tones.size(); ++i)
        set(jacobian_.col(k), 2 * i, slope * derivative[tones[i]]);
      for (std::size_t s = 0; s < strong.size(); ++s)
        set(jacobian_.col(k), static_cast<std::size_t>(rows_) + 2 * s,
            slope / noise_nn * derivative[strong[s]]);
    }
    balance_->couple(tones, strong, coupling_);
    jacobian_.topRightCorner(rows_, strong_) = coupling_.topRows(rows_);
    balance_->whiten(jacobian_.topRows(rows_));
    balance_->couple(strong, strong, coupling_);
    for (std::size_t s = 0; s < strong.size(); ++s) {
      const Complex inverse = 1.0 / harmonics_->response()[strong[s]];
      const Eigen::Index re = index(2 * s), im = re + 1;
      coupling_(re, re) -= inverse.real();
      coupling_(re, im) += inverse.imag();
      coupling_(im, re) -= inverse.imag();
      coupling_(im, im) -= inverse.real();
    }
    jacobian_.bottomRightCorner(strong_, strong_) = coupling_.topRows(strong_) / noise_nn;
  }

  // J'J and J'r, by tiles: a product of larger matrices would allocate.
  void set_normal() {
    const Eigen::Index size = normal_.rows();
    for (Eigen::Index column = 0; column < size; column += tile)
      for (Eigen::Index row = column; row < size; row += tile) {
        const Eigen::Index rows = std::min(tile, size - row), columns = std::min(tile, size - column);
        normal_.block(row, column, rows, columns).noalias() =
            jacobian_.middleCols(row, rows).transpose() * jacobian_.middleCols(column, columns);
      }
    gradient_.noalias() = jacobian_.transpose() * residuals_;
  }

  // The strong harmonics by the step, the others by what force_ makes of them.
  void move() {
    Spectrum& motion = balance_->motion();
    for (std::size_t n = 0; n < motion.size(); ++n) motion[n] = harmonics_->response()[n] * force_[n];
    const auto strong = harmonics_->strong();
    for (std::size_t s = 0; s < strong.size(); ++s) {
      const Eigen::Index at = count + index(2 * s);
      motion[strong[s]] = motion_[strong[s]] - Complex(step_(at), step_(at + 1));
    }
    motion[0] = motion[0].real();
  }

  HarmonicBalance<Model>* balance_;
  const Harmonics* harmonics_;
  Eigen::Index rows_, strong_;
  Eigen::VectorXd residuals_, trial_;
  Eigen::MatrixXd jacobian_, normal_, damped_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd gradient_, step_;
  Eigen::MatrixXd coupling_;
  Spectrum motion_, force_;  // where the step began
};

}  // namespace combforce
