#include "proto/calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace combforce {
namespace {

constexpr std::array<const char*, 4> mode_keys{"frequency_hz", "quality_factor", "stiffness_n_per_m",
                                               "sensitivity_nm_per_v"};

std::array<double, 4> values_of(const Mode& mode) {
  return {mode.frequency_hz, mode.quality_factor, mode.stiffness_n_per_m,
          std::abs(mode.sensitivity_nm_per_v)};
}

Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

double number_or_nan(const JsonView& view, Range range) {
  return view.json().is_null() ? std::numeric_limits<double>::quiet_NaN() : view.number(range);
}

ModeUncertainty decode_uncertainty(const JsonView& view, const Mode& mode) {
  view.only({"std_errors", "correlation"});
  const auto errors = view.get("std_errors");
  errors.only({mode_keys[0], mode_keys[1], mode_keys[2], mode_keys[3]});
  const auto values = values_of(mode);
  Eigen::Vector4d relative;
  for (std::size_t i = 0; i < mode_keys.size(); ++i)
    relative(static_cast<Eigen::Index>(i)) =
        number_or_nan(errors.get(mode_keys[i]), non_negative) / values[i];
  const auto correlation = view.get("correlation");
  const auto elements = correlation.elements();
  constexpr std::size_t triangle = 6;
  if (elements.size() != triangle)
    correlation.fail(fmt::format("has {} elements, must have {}", elements.size(), triangle));
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < 4; ++i)
    for (Eigen::Index j = i + 1; j < 4; ++j)
      matrix(i, j) = matrix(j, i) = number_or_nan(elements[next++], Range{-1.0, 1.0});
  return {relative.asDiagonal() * matrix * relative.asDiagonal()};
}

Calibration decode(const JsonView& root) {
  root.only({"cantilever", "noise", "uncertainty", "origin"});
  Calibration calibration;
  calibration.cantilever = decode_cantilever(root.get("cantilever"));
  calibration.noise = decode_noise(root.get("noise"));
  if (const auto uncertainty = root.find("uncertainty")) {
    const auto& modes = calibration.cantilever.modes;
    const auto elements = uncertainty->elements();
    if (elements.size() != modes.size())
      uncertainty->fail(
          fmt::format("has {} elements, must have {}, one a mode", elements.size(), modes.size()));
    for (std::size_t m = 0; m < elements.size(); ++m)
      calibration.uncertainty.push_back(decode_uncertainty(elements[m], modes[m]));
  }
  if (const auto origin = root.find("origin")) {
    if (!origin->json().is_object()) origin->fail("must be an object");
    calibration.origin = origin->json();
  }
  return calibration;
}

Json encode(const ModeUncertainty& uncertainty, const Mode& mode) {
  const auto values = values_of(mode);
  const Eigen::Vector4d relative = uncertainty.covariance.diagonal().cwiseSqrt();
  Json errors = Json::object(), correlation = Json::array();
  for (std::size_t i = 0; i < mode_keys.size(); ++i)
    errors[mode_keys[i]] = number_or_null(relative(static_cast<Eigen::Index>(i)) * values[i]);
  for (Eigen::Index i = 0; i < 4; ++i)
    for (Eigen::Index j = i + 1; j < 4; ++j) {
      const double size = relative(i) * relative(j);
      const double value = size > 0.0 ? uncertainty.covariance(i, j) / size : 0.0;
      correlation.push_back(std::isfinite(size) ? Json(std::clamp(value, -1.0, 1.0)) : Json(nullptr));
    }
  return Json{{"std_errors", std::move(errors)}, {"correlation", std::move(correlation)}};
}

}  // namespace

Calibration parse_calibration(std::string_view text, const std::string& file) {
  const Json root = parse_json(text, file);
  return decode(JsonView(root, file));
}

Calibration load_calibration(const std::string& path) {
  const Json root = parse_json_file(path);
  return decode(JsonView(root, path));
}

Json encode(const Calibration& calibration) {
  Json root{{"cantilever", encode(calibration.cantilever)}, {"noise", encode(calibration.noise)}};
  if (!calibration.uncertainty.empty()) {
    Json list = Json::array();
    for (std::size_t m = 0; m < calibration.uncertainty.size(); ++m)
      list.push_back(encode(calibration.uncertainty[m], calibration.cantilever.modes[m]));
    root["uncertainty"] = std::move(list);
  }
  if (calibration.origin.is_object()) root["origin"] = calibration.origin;
  return root;
}

}  // namespace combforce
