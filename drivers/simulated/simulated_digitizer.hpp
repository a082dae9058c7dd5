// The simulated instrument as a digitizer: a driven cantilever over a scene, with feedback, noise, converter
// and faults on request.
//
// - Paced, it delivers at the sample rate and drops like a live source; where the machine is too slow for
//   that it delivers late, and realtime_factor says so. Free-running, it delivers as fast as blocks are
//   taken.
// - A scan asked for before start() begins at sample free_seconds * sample_rate, so offline runs repeat
// exactly; one
//   asked for later begins with the next block. The tip approaches over the first pixel for
//   Raster::approach_pixels pixels before the first line. While no scan runs the tip is withdrawn and moves
//   freely; after a scan it takes a few ring-down times to do so.
// - stop_scan() and set_drive() act at the next pixel boundary, or with the next block while no scan runs;
// the
//   step is marked.
// - Lost samples are computed like others, so what follows a loss is the same with and without it. Marks of a
// lost
//   stretch come with the first block after it. After a loss of unknown length the stream index goes on as if
//   nothing had been lost, in a new epoch: phases then refer to another time.
#pragma once

#include <functional>
#include <memory>

#include "drivers/digitizer.hpp"
#include "drivers/simulated/sample_source.hpp"

namespace combforce {

class SimulatedDigitizer final : public Digitizer {
 public:
  // Throws std::invalid_argument naming field, value and bound.
  explicit SimulatedDigitizer(const SimulationSettings& settings);
  ~SimulatedDigitizer() override;  // stops

  const StreamInfo& info() const override;
  void start(BlockSink& sink) override;
  void stop() override;
  StreamStatus status() const override;
  // Both throw as make_scene() and validate(layout); start_scan() also std::logic_error while a scan runs.
  void prepare_scan(const ScanLayout& layout) override;
  void start_scan(const ScanLayout& layout, std::uint32_t frames) override;
  void stop_scan() override;
  void set_drive(const Drive& drive) override;
  Drive drive() const override;

  const ModelInfo& model() const;

  // Called from the digitizer's thread whenever a pixel of a line begins. May be changed at any time; on
  // return the sink before is not called any more.
  void set_truth_sink(std::function<void(const PixelTruth&)> sink);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
