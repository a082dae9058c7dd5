// Pixels of a case under Langevin forces in the time domain, one after the other over a surface at rest.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/cli/paper/cases.hpp"

namespace combforce::paper {

// At 25 MS/s, where tones alias by less than 0.001 pm, in the simulator's live setting. Thread-bound.
class ThermalPixels {
 public:
  static constexpr double sample_rate_hz = 25e6;
  static constexpr std::uint64_t window_samples = 50'000;  // Delta f = 500 Hz

  // Settled over the surface of the case's truth for 18 ms. `windows`: contiguous ones averaged in a pixel.
  ThermalPixels(const Case& of, unsigned windows, double noise_k, std::uint64_t draw_seed);

  // Peak phasors of the tip's deflection in the next pixel at these bins, nm.
  std::vector<std::complex<double>> next(std::span<const std::uint64_t> bins);

 private:
  unsigned windows_;
  Oscillator oscillator_;
  std::vector<double> samples_;
};

// Of the case's drive and the far cantilever: peak phasors at these bins, nm; 0 where it does not drive.
std::vector<std::complex<double>> free_response(const Case& of, std::span<const std::uint64_t> bins);

}  // namespace combforce::paper
