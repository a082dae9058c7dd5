// How the cantilever's uncertainty reaches the parameters of a fit.
//
// Each mode's covariance of (ln f, ln Q, ln k, ln |alpha|) is split into independent directions. For each the
// pixel is fitted again as if the calibration were a small step further in that direction: the detector's
// signal stays what it was, so that tones and free response turn by (chi/chi_V)' over chi/chi_V. The
// parameters' shifts, a standard deviation each, add in squares. Linear in the uncertainty; modes count as
// independent.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/fit_result.hpp"
#include "fit/pixel_fitter.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class CalibrationErrors {
 public:
  // Conditions are valid and have an uncertainty. What is not known of it is taken for certain.
  explicit CalibrationErrors(const FitConditions& conditions);

  // Fills `calibration_errors` of a result with parameters that holds the fit of these tones; NaN where one
  // of the fits does not converge.
  void find(std::span<const std::complex<double>> tip_nm, std::uint64_t first_sample, FitResult& result);

 private:
  struct Direction {
    PixelFitter fitter;
    std::vector<std::complex<double>> turns;  // of tip deflection, one a tone
    double share;                             // of a standard deviation
  };
  void add(const FitConditions& conditions, std::size_t mode, const Eigen::Vector4d& logs);

  std::vector<Direction> directions_;
  std::vector<std::complex<double>> tip_nm_;
  FitResult moved_;
};

}  // namespace combforce
