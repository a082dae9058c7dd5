// Codecs of what moves the tip and what is known of it: cantilever, excitation, noise.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proto/description.hpp"
#include "proto/fields.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 4> mode_keys{"frequency_hz", "quality_factor", "stiffness_n_per_m",
                                                    "sensitivity_nm_per_v"};
constexpr std::array<std::string_view, 2> excitation_names = {"tip", "base"};

double number_or_nan(const JsonView& view, Range range) {
  return view.json().is_null() ? std::numeric_limits<double>::quiet_NaN() : view.number(range);
}

Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

ModeUncertainty decode_uncertainty(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"std_errors", "correlation"});
  ModeUncertainty uncertainty;
  const auto errors = view.get("std_errors");
  check_keys(errors, unknown, {mode_keys[0], mode_keys[1], mode_keys[2], mode_keys[3]});
  for (std::size_t i = 0; i < mode_keys.size(); ++i)
    uncertainty.std_errors[i] = number_or_nan(errors.get(mode_keys[i]), non_negative);
  const auto correlation = view.get("correlation");
  const auto elements = correlation.elements();
  if (elements.size() != uncertainty.correlation.size())
    correlation.fail(
        fmt::format("has {} elements, must have {}", elements.size(), uncertainty.correlation.size()));
  for (std::size_t i = 0; i < elements.size(); ++i)
    uncertainty.correlation[i] = number_or_nan(elements[i], Range{-1.0, 1.0});
  return uncertainty;
}

Json encode(const ModeUncertainty& uncertainty) {
  Json errors = Json::object(), correlation = Json::array();
  for (std::size_t i = 0; i < mode_keys.size(); ++i)
    errors[std::string(mode_keys[i])] = number_or_null(uncertainty.std_errors[i]);
  for (const double value : uncertainty.correlation) correlation.push_back(number_or_null(value));
  return Json{{"std_errors", std::move(errors)}, {"correlation", std::move(correlation)}};
}

}  // namespace

Cantilever decode_cantilever(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"modes", "uncertainty"});
  Cantilever cantilever;
  for (const auto& element : not_empty(view.get("modes"))) {
    check_keys(element, unknown, {mode_keys[0], mode_keys[1], mode_keys[2], mode_keys[3]});
    Mode mode;
    mode.frequency_hz = element.get("frequency_hz").number(positive);
    mode.quality_factor = element.get("quality_factor").number(positive);
    mode.stiffness_n_per_m = element.get("stiffness_n_per_m").number(positive);
    if (const auto alpha = element.find("sensitivity_nm_per_v")) mode.sensitivity_nm_per_v = non_zero(*alpha);
    cantilever.modes.push_back(mode);
  }
  if (const auto uncertainty = view.find("uncertainty")) {
    if (uncertainty->size() != cantilever.modes.size())
      uncertainty->fail(fmt::format("has {} elements, must have {}, one a mode", uncertainty->size(),
                                    cantilever.modes.size()));
    for (const auto& element : uncertainty->elements())
      cantilever.uncertainty.push_back(decode_uncertainty(element, unknown));
  }
  return cantilever;
}

Excitation decode_excitation(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"kind", "participation"});
  Excitation excitation;
  excitation.kind = static_cast<Excitation::Kind>(view.get("kind").one_of(excitation_names));
  if (const auto participation = view.find("participation")) {
    if (excitation.kind != Excitation::Kind::base) participation->fail("belongs to kind \"base\" alone");
    for (const auto& element : not_empty(*participation))
      excitation.participation.push_back(non_zero(element));
  }
  return excitation;
}

Noise decode_noise(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown, {"temperature_k", "detector_nm_per_sqrt_hz"});
  Noise noise;
  noise.temperature_k = view.get("temperature_k").number(non_negative);
  const auto detector = view.get("detector_nm_per_sqrt_hz");
  if (detector.json().is_array()) {
    not_empty(detector);
    noise.detector_nm_per_sqrt_hz = numbers(detector, non_negative);
  } else {
    noise.detector_nm_per_sqrt_hz = {detector.number(non_negative)};
  }
  return noise;
}

Json encode(const Cantilever& cantilever) {
  Json modes = Json::array();
  for (const auto& mode : cantilever.modes)
    modes.push_back(Json{{"frequency_hz", mode.frequency_hz},
                         {"quality_factor", mode.quality_factor},
                         {"stiffness_n_per_m", mode.stiffness_n_per_m},
                         {"sensitivity_nm_per_v", mode.sensitivity_nm_per_v}});
  Json object{{"modes", std::move(modes)}};
  if (!cantilever.uncertainty.empty()) {
    Json list = Json::array();
    for (const ModeUncertainty& uncertainty : cantilever.uncertainty) list.push_back(encode(uncertainty));
    object["uncertainty"] = std::move(list);
  }
  return object;
}

Json encode(const Excitation& excitation) {
  Json object{{"kind", name_of(excitation_names, excitation.kind)}};
  if (!excitation.participation.empty()) object["participation"] = excitation.participation;
  return object;
}

Json encode(const Noise& noise) {
  const auto& detector = noise.detector_nm_per_sqrt_hz;
  return Json{{"temperature_k", noise.temperature_k},
              {"detector_nm_per_sqrt_hz", detector.size() == 1 ? Json(detector.front()) : Json(detector)}};
}

}  // namespace combforce
