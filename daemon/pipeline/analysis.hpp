// The description in force over a stretch of the stream, and what is derived from it once.
#pragma once

#include <complex>
#include <memory>
#include <vector>

#include "drivers/digitizer.hpp"
#include "dsp/comb_extractor.hpp"
#include "dsp/sample_block.hpp"
#include "dsp/scan.hpp"
#include "fit/force_model.hpp"
#include "fit/pixel_fitter.hpp"
#include "proto/description.hpp"

namespace combforce {

// Tip deflection per volt of channel 0 at a tone: chi/chi_V with a cantilever, without one the channel's
// nm_per_v (1 where that is not said either).
std::complex<double> nm_per_volt(const Description& description, double frequency_hz);

// Immutable; shared by everything that still refers to it.
struct Analysis {
  Description description;                         // channels and comb are always present
  ScanLayout layout;                               // description.scan, or one window a pixel without it
  const ModelInfo* model = nullptr;                // null: no cantilever, so nothing to fit with
  std::vector<std::complex<double>> tip_per_volt;  // nm_per_volt() of every tone
  double ring_down_samples = 0.0;                  // longest of the cantilever; 0 when not known

  const TipGeometry* tip() const {  // null: not described
    return description.fit && description.fit->tip ? &*description.fit->tip : nullptr;
  }
};

// Throws std::invalid_argument naming field, value and bound: no comb, tones at or beyond Nyquist, a scan
// that does not fit its windows, a reference or noise that does not match the comb, an unknown model.
std::shared_ptr<const Analysis> make_analysis(const StreamInfo& info, Description description);

// An analysis with the objects that carry it out: the extraction thread owns `extractor`, fit worker i of
// `workers` (0: nothing is fitted) owns fitters[i]. Everything is allocated here, before the stretch begins.
struct AnalysisStage {
  AnalysisStage(const StreamInfo& info, std::shared_ptr<const Analysis> of, unsigned workers);

  // Extraction thread: gives the block's frames [from, until) to the extractor; returns how many it took.
  std::size_t add(const SampleBlock& block, std::uint64_t from, std::uint64_t until);

  std::shared_ptr<const Analysis> analysis;
  CombExtractor extractor;
  std::vector<PixelFitter> fitters;  // empty also when analysis->model is null
};

}  // namespace combforce
