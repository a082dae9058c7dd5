// How heat moves a tip about its periodic motion over a surface: at every time of the period, and as the
// tones of a window see it.
//
// The motion of the modes besides the periodic one is linear, with the force's derivatives along the periodic
// motion as its springs and dampers,
//     (k_m/w_m^2) q'' + (k_m/(w_m Q_m)) q' + k_m q = dF/dd sum_l q_l + dF/dv sum_l q_l' + f_m,
// and heat white in time. So x = (q_m, q_m'/w_m) goes over a window to Phi x + n, with n independent of x,
// and what its tones see of it, D = (2/T) int sum_m q_m exp(-iwt) dt, is C x + n': whatever the harmonics
// that the surface couples. Where windows begin, the covariance of x is P = Phi P Phi' + <n n'> (Lyapunov's
// equation of a periodic system; for the stochastic one: Risken 1989, The Fokker-Planck equation, section
// 6.5). All of it comes from one integration over the window: the free modes exactly from kick to kick of
// the surface (Strang 1968, SIAM J. Numer. Anal. 5, 506), the more often the stiffer it is.
//
// Where powers of Phi grow the periodic motion does not last but, say, doubles its period (Floquet; Nayfeh,
// Balachandran 1995, Applied Nonlinear Dynamics, 3.3).
#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "dsp/fourier.hpp"
#include "fit/cantilever.hpp"
#include "fit/force_gradient.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates; it takes FFTW's planner lock (dsp/fftw.hpp).
class EngagedHeat {
 public:
  // `windows`: contiguous ones averaged in a pixel, at least 1. `harmonics`: of its comb; not kept.
  // temperature_k >= 0.
  EngagedHeat(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k,
              unsigned windows);

  // kB T sum 1/k_m, nm^2.
  double free_variance() const { return free_variance_; }

  // What follows is for this gradient, whose spans need not outlive the call. False where the periodic motion
  // is unstable: then there is nothing to tell.
  bool engage(const ForceGradient& gradient);

  // Of the tones' phasors, rows (re, im) of each, nm^2, the window beginning at time 0.
  const Eigen::MatrixXd& covariance() const { return covariance_; }

  // Standard deviation of the tip over the period, nm, as phasors of harmonics 0 … phasors.size() - 1 <=
  // band; less `seen`, nm^2, of its variance, which is part of the measured tones.
  void standard_deviation(double seen, std::span<std::complex<double>> phasors);

 private:
  struct FreeMode {                    // from kick to kick, of (q, q'/w)
    double qq, qv, vq, vv;             // what becomes of either
    double heat_qq, heat_qv, heat_vv;  // covariance that heat adds
  };
  struct Pace {
    std::size_t kicks;  // half a step
    double between_s;
    std::vector<FreeMode> modes;
  };

  static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

  static FreeMode free_mode(const Mode& mode, double temperature_k, double duration_s);
  const Pace& pace(std::size_t step) const;
  void integrate();
  void half_step(std::size_t step);
  void kick(double stiffness, double damping, double duration_s);
  void move_freely(const std::vector<FreeMode>& modes);
  void set_weight(std::size_t tone, std::complex<double> weight);
  void see(const Eigen::VectorXd& of);
  void see_end(double sign);
  void record(std::size_t step);
  bool find_beginning();
  void average_windows();

  unsigned windows_;
  std::size_t periods_;  // a window
  FourierTransform transform_;
  std::size_t size_;  // steps a period
  double step_s_;
  double free_variance_ = 0.0;
  std::vector<Pace> paces_;                       // every one twice as quick as that before
  std::vector<double> kicks_;                     // a mode: of q'/w by 1 nN for 1 s, nm
  double push_ = 0.0;                             // the same of the tip's velocity, nm/s
  std::vector<std::size_t> tones_;                // harmonics
  std::vector<std::complex<double>> weights_;     // 2/(steps a window) exp(-i 2 pi j/size_)
  std::vector<double> by_surface_, by_velocity_;  // dF/dp0 and dF/dv over the period
  Eigen::Index order_;                            // of x
  // What a step of the integration begins with, of a tip at rest where the window began.
  Eigen::MatrixXd heated_;                                                          // <n n'>
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> carried_;  // Phi, <n n''>
  Eigen::MatrixXd seen_;  // C, and what makes <n' n''> with its transpose
  Eigen::VectorXd force_, felt_;
  Eigen::VectorXd displacement_, velocity_;  // of the tip, by x
  Eigen::RowVectorXd tip_, moved_;           // rows of carried_
  Eigen::VectorXd weight_;                   // of the step in the tones
  double tip_variance_ = 0.0, mean_variance_ = 0.0;
  std::vector<double> variance_;  // of the tip over the period
  Eigen::MatrixXd tip_rows_;      // its motion by x where the window began, a row a step
  Eigen::MatrixXd power_, squared_, beginning_, correlated_, later_, covariance_;
};

}  // namespace combforce
