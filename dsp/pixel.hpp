// One pixel as the extraction leaves it: where it is, what was measured in it, and what befell it.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "dsp/scan.hpp"

namespace combforce {

// A set of the conditions that forbid a fit. Any flag makes the pixel's status `flagged`.
enum class PixelFlag : std::uint8_t {
  gap = 1 << 0,         // samples were lost within [first_sample, end_sample)
  clipped = 1 << 1,     // a deflection sample of an analysed window is at its clip code
  settling = 1 << 2,    // a commanded step (line start, drive, set-point) still rings by more than 1 %
  incomplete = 1 << 3,  // the stream ended, or the line was cut, before the last window did
  incoherent = 1 << 4,  // the free response drifted in its capture: drive and digitizer share no clock
  sync = 1 << 5         // line marks contradict each other or the layout
};

class PixelFlags {
 public:
  constexpr void set(PixelFlag flag) {
    bits_ = static_cast<std::uint8_t>(bits_ | static_cast<std::uint8_t>(flag));
  }
  constexpr bool has(PixelFlag flag) const { return (bits_ & static_cast<std::uint8_t>(flag)) != 0; }
  constexpr bool any() const { return bits_ != 0; }
  constexpr void clear() { bits_ = 0; }
  bool operator==(const PixelFlags&) const = default;

 private:
  std::uint8_t bits_ = 0;
};

// Position of a pixel in the raster and in the stream.
struct PixelSpan {
  std::uint32_t frame = 0;
  std::uint32_t line = 0;    // spatial row
  std::uint32_t column = 0;  // spatial column: on retrace it counts down in time
  Direction direction = Direction::trace;
  std::uint64_t first_sample = 0;
  std::uint64_t end_sample = 0;      // one past the last
  std::uint64_t analysis_first = 0;  // the last windows * N samples: [analysis_first, end_sample)

  bool operator==(const PixelSpan&) const = default;
};

// `phasors` holds one peak phasor a tone, of channel 0 (the deflection), in codes times the channel's scale
// (volts), phase referenced to stream sample 0, averaged over the pixel's windows. With flag gap or
// incomplete its values are NaN: they would depend on what is missing. `channel_means` holds the mean
// over the analysed windows of every channel, scale * code + offset, in the order of the stream.
struct Pixel {
  PixelSpan span;
  PixelFlags flags;
  std::vector<std::complex<double>> phasors;
  std::vector<double> channel_means;
};

}  // namespace combforce
