// The thermal motion of a tip that moves over a surface, as the tones of a window see it.
//
// A small motion besides the periodic one is a linear system whose coefficients are periodic: heat f at w +
// n W (W: spacing of the harmonics) moves the tip at all w + m W,
//
//     d(w + n W)/chi(w + n W) = sum_m G_(n-m) d(w + m W) + f(w + n W),   n of either sign,
//
// with G the spectrum of dF/dd along the motion. A window of n_w T, itself g n_w periods of W, sees all of it
// at a tone c with the weights sinc(g n_w (n - c + w/W)): so motion that does not repeat after a window,
// which leaks from one tone to all others, is counted as what it is. The integral over w takes few points:
// Gauss's for the weight sinc^2, so many that 1 % or less of the variance of the sharpest mode is left as
// long as it rings for no more than four windows. Sharper modes are told the worse the longer they ring; but
// where they do, pixels have not settled.
//
// Without a surface this is the thermal motion of the free cantilever.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <complex>
#include <cstddef>
#include <vector>

#include "fit/cantilever.hpp"
#include "fit/force_gradient.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class EngagedHeat {
 public:
  // `windows`: contiguous ones averaged in a pixel. `harmonics`: of its comb; not kept.
  EngagedHeat(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k,
              unsigned windows);

  // Covariance of the tones' phasors, rows (re, im) of each, nm^2, the window beginning at time 0. The motion
  // off the comb follows at the harmonics' warm ones.
  void covariance(const ForceGradient& gradient, Eigen::MatrixXd& covariance);

 private:
  struct Point {
    double offset;               // w/W, in (0, 1/2)
    Eigen::VectorXcd stiffness;  // 1/chi at every harmonic, nN/nm
    Eigen::VectorXd heat;        // variances of forces there
    // Weights of the harmonics in a tone's phasor and in its conjugate; a column a tone.
    Eigen::MatrixXd at_tones, at_mirrored_tones;
  };

  void respond(const Point& point, const ForceGradient& gradient);

  std::vector<std::ptrdiff_t> harmonics_;  // of either sign
  std::vector<Point> points_;
  Eigen::MatrixXcd matrix_;
  Eigen::PartialPivLU<Eigen::MatrixXcd> factor_;
  Eigen::VectorXcd right_, solved_;
  // A column a tone: its phasor, or the conjugate, by heat at each harmonic.
  Eigen::MatrixXcd at_tones_, at_mirrored_tones_, warm_;
  Eigen::MatrixXcd hermitian_, plain_;  // tones x tones
};

}  // namespace combforce
