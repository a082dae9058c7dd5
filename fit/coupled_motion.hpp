// Small changes of the motion off the comb, which feel the force that they change themselves:
//     (1 - chi G) o = r,   (G o)_n = sum_m G_(n-m) o_m, m of either sign,
// at the harmonics off the comb up to where |chi| has fallen to 2 % of the static compliance for good;
// beyond, o = r, and what moves there is not felt. G is the spectrum of dF/dd along the motion.
//
// The harmonics with the greatest |chi| are solved for densely, and this, with the others left as they are,
// is the preconditioner of GMRES (Saad, Schultz 1986, SIAM J. Sci. Stat. Comput. 7, 856) for all: a product
// with G is one with F'(d(t)) in time, two real FFTs. Groups of weaker harmonics, the mean's and the
// overtones', do not settle by substitution once the contact is as stiff as the lever.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "dsp/fourier.hpp"
#include "fit/force_gradient.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates; it takes FFTW's planner lock (dsp/fftw.hpp).
class CoupledMotion {
 public:
  using Complex = std::complex<double>;

  // `harmonics` outlives it.
  explicit CoupledMotion(const Harmonics& harmonics);

  // What follows is for this gradient, whose spans need not outlive the call.
  void set_gradient(const ForceGradient& gradient);

  // Replaces r by o, harmonics 0 … band, nm, to `tolerance` of |r|, or as near as 16 directions come; values
  // at the tones become 0. Returns what is left, |r - (1 - chi G) o|, nm; r where it is not finite.
  double solve(std::span<Complex> motion, double tolerance);

  // What a motion at any harmonics, 0 … band, does to the force: G o, nN, at the comb's tones, in its order.
  void force(std::span<const Complex> motion, std::span<Complex> at_tones);
  // Replaces a motion by what that force in turn moves off the comb: chi G o, nm, 0 at the tones.
  void respond(std::span<Complex> motion);

 private:
  static constexpr std::size_t most_directions = 16;

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  void feel(std::span<const Complex> motion);
  void apply(const Eigen::VectorXd& in, Eigen::VectorXd& out);
  void precondition(const Eigen::VectorXd& in, Eigen::VectorXd& out);
  Eigen::Index minimize(const Eigen::VectorXd& right, double tolerance);

  const Harmonics* harmonics_;
  std::size_t coupled_;  // harmonics 0 … coupled_ - 1 take part, those beyond move too little
  FourierTransform transform_;
  Eigen::MatrixXd matrix_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
  Eigen::VectorXd strong_, strong_solved_;
  bool viscous_ = false;
  double spacing_ = 0.0;                          // rad/s
  std::vector<double> by_surface_, by_velocity_;  // dF/dp0 and dF/d(velocity) over the period
  std::vector<double> resistance_;                // force of a motion's velocity over the period
  std::vector<Complex> phasors_;                  // of the coupled harmonics
  // GMRES: vectors hold (re, im) of the coupled harmonics.
  std::vector<Eigen::VectorXd> directions_;
  Eigen::MatrixXd hessenberg_;
  Eigen::VectorXd cosines_, sines_, rotated_, right_, image_, moved_;
};

}  // namespace combforce
