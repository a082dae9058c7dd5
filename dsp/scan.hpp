// The raster: how stream samples become lines and pixels (recording contract, afm:scan and line marks).
#pragma once

#include <array>
#include <cstdint>

namespace combforce {

enum class Direction : std::uint8_t { trace, retrace };

// Raster of a scan. All lengths in samples of the stream.
struct ScanLayout {
  std::uint32_t lines = 1;                  // >= 1
  std::uint32_t columns = 1;                // >= 1
  std::uint64_t pixel_samples = 0;          // >= settle_samples + windows * comb window
  std::uint64_t settle_samples = 0;         // skipped at the start of a pixel, at least
  std::uint32_t windows = 1;                // comb windows averaged in a pixel, >= 1
  bool bidirectional = false;               // trace and retrace of every line
  std::array<double, 2> size_nm{0.0, 0.0};  // extent in x and y; 0 when unknown

  bool operator==(const ScanLayout&) const = default;
};

// Where one scan line lies in the stream. Authoritative: pixel j in time starts at
// first_sample + floor(j * line_samples / columns) and ends where the next starts.
struct LineMark {
  std::uint32_t frame = 0;
  std::uint32_t line = 0;  // spatial row, 0 first scanned
  Direction direction = Direction::trace;
  std::uint64_t first_sample = 0;
  std::uint64_t line_samples = 0;

  bool operator==(const LineMark&) const = default;
};

}  // namespace combforce
