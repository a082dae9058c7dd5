// How far the maps of a simulated scan lie from the scene that was scanned.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/cli/maps.hpp"
#include "drivers/simulated/simulation.hpp"
#include "dsp/scan.hpp"
#include "proto/json.hpp"

namespace combforce {

// |measured - true| over a class of pixels; NaN without pixels.
struct ErrorSummary {
  std::size_t pixels = 0;   // of the class
  std::size_t missing = 0;  // of these: without a value
  double median = 0.0, percentile_95 = 0.0;
};

// `after_step`: the first pixel after another material or a step in height of more than 1 nm along the scan;
// it holds the transient. `interior`: all others.
struct SceneError {
  Direction direction = Direction::trace;
  std::string name;      // topography_nm, or a parameter of the material
  double typical = 0.0;  // median of the true values
  ErrorSummary interior, after_step;
};

inline constexpr double scene_step_nm = 1.0;

// One entry a direction and map. Throws as make_scene() does.
std::vector<SceneError> compare_with_scene(const SimulationSettings& simulation, const ScanLayout& layout,
                                           const MapWriter& maps);

std::string scene_report_markdown(const std::vector<SceneError>& errors);
Json scene_report_json(const std::vector<SceneError>& errors);

}  // namespace combforce
