// The paper's cantilever (table 1) and comb at Delta f = 500 Hz, as conditions of a fit.
#pragma once

#include <complex>
#include <string>
#include <utility>
#include <vector>

#include "fit/pixel_fitter.hpp"

namespace combforce::test {

using Phasors = std::vector<std::complex<double>>;

inline Cantilever paper_cantilever() {
  return {{{117e3, 212.0, 4.0, 1.0},
           {674e3, 457.0, 78.5, 1.0},
           {1758e3, 507.0, 366.0, 1.0},
           {3235e3, 600.0, 1330.0, 1.0}}};
}

inline constexpr double paper_delta_f_hz = 500.0;

// One window a pixel, thermal noise at 300 K, a free response known exactly.
inline FitConditions paper_conditions(std::string model, const std::vector<std::uint64_t>& bins,
                                      Phasors free_nm) {
  FitConditions conditions;
  conditions.sample_rate_hz = 200e6;
  conditions.comb.window_samples = 400000;
  for (const std::uint64_t bin : bins) conditions.comb.tones.push_back({bin, true});
  conditions.cantilever = paper_cantilever();
  conditions.free_response = FreeResponse{0, 1, std::move(free_nm), std::nullopt};
  conditions.noise = Noise{300.0, {0.0}};
  conditions.settings.model = std::move(model);
  return conditions;
}

}  // namespace combforce::test
