// REC.truth.ndjson beside a recording of the simulator: one line a pixel, {frame, line, column, direction,
// first_sample, parameters}, the parameters that the surface really had.
#pragma once

#include <fstream>
#include <memory>
#include <mutex>
#include <string>

#include "drivers/simulated/simulated_digitizer.hpp"

namespace combforce {

// Listens to the digitizer while it lives. Throws std::runtime_error naming a file that cannot be written or
// exists.
class TruthWriter {
 public:
  TruthWriter(const std::string& path, SimulatedDigitizer& digitizer);
  ~TruthWriter();
  TruthWriter(const TruthWriter&) = delete;
  TruthWriter& operator=(const TruthWriter&) = delete;

 private:
  void write(const PixelTruth& truth);

  SimulatedDigitizer& digitizer_;
  std::ofstream file_;
  const ModelInfo& model_;
};

}  // namespace combforce
