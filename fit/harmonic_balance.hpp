// The force balance at every harmonic of a pixel: the measured motion at the tones with a motion off the
// comb, the forces of a model along both, and how these answer to changes of the parameters and of the
// motion.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "fit/bounded.hpp"
#include "fit/box_least_squares.hpp"
#include "fit/force_gradient.hpp"
#include "fit/force_model.hpp"
#include "fit/force_spectrum.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
template <typename Model>
class HarmonicBalance {
 public:
  static constexpr std::size_t count = Model::parameters;
  using Parameters = std::array<double, count>;
  using Coordinates = Eigen::Matrix<double, count, 1>;  // unbounded: bounded.hpp
  using Spectrum = ForceSpectrum::Spectrum;
  using Complex = std::complex<double>;

  // `harmonics` outlives the balance.
  explicit HarmonicBalance(const Harmonics& harmonics)
      : harmonics_(&harmonics),
        spectrum_(harmonics.highest_tone(), harmonics.band(), harmonics.spacing_hz()),
        motion_(harmonics.band() + 1),
        force_(harmonics.band() + 1),
        tones_(harmonics.tones().size()),
        forces_(harmonics.tones().size()),
        whitening_(rows(), rows()),
        scratch_(rows()) {
    for (auto* derivatives : {&derivatives_, &derivatives_beside_})
      for (Spectrum& derivative : *derivatives) derivative.resize(motion_.size());
    for (Spectrum* spectrum : {&deviation_, &deviated_, &beside_}) spectrum->resize(motion_.size());
    if (DependsOnVelocity<Model>)
      for (Spectrum* damping : {&damping_, &damping_beside_}) damping->resize(motion_.size());
  }

  const Harmonics& harmonics() const { return *harmonics_; }
  // Of residuals at the tones: (re, im) of each.
  Eigen::Index rows() const { return static_cast<Eigen::Index>(2 * harmonics_->tones().size()); }

  // `tones`: measured motion, nm; `forces`: measured forces, nN; one a tone each.
  void set_measured(std::span<const Complex> tones, std::span<const Complex> forces) {
    std::ranges::copy(tones, tones_.begin());
    std::ranges::copy(forces, forces_.begin());
  }
  // Lower triangular L: residuals at the tones and their Jacobian are multiplied by L^-1 before they are
  // squared. The covariance of the measured forces is L L' where it is known.
  void set_whitening(const Eigen::MatrixXd& root) { whitening_ = root; }
  const Eigen::MatrixXd& whitening() const { return whitening_; }
  template <typename Matrix>
  void whiten(Matrix&& values) const {
    whitening_.template triangularView<Eigen::Lower>().solveInPlace(std::forward<Matrix>(values));
  }

  void set_bounds(std::span<const Bounds> bounds) {
    for (std::size_t k = 0; k < count; ++k) bounded_[k] = Bounded(bounds[k].lower, bounds[k].upper);
  }
  const Bounded& bounded(std::size_t k) const { return bounded_[k]; }
  Coordinates coordinates(const Parameters& p) const {
    Coordinates x;
    for (std::size_t k = 0; k < count; ++k) x(index(k)) = bounded_[k].inverse(p[k]);
    return x;
  }
  Parameters parameters(const Coordinates& x) const {
    Parameters p;
    for (std::size_t k = 0; k < count; ++k) p[k] = bounded_[k].value(x(index(k)));
    return p;
  }
  // dp_k/dx_k.
  double slope(std::size_t k, const Coordinates& x) const {
    return bounded_[k].slope(x(index(k)), bounded_[k].value(x(index(k))));
  }

  // By what to shorten a step from x so that it stays where a linear step means anything: 1 for short ones.
  template <typename Step>
  double shortening(const Coordinates& x, const Step& step) const {
    double shortening = 1.0;
    for (std::size_t k = 0; k < count; ++k) {
      const double change = std::abs(step(index(k)) * slope(k, x));
      const double p = std::abs(bounded_[k].value(x(index(k))));
      shortening = std::min(shortening, (k == 0 ? longest_step_nm : longest_step * p) / change);
    }
    return shortening;
  }

  // Harmonics 0 … band, nm. What it holds at the tones is overwritten by what was measured.
  Spectrum& motion() { return motion_; }
  const Spectrum& motion() const { return motion_; }

  // Heat moves the tip besides, normally distributed with this standard deviation over the period, nm, as
  // phasors of harmonics 0 … band, all 0 at first: forces and derivatives are their means, by Gauss and
  // Hermite's three points, exact for forces up to the fifth power of d.
  void set_deviation(const Spectrum& deviation) { deviation_ = deviation; }
  void remove_deviation() { std::ranges::fill(deviation_, 0.0); }
  const Spectrum& deviation() const { return deviation_; }

  // Evaluates the model's force along the motion, with `linearize` also its derivatives, on this level of the
  // quadrature.
  void evaluate(const Parameters& p, std::size_t level) {
    complete_motion();
    spectrum_.set_motion(motion_);
    spectrum_.template force<Model>(p.data(), level, force_);
    if (!deviates()) return;
    scale(still_share, force_);
    for (const double side : {1.0, -1.0}) {
      deviate(side);
      spectrum_.template force<Model>(p.data(), level, beside_);
      add(side_share, beside_, force_);
    }
  }
  void linearize(const Parameters& p, std::size_t level) {
    complete_motion();
    spectrum_.set_motion(motion_);
    spectrum_.template linearize<Model>(p.data(), level, force_, derivatives_, damping_);
    if (!deviates()) return;
    scale(still_share, force_);
    scale(still_share, damping_);
    for (auto& derivative : derivatives_) scale(still_share, derivative);
    for (const double side : {1.0, -1.0}) {
      deviate(side);
      spectrum_.template linearize<Model>(p.data(), level, beside_, derivatives_beside_, damping_beside_);
      add(side_share, beside_, force_);
      add(side_share, damping_beside_, damping_);
      for (std::size_t k = 0; k < count; ++k) add(side_share, derivatives_beside_[k], derivatives_[k]);
    }
  }

  // Phasors of harmonics 0 … band: the force, nN, and dF/dp_k.
  const Spectrum& force() const { return force_; }
  const Spectrum& derivative(std::size_t k) const { return derivatives_[k]; }
  // F_model - F_measured at a tone, nN.
  Complex residual(std::size_t tone) const { return force_[harmonics_->tones()[tone]] - forces_[tone]; }
  // |L^-1 F|^2 of the measured forces.
  double measured_square() const {
    for (std::size_t i = 0; i < forces_.size(); ++i) {
      scratch_(index(2 * i)) = forces_[i].real();
      scratch_(index(2 * i + 1)) = forces_[i].imag();
    }
    whiten(scratch_);
    return scratch_.squaredNorm();
  }

  // How changes of the motion change the force. After linearize().
  ForceGradient gradient() const { return {derivatives_[0], damping_, harmonics_->angular_frequency(1)}; }
  // What changes of the motion at the harmonics `columns` do to the forces at `rows`, (re, im) each.
  void couple(std::span<const std::size_t> rows, std::span<const std::size_t> columns,
              Eigen::MatrixXd& matrix) const {
    const ForceGradient gradient = this->gradient();
    for (std::size_t j = 0; j < columns.size(); ++j)
      for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto [re, im] = gradient.coupling(rows[i], columns[j]);
        matrix(index(2 * i), index(2 * j)) = re.real();
        matrix(index(2 * i + 1), index(2 * j)) = re.imag();
        matrix(index(2 * i), index(2 * j + 1)) = im.real();
        matrix(index(2 * i + 1), index(2 * j + 1)) = im.imag();
      }
  }

 private:
  // Of the surface position, and relative, of the others.
  static constexpr double longest_step_nm = 2.0, longest_step = 0.7;
  // Of Gauss and Hermite's points at 0 and at -+ sqrt(3) standard deviations.
  static constexpr double still_share = 2.0 / 3.0, side_share = 1.0 / 6.0;

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  void complete_motion() {
    for (std::size_t i = 0; i < tones_.size(); ++i) motion_[harmonics_->tones()[i]] = tones_[i];
  }
  bool deviates() const { return deviation_[0].real() > 0.0; }
  void deviate(double side) {
    for (std::size_t n = 0; n < motion_.size(); ++n)
      deviated_[n] = motion_[n] + side * std::numbers::sqrt3 * deviation_[n];
    spectrum_.set_motion(deviated_);
  }
  static void scale(double share, Spectrum& values) {
    for (Complex& value : values) value *= share;
  }
  static void add(double share, const Spectrum& from, Spectrum& to) {
    for (std::size_t n = 0; n < to.size(); ++n) to[n] += share * from[n];
  }

  const Harmonics* harmonics_;
  ForceSpectrum spectrum_;
  Spectrum motion_, force_;
  std::array<Spectrum, count> derivatives_;
  Spectrum damping_;  // dF/d(velocity)
  Spectrum deviation_, deviated_;
  Spectrum beside_, damping_beside_;
  std::array<Spectrum, count> derivatives_beside_;
  std::vector<Complex> tones_, forces_;
  Eigen::MatrixXd whitening_;  // L
  mutable Eigen::VectorXd scratch_;
  std::array<Bounded, count> bounded_;
};

}  // namespace combforce
