// From a pixel's tones to the parameters of a force model: the paper's method (equations 5 to 10) with a
// quadrature whose error is estimated and bounded, or beyond it, with the motion off the comb found too
// (self_consistent.hpp), which removes the paper's bias.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dsp/comb.hpp"
#include "fit/cantilever.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"
#include "fit/free_response.hpp"
#include "fit/material.hpp"
#include "fit/noise.hpp"

namespace combforce {

enum class Weighting : std::uint8_t { none, noise };

struct ParameterBounds {
  std::string parameter;  // a name of the model
  double lower, upper;

  bool operator==(const ParameterBounds&) const = default;
};

struct FitSettings {
  std::string model = "dmt";
  // 0: the paper's partial motion; else at most so many iterations beyond, from each start.
  unsigned refine = 0;
  // none: E as the paper has it (equation 9). A refined fit always whitens by the noise's covariance
  // (measured_force.hpp), or where none is known, weighs by the share of thermal forces at each tone.
  Weighting weighting = Weighting::none;
  // Of a refined fit with noise: FitResult::intervals too, several times the work of the fit.
  bool profile_intervals = false;
  std::vector<ParameterBounds> bounds;  // override the model's own
  // From which material parameters follow; does not change the fit.
  std::optional<TipGeometry> tip = std::nullopt;

  bool operator==(const FitSettings&) const = default;
};

// Everything a fit depends on besides the pixel's tones. Immutable while a fitter lives.
struct FitConditions {
  double sample_rate_hz = 0.0;
  Comb comb;
  unsigned windows = 1;  // averaged in a pixel: divides the noise
  Cantilever cantilever;
  std::optional<FreeResponse> free_response;  // absent: every fit says no_free_response
  std::optional<Noise> noise;                 // absent: standard errors, correlation and chi^2 are NaN
  FitSettings settings;
};

// Throws std::invalid_argument naming field, value and bound.
void validate(const FitConditions& conditions);

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

  // As fit(), but from these parameters instead of the measured turning point (error maps, studies).
  void fit_from(std::span<const std::complex<double>> tip_nm, std::span<const double> start,
                FitResult& result);

  // The paper's E (equation 9), nN^2, at `parameters`; converged quadrature.
  double error(std::span<const std::complex<double>> tip_nm, std::span<const double> parameters);

  const ModelInfo& model() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace combforce
