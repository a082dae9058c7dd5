// The surface under a scan: height and material at every pixel. The simulator moves the tip over it, and
// whoever judges a scan compares with it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/simulated/simulation.hpp"
#include "dsp/scan.hpp"
#include "fit/force_model.hpp"

namespace combforce {

// Maps of lines x columns values, row by row, row 0 scanned first.
struct SceneMaps {
  std::uint32_t lines = 0, columns = 0;
  std::vector<double> height_nm;
  // One map a parameter of the model but the first, which is height - z.
  std::vector<std::vector<double>> parameters;

  std::size_t index(std::uint32_t line, std::uint32_t column) const {
    return std::size_t{line} * columns + column;
  }
};

// Pixels are sampled at their centres, so that pixel (i, j) lies at ((j + 1/2) size_x/columns, (i + 1/2)
// size_y/lines). GSF maps are stretched over the scan, whatever their own extent, and read at the nearest
// value.
//
// Throws std::invalid_argument naming field, value and bound (a blend needs 0 < layout.size_nm < 1000
// domain_nm), InputError for a map that cannot be read or holds a value that is not finite or, for a
// parameter, outside the model's default bounds.
// check_scene(): as far as the settings tell, without reading maps.
void check_scene(const SceneSettings& scene, const ModelInfo& model, const ScanLayout& layout);
SceneMaps make_scene(const SceneSettings& scene, const ModelInfo& model, const ScanLayout& layout);

// Which pixels differ from the pixel scanned before them in the same direction, by any material parameter or
// by more than height_nm. The first pixel of a line follows the last of the line scanned before it (none does
// at the start). Transients of such a step lie in these pixels. Row by row, as the maps.
std::vector<bool> after_step(const SceneMaps& maps, const ScanLayout& layout, Direction direction,
                             double height_nm);

}  // namespace combforce
