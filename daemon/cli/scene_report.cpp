#include "daemon/cli/scene_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/simulated/scene.hpp"
#include "fit/force_model.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {

namespace {

// Nearest rank; NaN without values.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

class ErrorCollector {
 public:
  void add(double error) {
    ++pixels_;
    if (!std::isnan(error)) errors_.push_back(std::abs(error));
  }

  ErrorSummary summary() const {
    return {pixels_, pixels_ - errors_.size(), quantile(errors_, 0.5), quantile(errors_, 0.95)};
  }

 private:
  std::size_t pixels_ = 0;
  std::vector<double> errors_;
};

struct Comparison {
  const ScanLayout& layout;
  const MapWriter& maps;
  Direction direction;
  const std::vector<bool>& after_step;

  SceneError with(const std::string& name, const std::vector<double>& truth) const {
    const std::vector<double> measured = maps.map(direction, name);
    ErrorCollector interior, step;
    for (std::uint32_t line = 0; line < layout.lines; ++line) {
      for (std::uint32_t column = 0; column < layout.columns; ++column) {
        const std::size_t at = std::size_t{line} * layout.columns + column;
        const bool known = !measured.empty() && line < maps.lines() && column < maps.columns();
        const double value = known ? measured[std::size_t{line} * maps.columns() + column]
                                   : std::numeric_limits<double>::quiet_NaN();
        (after_step[at] ? step : interior).add(value - truth[at]);
      }
    }
    return {direction, name, quantile(truth, 0.5), interior.summary(), step.summary()};
  }
};

std::string cells(const ErrorSummary& summary) {
  return fmt::format(" {} | {} | {:.3g} | {:.3g} |", summary.pixels, summary.missing, summary.median,
                     summary.percentile_95);
}

Json encode(const ErrorSummary& summary) {
  return {{"pixels", summary.pixels},
          {"missing", summary.missing},
          {"median", number9(summary.median)},
          {"percentile_95", number9(summary.percentile_95)}};
}

}  // namespace

std::vector<SceneError> compare_with_scene(const SimulationSettings& simulation, const ScanLayout& layout,
                                           const MapWriter& maps) {
  const ModelInfo& model = find_model(simulation.model);
  const SceneMaps scene = make_scene(simulation.scene, model, layout);
  std::vector<SceneError> errors;
  for (const Direction direction : {Direction::trace, Direction::retrace}) {
    if (direction == Direction::retrace && !layout.bidirectional) continue;
    const std::vector<bool> steps = after_step(scene, layout, direction, scene_step_nm);
    const Comparison compare{layout, maps, direction, steps};
    errors.push_back(compare.with("topography_nm", scene.height_nm));
    for (std::size_t i = 0; i < scene.parameters.size(); ++i) {
      errors.push_back(compare.with(std::string(model.parameters[i + 1].name), scene.parameters[i]));
    }
  }
  return errors;
}

std::string scene_report_markdown(const std::vector<SceneError>& errors) {
  std::string text = fmt::format(
      "Distance from the scene, |measured - true|; after a step: the first pixel on another material, or "
      "more than "
      "{} nm higher or lower\n\n"
      "| map | typical | interior: pixels | missing | median | 95 % | after a step: pixels | missing | "
      "median | 95 % |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n",
      scene_step_nm);
  for (const SceneError& error : errors) {
    text += fmt::format("| {} {} | {:.3g} |{}{}\n", to_string(error.direction), error.name, error.typical,
                        cells(error.interior), cells(error.after_step));
  }
  return text;
}

Json scene_report_json(const std::vector<SceneError>& errors) {
  Json list = Json::array();
  for (const SceneError& error : errors) {
    list.push_back({{"direction", to_string(error.direction)},
                    {"map", error.name},
                    {"typical", number9(error.typical)},
                    {"interior", encode(error.interior)},
                    {"after_step", encode(error.after_step)}});
  }
  return {{"step_nm", scene_step_nm}, {"maps", list}};
}

}  // namespace combforce
