// Codec of how pixels are fitted.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "fit/fit_result.hpp"
#include "proto/description.hpp"
#include "proto/fields.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 2> weighting_names = {"none", "noise"};
constexpr std::array<std::string_view, 2> background_names = {"none", "linear"};

TipGeometry decode_tip(const JsonView& view, UnknownKeys unknown) {
  check_keys(
      view, unknown,
      {"radius_nm", "half_angle_deg", "sample_poisson_ratio", "tip_young_modulus_gpa", "tip_poisson_ratio"});
  TipGeometry tip;
  const auto read = [&](std::string_view key, std::optional<double>& value) {
    if (const auto member = view.find(key)) value = member->number();
  };
  read("radius_nm", tip.radius_nm);
  read("half_angle_deg", tip.half_angle_deg);
  read("sample_poisson_ratio", tip.sample_poisson_ratio);
  read("tip_young_modulus_gpa", tip.tip_young_modulus_gpa);
  tip.tip_poisson_ratio = number_or(view, "tip_poisson_ratio", tip.tip_poisson_ratio);
  try {
    validate(tip);
  } catch (const std::invalid_argument& error) {
    view.fail(error.what());
  }
  return tip;
}

Json encode_tip(const TipGeometry& tip) {
  Json object{{"tip_poisson_ratio", tip.tip_poisson_ratio}};
  if (tip.radius_nm) object["radius_nm"] = *tip.radius_nm;
  if (tip.half_angle_deg) object["half_angle_deg"] = *tip.half_angle_deg;
  if (tip.sample_poisson_ratio) object["sample_poisson_ratio"] = *tip.sample_poisson_ratio;
  if (tip.tip_young_modulus_gpa) object["tip_young_modulus_gpa"] = *tip.tip_young_modulus_gpa;
  return object;
}

// `models`: the one of the fit, and those it is compared with.
ParameterBounds decode_bounds(const JsonView& bounds, const std::string& parameter,
                              std::span<const ModelInfo* const> models) {
  const auto view = bounds.get(parameter);
  const auto known = [&](const ModelInfo* model) {
    return std::ranges::find(model->parameters, parameter, &ParameterInfo::name) != model->parameters.end();
  };
  if (std::ranges::none_of(models, known)) {
    std::string names;
    for (const auto& info : models.front()->parameters)
      names += fmt::format("{}{}", names.empty() ? "" : ", ", info.name);
    view.fail(fmt::format("is no parameter of model \"{}\"; it has {}", models.front()->name, names));
  }
  const auto [lower, upper] = interval(view);
  return {parameter, lower, upper};
}

}  // namespace

FitSettings decode_fit(const JsonView& view, UnknownKeys unknown) {
  check_keys(view, unknown,
             {"model", "refine", "weighting", "profile_intervals", "calibration_errors", "background",
              "compare", "bounds", "tip"});
  FitSettings fit;
  if (const auto model = view.find("model")) fit.model = model->string();
  std::vector<const ModelInfo*> models;
  const auto add_model = [&](const std::string& name, const JsonView& place) {
    try {
      models.push_back(&find_model(name));
    } catch (const std::invalid_argument& error) {
      place.fail(error.what());
    }
  };
  add_model(fit.model, view.find("model").value_or(view));
  if (const auto refine = view.find("refine"))
    fit.refine = static_cast<unsigned>(refine->integer(0, FitSettings::most_refinements));
  if (const auto weighting = view.find("weighting"))
    fit.weighting = static_cast<Weighting>(weighting->one_of(weighting_names));
  if (const auto intervals = view.find("profile_intervals")) fit.profile_intervals = intervals->boolean();
  if (const auto errors = view.find("calibration_errors")) fit.calibration_errors = errors->boolean();
  if (const auto background = view.find("background"))
    fit.background = static_cast<Background>(background->one_of(background_names));
  if (const auto compare = view.find("compare")) {
    if (compare->size() > most_compared)
      compare->fail(fmt::format("has {} elements, must have at most {}", compare->size(), most_compared));
    for (const auto& element : compare->elements()) {
      fit.compare.push_back(element.string());
      add_model(fit.compare.back(), element);
      if (std::ranges::count(models, models.back()) > 1)
        element.fail(fmt::format("is \"{}\", which is fitted already", fit.compare.back()));
    }
  }
  if (const auto bounds = view.find("bounds")) {
    bounds->find("");  // fails unless it is an object
    for (const auto& member : bounds->json().items())
      fit.bounds.push_back(decode_bounds(*bounds, member.key(), models));
  }
  if (const auto tip = view.find("tip")) fit.tip = decode_tip(*tip, unknown);
  return fit;
}

Json encode(const FitSettings& fit) {
  Json bounds = Json::object();
  for (const auto& bound : fit.bounds) bounds[bound.parameter] = {bound.lower, bound.upper};
  Json object{{"model", fit.model},
              {"refine", fit.refine},
              {"weighting", name_of(weighting_names, fit.weighting)},
              {"profile_intervals", fit.profile_intervals},
              {"calibration_errors", fit.calibration_errors},
              {"background", name_of(background_names, fit.background)},
              {"compare", fit.compare},
              {"bounds", std::move(bounds)}};
  if (fit.tip) object["tip"] = encode_tip(*fit.tip);
  return object;
}

}  // namespace combforce
