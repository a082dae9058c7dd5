#include "fit/force_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <stdexcept>
#include <vector>

#include "fit/model_list.hpp"

namespace combforce {
namespace {

constexpr auto models =
    std::apply([](auto... model) { return std::array{decltype(model)::model...}; }, ForceModels{});

}  // namespace

std::span<const ModelInfo> force_models() {
  return models;
}

const ModelInfo& find_model(std::string_view name) {
  std::vector<std::string_view> names;
  for (const ModelInfo& info : models) {
    if (info.name == name) return info;
    names.push_back(info.name);
  }
  throw std::invalid_argument(fmt::format("model: \"{}\", must be one of {}", name, fmt::join(names, ", ")));
}

bool depends_on_history(const ModelInfo& model) {
  return visit_model(model, [](auto type) { return DependsOnHistory<decltype(type)>; });
}

std::string_view why_partial_fit_only(const ModelInfo& model) {
  return visit_model(model, []<typename Model>(Model /*type*/) -> std::string_view {
    if (DependsOnHistory<Model>) return "its force depends on history";
    if (IsPolynomial<Model>) return "its force has neither a surface nor a known mean";
    return {};
  });
}

double model_force(const ModelInfo& model, std::span<const double> parameters, double d_nm,
                   double velocity_nm_per_s, bool engaged) {
  if (parameters.size() != model.parameters.size())
    throw std::invalid_argument(fmt::format("parameters: {} values, but model {} has {}", parameters.size(),
                                            model.name, model.parameters.size()));
  return visit_model(model, [&](auto type) {
    return force_of<decltype(type)>(parameters.data(), d_nm, velocity_nm_per_s, engaged);
  });
}

}  // namespace combforce
