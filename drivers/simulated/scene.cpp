#include "drivers/simulated/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "drivers/simulated/random.hpp"
#include "proto/gsf.hpp"
#include "proto/json.hpp"

namespace combforce {

namespace {

constexpr std::size_t most_pixels = std::size_t{1} << 22;

void require(bool holds, const std::string& field, double value, const std::string& bound) {
  if (!holds) throw std::invalid_argument(fmt::format("{}: {}, must be {}", field, value, bound));
}

void check_materials(const SceneSettings& scene, const ModelInfo& model, std::size_t count) {
  require(scene.materials.size() == count, "scene.materials", static_cast<double>(scene.materials.size()),
          fmt::format("{} of them", count));
  for (std::size_t i = 0; i < count; ++i) {
    const std::vector<double>& parameters = scene.materials[i].parameters;
    require(parameters.size() + 1 == model.parameters.size(), fmt::format("scene.materials[{}]", i),
            static_cast<double>(parameters.size()),
            fmt::format("{} parameters of model {}", model.parameters.size() - 1, model.name));
    for (std::size_t p = 0; p < parameters.size(); ++p) {
      const ParameterInfo& info = model.parameters[p + 1];
      require(parameters[p] >= info.lower && parameters[p] <= info.upper,
              fmt::format("scene.materials[{}].{}", i, info.name), parameters[p],
              fmt::format("{}..{}", info.lower, info.upper));
    }
  }
}

// A smooth random field of zero mean: plane waves of random direction and phase, of one wavelength (a
// Gaussian field as in spinodal decomposition; Cahn 1965). Above zero lie the domains of one phase.
class Domains {
 public:
  Domains(double size_nm, Random& random) {
    for (Wave& wave : waves_) {
      const double direction = 2.0 * std::numbers::pi * random.uniform();
      const double number = std::numbers::pi / size_nm;  // half a wave a domain
      wave = {number * std::cos(direction), number * std::sin(direction),
              2.0 * std::numbers::pi * random.uniform()};
    }
  }

  bool second_phase(double x, double y) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += std::cos(wave.kx * x + wave.ky * y + wave.phase);
    return sum > 0.0;
  }

 private:
  struct Wave {
    double kx, ky, phase;
  };
  std::array<Wave, 48> waves_{};
};

// Round caps of random places, one in each square of a grid; the highest is seen.
class Grains {
 public:
  Grains(double spacing_nm, double extent_x, double extent_y, Random& random)
      : spacing_(spacing_nm), columns_(squares(extent_x)), rows_(squares(extent_y)) {
    for (std::size_t i = 0; i < columns_ * rows_; ++i) {
      const std::size_t column = i % columns_, row = i / columns_;
      const double x = (static_cast<double>(column) - 1.0 + random.uniform()) * spacing_;
      const double y = (static_cast<double>(row) - 1.0 + random.uniform()) * spacing_;
      tops_.push_back({x, y});
    }
  }

  // 0..1.
  double height(double x, double y) const {
    const auto column = static_cast<std::size_t>(x / spacing_) + 1;
    const auto row = static_cast<std::size_t>(y / spacing_) + 1;
    double highest = 0.0;
    for (std::size_t r = row - 1; r <= row + 1; ++r) {
      for (std::size_t c = column - 1; c <= column + 1; ++c) {
        const auto& [top_x, top_y] = tops_[r * columns_ + c];
        const double distance = std::hypot(x - top_x, y - top_y) / spacing_;
        highest = std::max(highest, 1.0 - distance * distance);
      }
    }
    return highest;
  }

 private:
  // With a margin of one on each side.
  std::size_t squares(double extent) const { return static_cast<std::size_t>(extent / spacing_) + 3; }

  double spacing_;
  std::size_t columns_, rows_;
  std::vector<std::array<double, 2>> tops_;
};

void fill_flat(const SceneSettings& scene, SceneMaps& maps) {
  for (std::size_t p = 0; p < maps.parameters.size(); ++p) {
    std::ranges::fill(maps.parameters[p], scene.materials[0].parameters[p]);
  }
}

void check_blend(const SceneSettings& scene, const ScanLayout& layout) {
  require(scene.domain_nm > 0.0 && std::isfinite(scene.domain_nm), "scene.domain_nm", scene.domain_nm, "> 0");
  constexpr double most_domains = 1000.0;
  for (std::size_t i = 0; i < layout.size_nm.size(); ++i) {
    const double size = layout.size_nm[i], bound = most_domains * scene.domain_nm;
    require(size > 0.0 && size < bound, fmt::format("scan.size_nm[{}]", i), size,
            fmt::format("> 0 and < {} ({} times scene.domain_nm)", bound, most_domains));
  }
}

void fill_blend(const SceneSettings& scene, const ScanLayout& layout, SceneMaps& maps) {
  Random random(scene.seed);
  const Domains domains(scene.domain_nm, random);
  const Grains grains(0.4 * scene.domain_nm, layout.size_nm[0], layout.size_nm[1], random);
  for (std::uint32_t line = 0; line < maps.lines; ++line) {
    for (std::uint32_t column = 0; column < maps.columns; ++column) {
      const double x = (column + 0.5) * layout.size_nm[0] / maps.columns;
      const double y = (line + 0.5) * layout.size_nm[1] / maps.lines;
      const bool second = domains.second_phase(x, y);
      const std::size_t i = maps.index(line, column);
      maps.height_nm[i] = (second ? scene.step_nm : 0.0) + scene.grain_nm * grains.height(x, y);
      for (std::size_t p = 0; p < maps.parameters.size(); ++p) {
        maps.parameters[p][i] = scene.materials[second ? 1 : 0].parameters[p];
      }
    }
  }
}

// The map's nearest values, times `unit`.
std::vector<double> read_map(const std::string& path, const SceneMaps& maps, double unit, double lower,
                             double upper) {
  const GsfMap map = read_gsf(path);
  std::vector<double> values(std::size_t{maps.lines} * maps.columns);
  for (std::uint32_t line = 0; line < maps.lines; ++line) {
    for (std::uint32_t column = 0; column < maps.columns; ++column) {
      const auto row = static_cast<std::size_t>((line + 0.5) * map.lines / maps.lines);
      const auto at = static_cast<std::size_t>((column + 0.5) * map.columns / maps.columns);
      const double value = unit * static_cast<double>(map.values[row * map.columns + at]);
      if (!(value >= lower && value <= upper)) {
        throw InputError(path, fmt::format("value in row {}, column {}", row, at),
                         fmt::format("{} (as the simulator takes it), must be {}..{}", value, lower, upper));
      }
      values[maps.index(line, column)] = value;
    }
  }
  return values;
}

void check_maps(const SceneSettings& scene, const ModelInfo& model) {
  const std::size_t wanted = model.parameters.size() - 1;
  require(scene.parameter_maps.size() == wanted, "scene.parameter_maps",
          static_cast<double>(scene.parameter_maps.size()),
          fmt::format("{}, one a parameter of model {} but the first", wanted, model.name));
}

void fill_maps(const SceneSettings& scene, const ModelInfo& model, SceneMaps& maps) {
  maps.height_nm = read_map(scene.height_map, maps, 1e9, -1e5, 1e5);
  for (std::size_t p = 0; p < maps.parameters.size(); ++p) {
    const ParameterInfo& info = model.parameters[p + 1];
    maps.parameters[p] = read_map(scene.parameter_maps[p], maps, 1.0, info.lower, info.upper);
  }
}

}  // namespace

void check_scene(const SceneSettings& scene, const ModelInfo& model, const ScanLayout& layout) {
  require(layout.lines >= 1, "scan.lines", layout.lines, ">= 1");
  require(layout.columns >= 1, "scan.columns", layout.columns, ">= 1");
  const std::size_t pixels = std::size_t{layout.lines} * layout.columns;
  if (pixels > most_pixels)
    throw std::invalid_argument(
        fmt::format("scan: lines * columns = {}, must be <= {}: the scene is computed for every pixel",
                    pixels, most_pixels));
  constexpr std::array<std::size_t, 3> materials{1, 2, 0};  // of flat, blend, maps
  check_materials(scene, model, materials.at(static_cast<std::size_t>(scene.kind)));
  if (scene.kind == SceneSettings::Kind::blend) check_blend(scene, layout);
  if (scene.kind == SceneSettings::Kind::maps) check_maps(scene, model);
}

SceneMaps make_scene(const SceneSettings& scene, const ModelInfo& model, const ScanLayout& layout) {
  check_scene(scene, model, layout);
  const std::size_t pixels = std::size_t{layout.lines} * layout.columns;
  SceneMaps maps;
  maps.lines = layout.lines;
  maps.columns = layout.columns;
  maps.height_nm.assign(pixels, 0.0);
  maps.parameters.assign(model.parameters.size() - 1, std::vector<double>(pixels));
  switch (scene.kind) {
    case SceneSettings::Kind::flat:
      fill_flat(scene, maps);
      break;
    case SceneSettings::Kind::blend:
      fill_blend(scene, layout, maps);
      break;
    case SceneSettings::Kind::maps:
      fill_maps(scene, model, maps);
      break;
  }
  return maps;
}

std::vector<bool> after_step(const SceneMaps& maps, const ScanLayout& layout, Direction direction,
                             double height_nm) {
  const std::size_t columns = maps.columns;
  std::vector<bool> after(maps.height_nm.size(), false);
  const auto differs = [&](std::size_t a, std::size_t b) {
    const auto in_parameter = [&](const std::vector<double>& map) { return map[a] != map[b]; };
    return std::abs(maps.height_nm[a] - maps.height_nm[b]) > height_nm ||
           std::ranges::any_of(maps.parameters, in_parameter);
  };
  for (std::size_t i = 0; i < after.size(); ++i) {
    const std::size_t line_start = i - i % columns;
    if (direction == Direction::retrace) {
      // Retrace begins where the trace of the same line ended: the same pixel.
      after[i] = i + 1 < line_start + columns && differs(i, i + 1);
    } else if (i > line_start) {
      after[i] = differs(i, i - 1);
    } else if (i > 0) {
      after[i] = differs(i, layout.bidirectional ? i - columns : i - 1);
    }
  }
  return after;
}

}  // namespace combforce
