#include "proto/spectrum_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "proto/json.hpp"
#include "proto/text_file.hpp"

namespace combforce {
namespace {

constexpr std::string_view blanks = " \t\r,;";

std::string_view without_blanks(std::string_view text) {
  const auto first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

// Replaces every occurrence.
std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

// "4.501×10⁻¹⁰" -> "4.501e-10".
std::string plain_number(std::string_view text) {
  constexpr std::pair<std::string_view, std::string_view> signs[] = {
      {"×10", "e"}, {"⁻", "-"}, {"⁰", "0"}, {"¹", "1"}, {"²", "2"}, {"³", "3"},
      {"⁴", "4"},   {"⁵", "5"}, {"⁶", "6"}, {"⁷", "7"}, {"⁸", "8"}, {"⁹", "9"}};
  std::string plain(text);
  for (const auto& [from, to] : signs) plain = replaced(std::move(plain), from, to);
  return plain;
}

std::optional<double> whole_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

class SpectrumReader {
 public:
  SpectrumReader(const std::string& file, std::size_t column) : file_(file), column_(column) {}

  void line(std::string_view text) {
    ++line_;
    text = without_blanks(text);
    if (text.empty()) return;
    if (text.front() == '#') {
      header(without_blanks(text.substr(1)));
    } else {
      row(text);
    }
  }

  SpectrumFile take() {
    constexpr std::size_t least_rows = 16;
    if (frequencies_.size() < least_rows)
      throw InputError(
          file_, "",
          fmt::format("has {} rows of numbers, must have at least {}", frequencies_.size(), least_rows));
    result_.first_hz = frequencies_.front();
    result_.bin_hz =
        (frequencies_.back() - frequencies_.front()) / static_cast<double>(frequencies_.size() - 1);
    const double step = frequencies_[1] - frequencies_[0];
    constexpr double tolerance = 0.02;
    for (std::size_t i = 1; i < frequencies_.size(); ++i) {
      const double expected = frequencies_[i - 1] + step;
      if (!(step > 0.0) || std::abs(frequencies_[i] - expected) > tolerance * step)
        throw InputError(file_, fmt::format("line {}", lines_[i]),
                         fmt::format("frequency {} Hz, must be {} Hz: in equal steps, ascending",
                                     frequencies_[i], expected));
    }
    return std::move(result_);
  }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(file_, fmt::format("line {}", line_), message);
  }

  void row(std::string_view text) {
    for (std::size_t column = 1; column <= column_; ++column) {
      if (text.empty()) fail(fmt::format("has {} columns, must have at least {}", column - 1, column_));
      const auto word = text.substr(0, text.find_first_of(blanks));
      text = without_blanks(text.substr(word.size()));
      if (column != 1 && column != column_) continue;
      const auto value = whole_number(word);
      if (!value) fail(fmt::format("column {} is \"{}\", must be a number", column, word));
      if (!(*value >= 0.0) || !std::isfinite(*value))
        fail(fmt::format("column {} is {}, must be >= 0 and finite", column, *value));
      (column == 1 ? frequencies_ : result_.density).push_back(*value);
    }
    lines_.push_back(line_);
  }

  void header(std::string_view text) {
    if (text == "thermal noise data") result_.vendor.emplace();
    const auto colon = text.find(": ");
    if (!result_.vendor || colon == std::string_view::npos) return;
    const auto key = text.substr(0, colon);
    const auto value = without_blanks(text.substr(colon + 2));
    VendorFit& vendor = *result_.vendor;
    using Units = std::initializer_list<Unit>;
    const auto read = [&](std::string_view name, std::optional<double>& target, Units units) {
      if (key == name) target = quantity(value, units);
    };
    read("sensitivity", vendor.sensitivity_nm_per_v, {{"nm/V", 1.0}, {"µm/V", 1e3}});
    read("spring constant", vendor.stiffness_n_per_m, {{"mN/m", 1e-3}, {"N/m", 1.0}, {"µN/m", 1e-6}});
    read("parameter.f", vendor.frequency_hz, {{"kHz", 1e3}, {"Hz", 1.0}, {"MHz", 1e6}});
    read("parameter.Q", vendor.quality_factor, {{"", 1.0}});
    read("parameter.A", vendor.amplitude_v_per_sqrt_hz,
         {{"µV/√Hz", 1e-6}, {"mV/√Hz", 1e-3}, {"V/√Hz", 1.0}, {"nV/√Hz", 1e-9}});
    read("parameter.noise", vendor.floor_v2_per_hz, {{"V²/Hz", 1.0}});
    read("cantilever.correction factor", vendor.correction_factor, {{"", 1.0}});
    if (key == "settings.temperature") {
      constexpr double freezing_k = 273.15;
      vendor.temperature_k = quantity(value, {{"℃", 1.0}, {"°C", 1.0}}) + freezing_k;
    }
  }

  struct Unit {
    std::string_view name;
    double size;
  };

  double quantity(std::string_view text, std::initializer_list<Unit> units) const {
    const auto blank = text.find(' ');
    const auto number = whole_number(plain_number(text.substr(0, blank)));
    const auto unit =
        blank == std::string_view::npos ? std::string_view{} : without_blanks(text.substr(blank));
    const auto known = std::ranges::find(units, unit, &Unit::name);
    if (number && known != units.end()) return *number * known->size;
    std::string names;
    for (const Unit& one : units) names += fmt::format("{}\"{}\"", names.empty() ? "" : " or ", one.name);
    fail(fmt::format("\"{}\", must be a number with unit {}", text, names));
  }

  const std::string& file_;
  std::size_t column_;
  std::size_t line_ = 0;
  std::vector<double> frequencies_;
  std::vector<std::size_t> lines_;
  SpectrumFile result_;
};

}  // namespace

SpectrumFile parse_spectrum(std::string_view text, const std::string& file, std::size_t column) {
  if (column < 2) throw std::invalid_argument(fmt::format("column: {}, must be at least 2", column));
  SpectrumReader reader(file, column);
  while (!text.empty()) {
    const auto end = std::min(text.find('\n'), text.size());
    reader.line(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return reader.take();
}

SpectrumFile read_spectrum_file(const std::string& path, std::size_t column) {
  return parse_spectrum(read_text_file(path), path, column);
}

}  // namespace combforce
