#include "daemon/cli/maps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "proto/gsf.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Unit {
  std::string_view ending;  // of a name
  double in_si;
  std::string_view si;
};

// The first that fits counts.
constexpr std::array<Unit, 12> units{{{"_gpa_sqrt_nm", 1.0, ""},  // Pa sqrt(m): GSF knows integer powers only
                                      {"_gpa", 1e9, "Pa"},
                                      {"_n_per_m", 1.0, "N/m"},
                                      {"_mj_per_m2", 1e-3, "J/m^2"},
                                      {"_zj", 1e-21, "J"},
                                      {"_nn_nm2", 1e-27, "N m^2"},
                                      {"_us", 1e-6, "s"},
                                      {"_nn_nm", 1e-18, "J"},
                                      {"_nm", 1e-9, "m"},
                                      {"_nn", 1e-9, "N"},
                                      {"_fw", 1e-15, "W"},
                                      {"_v", 1.0, "V"}}};

Unit unit_of(std::string_view name) {
  for (const Unit& unit : units) {
    if (name.ends_with(unit.ending)) return unit;
  }
  return {"", 1.0, ""};
}

double value_of(const std::vector<NamedValue>& values, std::string_view name) {
  const auto found = std::ranges::find_if(values, [&](const auto& v) { return v.name == name; });
  return found == values.end() ? nan : found->value;
}

}  // namespace

MapPixel map_pixel(const RetiredPixel& pixel) {
  const PixelSpan& span = pixel.pixel.span;
  MapPixel out{span.line, span.column, span.direction, pixel.fit.status, pixel.analysis.layout.size_nm, {}};
  if (const ModelInfo* model = pixel.analysis.model; model != nullptr) {
    const std::size_t known = std::min<std::size_t>(pixel.fit.parameters_count, model->parameters.size());
    for (std::size_t i = 0; i < known; ++i) {
      out.values.push_back({std::string(model->parameters[i].name), pixel.fit.parameters[i]});
    }
    if (const TipGeometry* tip = pixel.analysis.tip(); tip != nullptr && known > 0) {
      const MaterialParameters material = material_of(*model, {pixel.fit.parameters.data(), known}, *tip);
      for (const auto& [name, value] : quantities(material))
        if (value) out.values.push_back({std::string(name), *value});
    }
  }
  const Channels& channels = *pixel.analysis.description.channels;
  for (std::size_t i = 1; i < std::min(channels.size(), pixel.pixel.channel_means.size()); ++i) {
    out.values.push_back({channel_key(channels[i]), pixel.pixel.channel_means[i]});
  }
  return out;
}

MapWriter::MapWriter(std::string directory) : directory_(std::move(directory)) {}

void MapWriter::add(const MapPixel& pixel) {
  if (pixel.line >= max_lines || pixel.column >= max_columns) {
    ++left_out_;
    return;
  }
  lines_ = std::max(lines_, pixel.line + 1);
  columns_ = std::max(columns_, pixel.column + 1);
  size_nm_ = pixel.size_nm;
  Side& maps = sides_[static_cast<std::size_t>(pixel.direction)];
  const auto set = [&](Rows& rows, double value) {
    if (rows.size() <= pixel.line) rows.resize(pixel.line + 1);
    std::vector<double>& row = rows[pixel.line];
    if (row.size() <= pixel.column) row.resize(pixel.column + 1, nan);
    row[pixel.column] = value;
  };
  for (auto& [name, rows] : maps) set(rows, nan);
  for (const NamedValue& value : pixel.values) set(maps[value.name], value.value);
  const double height = value_of(pixel.values, "z_nm") + value_of(pixel.values, "surface_position_nm");
  if (!std::isnan(height)) set(maps["topography_nm"], height);
  set(maps["status"], static_cast<double>(pixel.status));
}

std::vector<double> MapWriter::map(Direction direction, std::string_view name) const {
  const auto found = side(direction).find(name);
  if (found == side(direction).end()) return {};
  std::vector<double> dense(std::size_t{lines_} * columns_, nan);
  for (std::size_t line = 0; line < found->second.size(); ++line) {
    std::ranges::copy(found->second[line], dense.begin() + static_cast<std::ptrdiff_t>(line * columns_));
  }
  return dense;
}

void MapWriter::write() const {
  std::error_code error;
  std::filesystem::create_directories(directory_, error);
  if (error) throw std::runtime_error(fmt::format("{}: {}", directory_, error.message()));
  for (const Direction direction : {Direction::trace, Direction::retrace}) {
    for (const auto& [name, rows] : side(direction)) write_map(direction, name);
  }
}

void MapWriter::write_map(Direction direction, const std::string& name) const {
  const Unit unit = unit_of(name);
  GsfMap gsf;
  gsf.columns = columns_;
  gsf.lines = lines_;
  gsf.x_m = size_nm_[0] * 1e-9;
  gsf.y_m = size_nm_[1] * 1e-9;
  gsf.value_unit = unit.si;
  gsf.title = fmt::format("{} {}", name, to_string(direction));
  for (const double value : map(direction, name))
    gsf.values.push_back(static_cast<float>(value * unit.in_si));
  write_gsf(fmt::format("{}/{}_{}.gsf", directory_, to_string(direction), name), gsf);
}

}  // namespace combforce
