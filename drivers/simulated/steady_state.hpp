// Offline studies: the motion of the cantilever over a surface at rest, after its transients.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/simulated/oscillator.hpp"

namespace combforce {

struct SteadyStateSettings {
  OscillatorSettings
      oscillator;  // its sample rate is that of `motion`; tones alias from twice its Nyquist on
  std::string model = "dmt";
  std::vector<double> parameters;    // in the model's order
  std::vector<std::uint64_t> bins;   // to be extracted, each < N/2
  std::uint32_t settle_windows = 9;  // engaged before the analysis: 18 ms at Delta f = 500 Hz
  std::uint32_t windows = 1;         // analysed, of N samples each
  bool keep_motion = false;
};

struct SteadyState {
  std::vector<std::complex<double>> tip_nm;                // total deflection, peak phasors, one a bin
  std::vector<std::vector<std::complex<double>>> mode_nm;  // the same of every mode: [mode][bin]
  // Over the analysed windows, one value a sample; empty unless keep_motion.
  std::vector<double> tip_motion_nm;
  std::vector<std::vector<double>> mode_motion_nm;  // [mode][sample]
  std::uint64_t first_sample = 0;                   // of the analysis; a multiple of N
  std::uint64_t cells = 0;                          // integrated: the cost
};

// Phasors are sums over samples, so a tone at f also collects what there is at k * sample_rate +- f. From 25
// MS/s on that is below 0.001 pm for the paper's cantilever. Throws std::invalid_argument naming field, value
// and bound. Reentrant.
SteadyState simulate_steady_state(const SteadyStateSettings& settings);

}  // namespace combforce
