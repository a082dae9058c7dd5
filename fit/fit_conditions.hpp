// Everything a fit depends on besides the pixel's tones.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dsp/comb.hpp"
#include "fit/cantilever.hpp"
#include "fit/excitation.hpp"
#include "fit/free_response.hpp"
#include "fit/material.hpp"
#include "fit/noise.hpp"

namespace combforce {

enum class Weighting : std::uint8_t { none, noise };
enum class Background : std::uint8_t { none, linear };

struct ParameterBounds {
  std::string parameter;  // a name of the model
  double lower, upper;

  bool operator==(const ParameterBounds&) const = default;
};

struct FitSettings {
  std::string model = "dmt";
  // 0: the paper's partial motion; else at most so many iterations beyond, from each start.
  unsigned refine = 0;
  static constexpr unsigned most_refinements = 100;
  // none: E as the paper has it (equation 9). A refined fit always whitens by the noise's covariance
  // (measured_force.hpp), or where none is known, weighs by the share of thermal forces at each tone.
  Weighting weighting = Weighting::none;
  // Of a refined fit with noise: FitResult::intervals too, several times the work of the fit.
  bool profile_intervals = false;
  std::vector<ParameterBounds> bounds;  // override the model's own
  // From which material parameters follow; does not change the fit.
  std::optional<TipGeometry> tip = std::nullopt;
  // FitResult::calibration_errors too: a fit more for each direction in which the calibration is uncertain.
  // Not for models whose force depends on history: where E jumps, small steps say nothing.
  bool calibration_errors = false;
  // linear: forces are measured from the lifted response, with the cantilever as it is there
  // (background.hpp). Without a lifted response every fit says no_free_response.
  Background background = Background::none;
  // Further models that each pixel is fitted with, for FitResult::compared: names, each once, not `model`, at
  // most `most_compared`. Bounds apply to their parameters too, by name. Needs noise, and that it weighs the
  // residuals (refine, or weighting), for chi^2 to be the least that each model has.
  std::vector<std::string> compare = {};

  bool operator==(const FitSettings&) const = default;
};

// Everything a fit depends on besides the pixel's tones. Immutable while a fitter lives.
struct FitConditions {
  double sample_rate_hz = 0.0;
  Comb comb;
  unsigned windows = 1;  // averaged in a pixel: divides the noise
  Cantilever cantilever;
  Excitation excitation = {};
  std::optional<FreeResponse> free_response;  // absent: every fit says no_free_response
  std::optional<Noise> noise;                 // absent: standard errors, correlation and chi^2 are NaN
  FitSettings settings;
};

// Throws std::invalid_argument naming field, value and bound.
void validate(const FitConditions& conditions);

// The model, and those that it is compared with.
std::vector<std::string> models_of(const FitSettings& settings);

// Of this model, without what a fit repeats itself for: profile intervals, calibration errors, other models
// and their bounds.
FitSettings single_fit(FitSettings settings, const std::string& model);

// Of conditions whose free response has a lifted one: the cantilever as it is there (background.hpp), by the
// tones that the comb says are driven. Throws std::invalid_argument when the two are not of one drive.
Cantilever cantilever_near_surface(const FitConditions& conditions);

// Of the comb's tones.
std::vector<double> frequencies_hz(const FitConditions& conditions);

}  // namespace combforce
