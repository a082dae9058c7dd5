#include "proto/gsf.hpp"

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string_view>

#include "proto/json.hpp"

namespace combforce {
namespace {

static_assert(std::endian::native == std::endian::little, "the data rows are copied as they lie in memory");

constexpr std::string_view magic = "Gwyddion Simple Field 1.0\n";
constexpr std::uint32_t most_points = 1U << 20;  // along a side

std::size_t padding(std::size_t header_bytes) {
  return 4 - header_bytes % 4;
}

void check_line(const char* field, const std::string& text) {
  if (text.find_first_of(std::string_view("\n\0", 2)) != std::string::npos)
    throw std::invalid_argument(fmt::format("GSF {} must be one line", field));
}

std::string encode_header(const GsfMap& map) {
  std::string header(magic);
  header += fmt::format("XRes = {}\nYRes = {}\n", map.columns, map.lines);
  if (map.x_m > 0.0 && map.y_m > 0.0)
    header += fmt::format("XReal = {}\nYReal = {}\nXYUnits = m\n", map.x_m, map.y_m);
  if (!map.value_unit.empty()) header += fmt::format("ZUnits = {}\n", map.value_unit);
  if (!map.title.empty()) header += fmt::format("Title = {}\n", map.title);
  header.append(padding(header.size()), '\0');
  return header;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

using Fields = std::map<std::string, std::string, std::less<>>;

class HeaderReader {
 public:
  HeaderReader(const std::string& path, std::string_view text) : path_(path) {
    while (!text.empty()) {
      const auto line_end = text.find('\n');
      if (line_end == std::string_view::npos) fail("", "the header's last line has no end");
      read_line(text.substr(0, line_end));
      text.remove_prefix(line_end + 1);
    }
  }

  std::string text(std::string_view key) const {
    const auto field = fields_.find(key);
    return field == fields_.end() ? "" : field->second;
  }

  std::uint32_t points(std::string_view key) const {
    const std::string value = text(key);
    if (value.empty()) fail(key, "is missing");
    std::uint32_t number = 0;
    const auto result = std::from_chars(value.data(), value.data() + value.size(), number);
    if (result.ec != std::errc{} || result.ptr != value.data() + value.size() || number < 1 ||
        number > most_points)
      fail(key, fmt::format("is \"{}\", must be an integer in [1, {}]", value, most_points));
    return number;
  }

  double extent(std::string_view key) const {
    const std::string value = text(key);
    if (value.empty()) return 0.0;
    double number = 0.0;
    const auto result = std::from_chars(value.data(), value.data() + value.size(), number);
    if (result.ec != std::errc{} || result.ptr != value.data() + value.size() || !std::isfinite(number) ||
        number <= 0.0)
      fail(key, fmt::format("is \"{}\", must be a number > 0", value));
    return number;
  }

  [[noreturn]] void fail(std::string_view key, const std::string& message) const {
    throw InputError(path_, key.empty() ? "" : "/" + std::string(key), message);
  }

 private:
  void read_line(std::string_view line) {
    const auto equals = line.find('=');
    if (equals == std::string_view::npos)
      fail("", fmt::format("header line \"{}\" is no \"key = value\"", line));
    const std::string key(trimmed(line.substr(0, equals)));
    if (!fields_.emplace(key, trimmed(line.substr(equals + 1))).second) fail(key, "duplicate key");
  }

  const std::string& path_;
  Fields fields_;
};

std::string read_bytes(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) throw InputError(path, "", "cannot be read: " + error.message());
  std::string bytes(size, '\0');
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(bytes.data(), static_cast<std::streamsize>(size)))
    throw InputError(path, "", "cannot be read");
  return bytes;
}

}  // namespace

void write_gsf(const std::string& path, const GsfMap& map) {
  if (map.columns == 0 || map.lines == 0 || map.values.size() != std::size_t{map.columns} * map.lines)
    throw std::invalid_argument(
        fmt::format("GSF map has {} values, must have {} x {}", map.values.size(), map.lines, map.columns));
  check_line("value_unit", map.value_unit);
  check_line("title", map.title);
  const std::string header = encode_header(map);
  const std::string unfinished = path + ".tmp";
  std::ofstream stream(unfinished, std::ios::binary | std::ios::trunc);
  stream.write(header.data(), static_cast<std::streamsize>(header.size()));
  stream.write(reinterpret_cast<const char*>(map.values.data()),
               static_cast<std::streamsize>(map.values.size() * sizeof(float)));
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(unfinished, path, error);
  if (!stream || error) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    throw std::runtime_error(path + ": cannot be written" + (error ? ": " + error.message() : ""));
  }
}

GsfMap read_gsf(const std::string& path) {
  const std::string bytes = read_bytes(path);
  if (!bytes.starts_with(magic))
    throw InputError(path, "", "does not begin with \"Gwyddion Simple Field 1.0\"");
  const auto header_end = bytes.find('\0');
  if (header_end == std::string::npos) throw InputError(path, "", "the header is not ended by a NUL");
  const HeaderReader header(path, std::string_view(bytes).substr(magic.size(), header_end - magic.size()));
  GsfMap map;
  map.columns = header.points("XRes");
  map.lines = header.points("YRes");
  const std::size_t data = header_end + padding(header_end);
  const std::uint64_t expected = data + std::uint64_t{4} * map.columns * map.lines;
  if (bytes.size() != expected)
    header.fail("", fmt::format("has {} bytes, must have {} for {} x {} points", bytes.size(), expected,
                                map.columns, map.lines));
  if (bytes.find_first_not_of('\0', header_end) < data) header.fail("", "the header's padding is not NUL");
  const std::string unit = header.text("XYUnits");
  if (!unit.empty() && unit != "m") header.fail("XYUnits", fmt::format("is \"{}\", must be \"m\"", unit));
  if (!unit.empty()) {
    map.x_m = header.extent("XReal");
    map.y_m = header.extent("YReal");
  }
  map.value_unit = header.text("ZUnits");
  map.title = header.text("Title");
  map.values.resize(std::size_t{map.columns} * map.lines);
  std::memcpy(map.values.data(), bytes.data() + data, map.values.size() * sizeof(float));
  return map;
}

}  // namespace combforce
