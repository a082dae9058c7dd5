// What any choice of tones tells about the parameters of a pixel, to first order in its noise.
//
// About a settled motion, a change of the parameters moves the tip at every bin, and so does heat
// (fit/engaged_heat.hpp). So parameters, hardly known beforehand, and motion have a joint covariance, which
// every measured tone narrows (the update of a Kalman filter).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/pixel_fitter.hpp"

namespace combforce {

// Immutable: may be shared by threads.
class ToneInformation {
 public:
  // Covariance of parameters and motion as far as tones have been measured.
  using Knowledge = Eigen::MatrixXd;

  // `conditions`: as of the pixels, with a noise model; `known`: standard errors of the parameters before
  // anything is measured, many times those that the comb leaves; `motion_nm`: the settled deflection of the
  // tip over a window of the comb, evenly sampled, an even number of times.
  ToneInformation(const FitConditions& conditions, std::span<const double> parameters,
                  std::span<const double> known, std::span<const double> motion_nm);

  // Bins off the comb that may be measured, ascending: up to half the sample rate those that move by at least
  // 1e-5 of the greatest tone, which extraction resolves to 10 %; of more than 300 those that move most.
  std::span<const std::uint64_t> candidates() const { return candidates_; }

  // After the tones of the comb.
  const Knowledge& of_comb() const { return of_comb_; }
  // Measures a candidate too.
  void measure(std::uint64_t bin, Knowledge& knowledge) const;
  // The variances of the parameters if it were.
  Eigen::VectorXd variances_with(std::uint64_t bin, const Knowledge& knowledge) const;

 private:
  Eigen::Index row_of(std::uint64_t bin) const;
  double detector_variance(std::uint64_t bin) const;

  FitConditions conditions_;
  Eigen::Index parameters_;
  std::vector<std::uint64_t> bins_;  // of the motion, in the order of the rows
  std::vector<std::uint64_t> candidates_;
  Knowledge of_comb_;
};

// Delta f.
double bin_hz(const FitConditions& conditions);

// Detector noise at a bin: that of the tone of the comb nearest to it, nm/sqrt(Hz).
double detector_density_near(const FitConditions& conditions, std::uint64_t bin);

}  // namespace combforce
