#include "drivers/simulated/raster.hpp"

namespace combforce {

Raster::Raster(const ScanLayout& layout, std::uint32_t frames, std::uint64_t first_sample)
    : layout_(layout), frames_(frames), first_sample_(first_sample) {}

std::optional<RasterPixel> Raster::next() {
  RasterPixel pixel;
  pixel.first_sample = first_sample_ + pixel_ * layout_.pixel_samples;
  pixel.end_sample = pixel.first_sample + layout_.pixel_samples;
  if (pixel_ >= approach_pixels) {
    const std::uint64_t scanned = pixel_ - approach_pixels;
    const std::uint32_t passes = layout_.bidirectional ? 2 : 1;  // over a line
    const std::uint64_t pass = scanned / layout_.columns;
    const std::uint64_t line = pass / passes;
    const auto in_time = static_cast<std::uint32_t>(scanned % layout_.columns);
    pixel.in_line = true;
    pixel.begins_line = in_time == 0;
    pixel.mark.frame = static_cast<std::uint32_t>(line / layout_.lines);
    if (frames_ != 0 && pixel.mark.frame >= frames_) return std::nullopt;
    pixel.line = static_cast<std::uint32_t>(line % layout_.lines);
    pixel.mark.line = pixel.line;
    pixel.mark.direction = pass % passes == 0 ? Direction::trace : Direction::retrace;
    pixel.column = pixel.mark.direction == Direction::trace ? in_time : layout_.columns - 1 - in_time;
    pixel.mark.first_sample = pixel.first_sample - in_time * layout_.pixel_samples;
    pixel.mark.line_samples = layout_.columns * layout_.pixel_samples;
  }
  ++pixel_;
  return pixel;
}

}  // namespace combforce
