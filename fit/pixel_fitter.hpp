// From a pixel's tones to the parameters of a force model: the paper's method (equations 5 to 10) with a
// quadrature whose error is estimated and bounded, or beyond it, with the motion off the comb found too
// (self_consistent.hpp), which removes the paper's bias.
#pragma once

#include <complex>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fit/fit_conditions.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"

namespace combforce {

class CalibrationErrors;

// Fits one pixel at a time. A pure function of conditions and tones: no state passes from pixel to pixel and
// no clock is read, so the same tones give the same bits. Thread-bound (one a thread); fit() does not
// allocate.
class PixelFitter {
 public:
  explicit PixelFitter(const FitConditions& conditions);  // validates
  ~PixelFitter();
  PixelFitter(PixelFitter&&) noexcept;
  PixelFitter& operator=(PixelFitter&&) noexcept;

  // `tip_nm`: tip-deflection peak phasors, one a tone of the comb, phase at stream sample 0. `first_sample`:
  // of the analysed windows: the noise of tones near one resonance depends on where a window begins.
  void fit(std::span<const std::complex<double>> tip_nm, FitResult& result, std::uint64_t first_sample = 0);

  // As fit(), but from these parameters instead of the measured turning point (error maps, studies), and
  // without calibration errors and other models.
  void fit_from(std::span<const std::complex<double>> tip_nm, std::span<const double> start,
                FitResult& result, std::uint64_t first_sample = 0);

  // The paper's E (equation 9), nN^2, at `parameters`; converged quadrature.
  double error(std::span<const std::complex<double>> tip_nm, std::span<const double> parameters);

  const ModelInfo& model() const;

 private:
  class State;
  std::unique_ptr<State> state_;
  std::unique_ptr<CalibrationErrors> calibration_errors_;  // null: not asked for
  std::vector<PixelFitter> compared_;
  FitResult other_;  // of one of them
};

}  // namespace combforce
