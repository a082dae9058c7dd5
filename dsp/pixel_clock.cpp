#include "dsp/pixel_clock.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace combforce {
namespace {

// floor(j * samples / columns) without overflow: j <= columns < 2^32.
std::uint64_t boundary(std::uint64_t samples, std::uint64_t columns, std::uint64_t j) {
  return samples / columns * j + samples % columns * j / columns;
}

std::uint64_t analysis_first(std::uint64_t first, std::uint64_t end, const ScanLayout& layout,
                             std::uint64_t window) {
  const std::uint64_t analysed = layout.windows * window;
  return analysed >= end - first ? first : end - analysed;
}

void at_least(const char* field, std::uint64_t value, std::uint64_t bound) {
  if (value < bound)
    throw std::invalid_argument(std::string("scan.") + field + ": " + std::to_string(value) + " is below " +
                                std::to_string(bound));
}

}  // namespace

void validate(const ScanLayout& layout, std::uint64_t window_samples) {
  at_least("lines", layout.lines, 1);
  at_least("columns", layout.columns, 1);
  at_least("windows", layout.windows, 1);
  at_least("pixel_samples", layout.pixel_samples, layout.settle_samples + layout.windows * window_samples);
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
