// In which order a scan visits its pixels, and when.
#pragma once

#include <cstdint>
#include <optional>

#include "dsp/scan.hpp"

namespace combforce {

struct RasterPixel {
  bool in_line = false;                // false: overscan of the approach, over the pixel (0, 0)
  std::uint32_t line = 0, column = 0;  // spatial
  std::uint64_t first_sample = 0, end_sample = 0;
  LineMark mark;  // of the line it lies in
  bool begins_line = false;
};

// Approach, then for every frame line after line (trace, then retrace when bidirectional), without a gap:
// line i in time begins columns * pixel_samples after line i-1.
class Raster {
 public:
  // Pixels of overscan, over the first pixel, in which the feedback finds its set-point before the first
  // line.
  static constexpr std::uint32_t approach_pixels = 8;

  // `frames` 0: without end. The layout must be valid (pixel_clock.hpp).
  Raster(const ScanLayout& layout, std::uint32_t frames, std::uint64_t first_sample);

  // The next pixel in time, or nothing after the last.
  std::optional<RasterPixel> next();

 private:
  ScanLayout layout_;
  std::uint32_t frames_;
  std::uint64_t first_sample_;
  std::uint64_t pixel_ = 0;  // in time, the approach included
};

}  // namespace combforce
