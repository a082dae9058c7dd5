#include "dsp/pixel_clock.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace combforce {

namespace {

// floor(j * samples / columns) without overflow: j <= columns < 2^32.
std::uint64_t boundary(std::uint64_t samples, std::uint64_t columns, std::uint64_t j) {
  return samples / columns * j + samples % columns * j / columns;
}

std::uint64_t analysis_first(std::uint64_t first, std::uint64_t end, const ScanLayout& layout,
                             std::uint64_t window_samples) {
  const std::uint64_t analysed = layout.windows * window_samples;
  return analysed >= end - first ? first : end - analysed;
}

void require_positive(const char* field, std::uint64_t value) {
  if (value == 0) throw std::invalid_argument(fmt::format("scan.{}: 0 is less than 1", field));
}

}  // namespace

void validate(const ScanLayout& layout, std::uint64_t window_samples) {
  require_positive("lines", layout.lines);
  require_positive("columns", layout.columns);
  require_positive("windows", layout.windows);
  // In extended precision: the sum may exceed 64 bits, and then it exceeds any pixel_samples too.
  const auto needed = static_cast<long double>(layout.settle_samples) +
                      static_cast<long double>(layout.windows) * static_cast<long double>(window_samples);
  if (static_cast<long double>(layout.pixel_samples) < needed)
    throw std::invalid_argument(fmt::format(
        "scan.pixel_samples: {} is less than settle_samples + windows * window_samples = {} + {} * {}",
        layout.pixel_samples, layout.settle_samples, layout.windows, window_samples));
  constexpr std::uint64_t most_samples = std::uint64_t{1} << 53;
  if (layout.pixel_samples > most_samples / layout.columns)
    throw std::invalid_argument(
        fmt::format("scan.pixel_samples: {} in each of {} columns are more than 2^53, the last sample that "
                    "messages can say",
                    layout.pixel_samples, layout.columns));
}

PixelSpan pixel_of_line(const LineMark& mark, const ScanLayout& layout, std::uint64_t window_samples,
                        std::uint32_t j) {
  PixelSpan span;
  span.frame = mark.frame;
  span.line = mark.line;
  span.column = mark.direction == Direction::trace ? j : layout.columns - 1 - j;
  span.direction = mark.direction;
  span.first_sample = mark.first_sample + boundary(mark.line_samples, layout.columns, j);
  span.end_sample = mark.first_sample + boundary(mark.line_samples, layout.columns, std::uint64_t{j} + 1);
  span.analysis_first = analysis_first(span.first_sample, span.end_sample, layout, window_samples);
  return span;
}

PixelSpan pixel_unmarked(std::uint64_t first_sample, const ScanLayout& layout, std::uint64_t window_samples,
                         std::uint32_t j) {
  const std::uint64_t length = std::max(layout.pixel_samples, layout.windows * window_samples);
  PixelSpan span;
  span.column = j;
  span.first_sample = first_sample + length * j;
  span.end_sample = span.first_sample + length;
  span.analysis_first = analysis_first(span.first_sample, span.end_sample, layout, window_samples);
  return span;
}

double settling_residual(const PixelSpan& pixel, std::uint64_t step_sample, double tau_samples) {
  if (step_sample >= pixel.end_sample) return 0.0;
  if (step_sample >= pixel.analysis_first) return 1.0;
  return std::exp(-static_cast<double>(pixel.analysis_first - step_sample) / tau_samples);
}

}  // namespace combforce
