#include "fit/fit_conditions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "fit/background.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"

namespace combforce {
namespace {

// Of any of them.
const ParameterInfo* find_parameter(const FitSettings& settings, const std::string& name) {
  for (const std::string& model : models_of(settings))
    for (const ParameterInfo& info : find_model(model).parameters)
      if (info.name == name) return &info;
  return nullptr;
}

void validate_bounds(const FitSettings& settings) {
  for (std::size_t i = 0; i < settings.bounds.size(); ++i) {
    const ParameterBounds& own = settings.bounds[i];
    const ParameterInfo* info = find_parameter(settings, own.parameter);
    if (info == nullptr)
      throw std::invalid_argument(fmt::format("settings.bounds[{}].parameter: \"{}\", not of model {}", i,
                                              own.parameter, settings.model));
    if (!std::isfinite(own.lower) || !std::isfinite(own.upper) || !(own.lower < own.upper))
      throw std::invalid_argument(fmt::format("settings.bounds.{}: {} to {}, must be finite and ascending",
                                              own.parameter, own.lower, own.upper));
    if (info->lower > 0.0 && !(own.lower > 0.0))
      throw std::invalid_argument(
          fmt::format("settings.bounds.{}[0]: {}, must be positive", own.parameter, own.lower));
  }
}

void validate_free_response(const FreeResponse& free, std::size_t tones) {
  if (free.mean_nm.size() != tones)
    throw std::invalid_argument(
        fmt::format("free_response.mean_nm: {} values for {} tones", free.mean_nm.size(), tones));
  for (std::size_t i = 0; i < tones; ++i)
    if (!std::isfinite(std::abs(free.mean_nm[i])))
      throw std::invalid_argument(fmt::format("free_response.mean_nm[{}]: must be finite", i));
  if (free.lifted_nm && free.lifted_nm->size() != tones)
    throw std::invalid_argument(
        fmt::format("free_response.lifted_nm: {} values for {} tones", free.lifted_nm->size(), tones));
  for (std::size_t i = 0; free.lifted_nm && i < tones; ++i)
    if (!std::isfinite(std::abs((*free.lifted_nm)[i])))
      throw std::invalid_argument(fmt::format("free_response.lifted_nm[{}]: must be finite", i));
  if (free.covariance && free.covariance->size() != 4 * tones * tones)
    throw std::invalid_argument(fmt::format("free_response.covariance: {} values, must be {} for {} tones",
                                            free.covariance->size(), 4 * tones * tones, tones));
}

// `setting`: "settings.FIELD: value", which needs to know the noise.
void require_noise(const FitConditions& conditions, const char* setting) {
  if (!conditions.noise)
    throw std::invalid_argument(fmt::format("{}, but conditions.noise is missing", setting));
  if (*conditions.noise == Noise{0.0, std::vector(conditions.noise->detector_nm_per_sqrt_hz.size(), 0.0)})
    throw std::invalid_argument(fmt::format("{}, but noise is all 0: not known", setting));
}

void validate_weighting(const FitConditions& conditions) {
  if (conditions.settings.weighting == Weighting::none) return;
  require_noise(conditions, "settings.weighting: noise");
  const auto& detector = conditions.noise->detector_nm_per_sqrt_hz;
  if (conditions.noise->temperature_k == 0.0 && std::ranges::find(detector, 0.0) != detector.end())
    throw std::invalid_argument(
        "settings.weighting: noise, but noise.temperature_k and detector noise are 0");
}

void validate_intervals(const FitConditions& conditions) {
  if (!conditions.settings.profile_intervals) return;
  if (conditions.settings.refine == 0)
    throw std::invalid_argument(
        "settings.profile_intervals: true, but settings.refine is 0, must be at least 1");
  require_noise(conditions, "settings.profile_intervals: true");
}

void validate_refine(const FitSettings& settings) {
  if (settings.refine == 0) return;
  for (const std::string& model : models_of(settings))
    if (const std::string_view why = why_partial_fit_only(find_model(model)); !why.empty())
      throw std::invalid_argument(fmt::format(
          "settings.refine: {}, must be 0 for model {}: {}, partial fit only", settings.refine, model, why));
}

void validate_comparison(const FitConditions& conditions) {
  const FitSettings& settings = conditions.settings;
  if (settings.compare.empty()) return;
  if (settings.compare.size() > most_compared)
    throw std::invalid_argument(
        fmt::format("settings.compare: {} models, must be <= {}", settings.compare.size(), most_compared));
  require_noise(conditions, "settings.compare: not empty");
  if (settings.refine == 0 && settings.weighting == Weighting::none)
    throw std::invalid_argument(
        "settings.compare: not empty, but settings.weighting is none and settings.refine 0: chi^2 is the "
        "least only where noise weighs");
  std::set<std::string> models{settings.model};
  for (std::size_t i = 0; i < settings.compare.size(); ++i)
    if (!models.insert(std::string(find_model(settings.compare[i]).name)).second)
      throw std::invalid_argument(
          fmt::format("settings.compare[{}]: \"{}\", which is fitted already", i, settings.compare[i]));
}

}  // namespace

std::vector<std::string> models_of(const FitSettings& settings) {
  std::vector<std::string> models{settings.model};
  models.insert(models.end(), settings.compare.begin(), settings.compare.end());
  return models;
}

FitSettings single_fit(FitSettings settings, const std::string& model) {
  settings.model = model;
  std::erase_if(settings.bounds, [&](const ParameterBounds& bounds) {
    const auto parameters = find_model(model).parameters;
    return std::ranges::find(parameters, bounds.parameter, &ParameterInfo::name) == parameters.end();
  });
  settings.profile_intervals = false;
  settings.calibration_errors = false;
  settings.compare.clear();
  return settings;
}

Cantilever cantilever_near_surface(const FitConditions& conditions) {
  const std::vector<double> frequencies = frequencies_hz(conditions);
  const FreeResponse& free = *conditions.free_response;
  std::vector<double> driven_hz;
  std::vector<std::complex<double>> free_nm, lifted_nm;
  for (std::size_t i = 0; i < frequencies.size(); ++i) {
    if (!conditions.comb.tones[i].driven) continue;
    driven_hz.push_back(frequencies[i]);
    free_nm.push_back(free.mean_nm[i]);
    lifted_nm.push_back((*free.lifted_nm)[i]);
  }
  return near_surface(conditions.cantilever, driven_hz, free_nm, lifted_nm);
}

std::vector<double> frequencies_hz(const FitConditions& conditions) {
  const double spacing_hz = conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
  std::vector<double> frequencies;
  for (const Tone& tone : conditions.comb.tones)
    frequencies.push_back(static_cast<double>(tone.bin) * spacing_hz);
  return frequencies;
}

void validate(const FitConditions& conditions) {
  if (!(conditions.sample_rate_hz > 0.0) || !std::isfinite(conditions.sample_rate_hz))
    throw std::invalid_argument(
        fmt::format("sample_rate_hz: {}, must be positive and finite", conditions.sample_rate_hz));
  validate(conditions.comb);
  if (conditions.windows < 1) throw std::invalid_argument("windows: 0, must be at least 1");
  validate(conditions.cantilever);
  const std::size_t tones = conditions.comb.tones.size();
  if (conditions.free_response) validate_free_response(*conditions.free_response, tones);
  if (conditions.noise) validate(*conditions.noise, tones);
  validate_bounds(conditions.settings);
  validate_refine(conditions.settings);
  if (conditions.settings.tip) validate(*conditions.settings.tip);
  validate_weighting(conditions);
  validate_intervals(conditions);
  validate_comparison(conditions);
  validate(conditions.excitation, conditions.cantilever);
  if (conditions.settings.calibration_errors && conditions.cantilever.uncertainty.empty())
    throw std::invalid_argument(
        "settings.calibration_errors: true, but cantilever.uncertainty is missing: not known");
  if (conditions.settings.calibration_errors && depends_on_history(find_model(conditions.settings.model)))
    throw std::invalid_argument(fmt::format(
        "settings.calibration_errors: true, must be false for model {}: its force depends on history",
        conditions.settings.model));
  if (conditions.settings.background == Background::linear && conditions.free_response &&
      conditions.free_response->lifted_nm)
    cantilever_near_surface(conditions);
}

}  // namespace combforce
