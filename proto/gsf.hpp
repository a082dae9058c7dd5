// Gwyddion Simple Field 1.0: a map as a text header and float32 rows from the top.
//
// First line "Gwyddion Simple Field 1.0", then "key = value" lines, then 1 to 4 NULs up to a multiple of four
// bytes, then little-endian float32.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace combforce {

struct GsfMap {
  std::uint32_t columns = 0, lines = 0;
  double x_m = 0.0, y_m = 0.0;  // extent in metres (XReal, YReal with XYUnits m); 0: not known
  std::string value_unit;       // base SI unit, "" when dimensionless
  std::string title;
  std::vector<float> values;  // lines x columns, row 0 at the top; NaN where nothing was measured
};

// Throws std::invalid_argument when values are not lines x columns or a text has more than one line, and
// std::runtime_error naming the file and what failed; the file is replaced atomically.
void write_gsf(const std::string& path, const GsfMap& map);
// Throws InputError naming file, header field ("/XRes"), value and bound; header fields it does not know are
// skipped.
GsfMap read_gsf(const std::string& path);

}  // namespace combforce
