// The simulated instrument without its clock: deflection and z sample by sample, the scan with its feedback,
// the analogue chain and its converter. Deterministic: the same settings and the same commands before the
// same samples give the same codes, however the samples are asked for.
//
// Thread-bound.
#pragma once

#include <complex>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "drivers/simulated/oscillator.hpp"
#include "drivers/simulated/raster.hpp"
#include "drivers/simulated/scene.hpp"
#include "drivers/simulated/simulation.hpp"
#include "dsp/channel.hpp"
#include "dsp/comb_extractor.hpp"
#include "dsp/sample_block.hpp"

namespace combforce {

// What the surface really was in a pixel.
struct PixelTruth {
  std::uint32_t frame = 0, line = 0, column = 0;
  Direction direction = Direction::trace;
  std::uint64_t first_sample = 0;
  std::vector<double> parameters;  // in the model's order
};

class SampleSource {
 public:
  explicit SampleSource(const SimulationSettings& settings);  // validates

  // Commands: from the next pixel boundary on while a scan runs, otherwise from the next sample on. After a
  // scan the tip is withdrawn at once and z keeps its value.
  void start_scan(const ScanLayout& layout, std::uint32_t frames, SceneMaps scene);  // no scan may run
  void stop_scan();
  void set_drive(const Drive& drive);  // must fit the comb
  // The drive's clock from the next sample on (Oscillator::detune); no step is marked.
  void detune(double relative) { oscillator_.detune(relative); }
  bool scanning() const { return raster_.has_value(); }

  // Appends frames to a block: codes (interleaved) and marks, at most `frames`, fewer when the marks would
  // exceed BlockHeader::max_marks. header.first_sample + header.frames must be next_sample().
  void append(std::uint32_t frames, BlockHeader& header, std::vector<std::int16_t>& codes);

  std::uint64_t next_sample() const { return oscillator_.next_sample(); }
  const ModelInfo& model() const { return model_; }

  // Called by append() when a pixel begins.
  std::function<void(const PixelTruth&)> truth;

 private:
  bool at_boundary() const { return !pixel_ || pixel_->end_sample == next_sample(); }
  void pass_boundary(BlockHeader& header);
  void begin_pixel(BlockHeader& header);
  std::uint64_t analysis_first() const;  // of the pixel
  void generate(std::size_t frames, std::vector<std::int16_t>& codes);
  void convert(std::uint64_t first_sample, std::vector<std::int16_t>& codes);
  void update_feedback();

  SimulationSettings settings_;
  const ModelInfo& model_;
  Channels channels_;
  Oscillator oscillator_;
  Random detector_noise_;
  double detector_sigma_v_;
  double tip_nm_per_code_;  // at the first tone
  double set_point_nm_ = 0.0;
  CombExtractor amplitude_;  // of the first tone
  std::vector<double> volts_;

  ScanLayout layout_;
  SceneMaps scene_;
  std::optional<Raster> raster_;      // while a scan runs
  std::optional<RasterPixel> pixel_;  // in which the next sample lies, unless it is its end
  double z_nm_;
  bool stop_scan_ = false;
  std::optional<Drive> new_drive_;
};

}  // namespace combforce
