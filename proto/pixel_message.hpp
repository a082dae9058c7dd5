// The `pixel` notification, byte for byte the same live and in replay (message contract).
#pragma once

#include <string>

#include "dsp/channel.hpp"
#include "dsp/comb.hpp"
#include "dsp/pixel.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"

namespace combforce {

enum class PixelFields : std::uint8_t { fit, tones, all };

// What a pixel message says: the pixel, its tones as tip deflection (nm, one a tone of the comb; NaN becomes null), and
// the fit. The model is null when none is configured; `fit` is then an object with the status alone.
struct PixelMessage {
  const Pixel& pixel;
  const Comb& comb;
  const Channels& channels;  // names of channel means: "<name>_<unit>"; channel 0 is left out
  std::span<const std::complex<double>> tip_nm;
  const ModelInfo* model;
  const FitResult& fit;
};

// Appends one line with its newline. Objects keep the contract's order; non-integers carry 9 significant digits.
void append_pixel_line(std::string& out, const PixelMessage& message, PixelFields fields);

std::string_view to_string(FitStatus status);
std::string_view to_string(Direction direction);
std::vector<std::string_view> flag_names(PixelFlags flags);

}  // namespace combforce
