// Maps of a scan: one value a pixel for every parameter and channel, trace and retrace apart, written as GSF
// files.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "dsp/scan.hpp"
#include "fit/fit_result.hpp"

namespace combforce {

struct NamedValue {
  std::string name;  // with its unit: "adhesion_nn", "z_nm"
  double value;      // NaN: not known
};

struct MapPixel {
  std::uint32_t line = 0, column = 0;
  Direction direction = Direction::trace;
  FitStatus status = FitStatus::not_fitted;
  std::array<double, 2> size_nm{0.0, 0.0};  // of the scan; 0: not known
  std::vector<NamedValue> values;           // parameters and channel means
};

MapPixel map_pixel(const RetiredPixel& pixel);

// Collects pixels; a later frame replaces the pixels of an earlier one. The maps grow with the pixels that
// come. Besides the values it is given it keeps `status` (the FitStatus as a number) and, where both are
// known, topography_nm = z_nm + surface_position_nm, the height of the surface. Thread-bound.
class MapWriter {
 public:
  // Lines and columns from here on are left out, and counted.
  static constexpr std::uint32_t max_lines = 1u << 16, max_columns = 1u << 24;

  explicit MapWriter(std::string directory);  // of write()

  void add(const MapPixel& pixel);
  std::uint64_t left_out() const { return left_out_; }

  std::uint32_t lines() const { return lines_; }
  std::uint32_t columns() const { return columns_; }
  // lines() x columns() values, row 0 scanned first, NaN where nothing was measured; empty when there is no
  // such map.
  std::vector<double> map(Direction direction, std::string_view name) const;

  // DIRECTION_NAME.gsf for each map, in the directory, which is made. Values are in the SI unit of the name's
  // ending; where there is none (gpa_sqrt_nm, nn_per_nm2, status) as they are. Throws std::runtime_error
  // naming the file.
  void write() const;

 private:
  using Rows = std::vector<std::vector<double>>;  // rows may be short: NaN beyond
  using Side = std::map<std::string, Rows, std::less<>>;

  const Side& side(Direction direction) const { return sides_[static_cast<std::size_t>(direction)]; }
  void write_map(Direction direction, const std::string& name) const;

  std::string directory_;
  std::array<Side, 2> sides_;
  std::uint32_t lines_ = 0, columns_ = 0;
  std::array<double, 2> size_nm_{0.0, 0.0};
  std::uint64_t left_out_ = 0;
};

}  // namespace combforce
