// The `pixel` notification, byte for byte the same live and in replay (message contract).
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dsp/channel.hpp"
#include "dsp/comb.hpp"
#include "dsp/pixel.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"
#include "fit/material.hpp"

namespace combforce {

enum class PixelFields : std::uint8_t { fit, tones, all };

// What a pixel message says: the pixel, its tones as tip deflection (nm, one a tone of the comb; NaN becomes
// null), and the fit. Without a model (null) the fit says {"model": null, "status": …} alone. Parameters,
// standard errors and correlation are null as a whole when none of their values is known, and null one by one
// else. "intervals", {parameter: [lower, upper]}, are there when a profile was asked for and found, so are
// "calibration_errors", {parameter: error}; "aicc" and "compared", {model: {status, chi2_reduced, aicc}},
// when models were compared. Where the
// tip is known, the fit ends with "material": the quantities of fit/material.hpp that follow, and the theory
// of adhesion that the Tabor number asks for.
struct PixelMessage {
  const Pixel& pixel;
  const Comb& comb;
  const Channels&
      channels;  // of channel_means; keys "<name>_<unit>", unit in lower case; channel 0 is left out
  std::span<const std::complex<double>> tip_nm;
  const ModelInfo* model;
  const FitResult& fit;
  const TipGeometry* tip = nullptr;  // null: not known, and no "material" in the fit
};

// Appends one line with its newline. Objects keep the contract's order; non-integers carry 9 significant
// digits; `tones` leaves the fit out, `fit` the tones. A pure function of its arguments. Reentrant.
void append_pixel_line(std::string& out, const PixelMessage& message, PixelFields fields);

// What a channel's mean is called: "<name>_<unit>", "z_nm".
std::string channel_key(const Channel& channel);

std::string_view to_string(FitStatus status);
std::string_view to_string(Direction direction);
std::vector<std::string_view> flag_names(PixelFlags flags);

}  // namespace combforce
