// A small simulated instrument for tests: one mode, Hertz, 2 MS/s, pixels of 2 ms.
#pragma once

#include "drivers/simulated/simulation.hpp"

namespace combforce::test {

inline SimulationSettings small_instrument() {
  SimulationSettings settings;
  settings.sample_rate_hz = 2e6;
  settings.cantilever.modes = {{100e3, 100.0, 4.0, 1.0}};  // rings down in 0.32 ms
  settings.comb.window_samples = 2000;
  settings.comb.tones = {{100, true}};
  settings.model = "hertz";
  settings.scene.materials = {{{1.0}}};
  settings.feedback.start_z_nm = 42.0;
  settings.paced = false;
  settings.block_frames = 1000;
  return settings;
}

inline ScanLayout small_layout() {
  ScanLayout layout;
  layout.lines = 3;
  layout.columns = 5;
  layout.pixel_samples = 4000;
  layout.settle_samples = 2000;
  layout.size_nm = {100.0, 100.0};
  return layout;
}

}  // namespace combforce::test
