// From line marks to pixels: a pure map, the same live and in replay.
#pragma once

#include <cstdint>

#include "dsp/pixel.hpp"
#include "dsp/scan.hpp"

namespace combforce {

// Throws std::invalid_argument naming field, value and bound: lines, columns, windows >= 1; pixel_samples >=
// settle_samples + windows * window_samples.
void validate(const ScanLayout& layout, std::uint64_t window_samples);

// Pixel j in time, 0 <= j < columns, of a marked line; the layout is valid. The last windows * N samples of
// it are analysed. On retrace the spatial column is columns - 1 - j. The pixel is shorter than settle +
// windows * N when line_samples is: then analysis_first < first_sample + settle_samples, and where not even
// the windows fit analysis_first == first_sample with fewer than windows * N samples behind it. The caller
// compares and flags `sync`.
PixelSpan pixel_of_line(const LineMark& mark, const ScanLayout& layout, std::uint64_t window_samples,
                        std::uint32_t j);

// Pixel j of a stream without marks: contiguous pixels of layout.windows * N samples (pixel_samples when that
// is longer) from sample `first_sample` on, frame 0, line 0, column j.
PixelSpan pixel_unmarked(std::uint64_t first_sample, const ScanLayout& layout, std::uint64_t window_samples,
                         std::uint32_t j);

// What is left, at the start of the analysed windows, of the transient of a step at `step_sample`:
// exp(-t/tau), tau > 0. 1 when the step falls into the windows, 0 when it comes after the pixel.
double settling_residual(const PixelSpan& pixel, std::uint64_t step_sample, double tau_samples);

}  // namespace combforce
