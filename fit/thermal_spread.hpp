// How far heat moves a tip about its periodic motion over a surface, at every time of the period.
//
// The motion x = (q_m, dq_m/dt) of the modes besides the periodic one is linear, with the force's derivatives
// along the periodic motion as its springs and dampers,
//     (k_m/w_m^2) q'' + (k_m/(w_m Q_m)) q' + k_m q = dF/dd sum_l q_l + dF/dv sum_l q_l' + f_m,
// and heat white in time, so its covariance obeys dP/dt = A(t) P + P A(t)' + S (Risken 1989, The
// Fokker-Planck equation, section 6.5). Solved step by step: the free modes exactly, the surface by kicks
// between.
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "dsp/fftw.hpp"
#include "fit/cantilever.hpp"
#include "fit/force_gradient.hpp"
#include "fit/harmonics.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates; it takes FFTW's planner lock (dsp/fftw.hpp).
class ThermalSpread {
 public:
  // `harmonics`: not kept. temperature_k >= 0.
  ThermalSpread(const Harmonics& harmonics, const Cantilever& cantilever, double temperature_k);

  // kB T sum 1/k_m, nm^2.
  double free_variance() const { return free_variance_; }

  // Standard deviation of the tip's thermal motion over the period, nm, as phasors of harmonics 0 … band;
  // less `seen`, nm^2, of its variance that is part of the measured tones. False where the motion is
  // unstable.
  bool standard_deviation(const ForceGradient& gradient, double seen,
                          std::span<std::complex<double>> phasors);

 private:
  struct FreeMode {                    // over a step
    double qq, qv, vq, vv;             // of (q, v)
    double heat_qq, heat_qv, heat_vv;  // covariance that heat adds
    double kick;                       // of v by a force at the tip, 1 nN for 1 s, nm/s
    double variance, variance_v;       // of q, nm^2, and of v, free
  };

  void set_bins(std::span<const std::complex<double>> phasors);
  void step_free();
  void kick(double stiffness, double damping);
  double tip_variance() const;
  double& at(std::size_t row, std::size_t column) { return covariance_[row * order_ + column]; }

  std::size_t size_;  // steps a period
  std::size_t band_;
  double step_s_;
  double relaxation_periods_;  // of the free variance
  std::size_t most_periods_;
  double free_variance_ = 0.0;
  std::vector<FreeMode> modes_;
  std::size_t order_;                         // 2 a mode: q, v
  std::vector<double> covariance_;            // order x order
  std::vector<double> moved_;                 // P times (stiffness, damping) of the tip
  FftwReals stiffness_, damping_, variance_;  // over time
  FftwComplexes bins_;
  FftwPlan to_stiffness_, to_damping_, from_variance_;
};

}  // namespace combforce
