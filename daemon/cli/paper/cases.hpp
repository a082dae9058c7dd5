// What the paper simulated and printed: its instrument (table 1), the five cases of its tables 2 and 3, and
// their motion from our own simulator.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <string_view>
#include <tuple>
#include <vector>

#include "drivers/simulated/steady_state.hpp"
#include "fit/dmt.hpp"
#include "fit/hertz.hpp"
#include "fit/pixel_fitter.hpp"

namespace combforce::paper {

inline constexpr double sample_rate_hz = 200e6;
inline constexpr std::uint64_t window_samples = 400'000;  // 2 ms, Delta f = 500 Hz
inline constexpr double delta_f_hz = sample_rate_hz / window_samples;
inline constexpr double temperature_k = 300.0;
inline constexpr std::size_t all_draws = 100;  // of the noise, a case
inline constexpr std::uint64_t seed = 2014;    // of the noise
inline constexpr int printed_decimals = 2;     // of every value in the paper's tables

// Of the cases.
using Models = std::tuple<Hertz, Dmt>;

// Per parameter, in the model's order.
struct Printed {
  std::vector<double> noise_free, mean, spread;
};

struct Case {
  std::string_view key;    // in JSON and in names of files
  std::string_view label;  // the paper's row
  std::string_view model;
  DriveScheme scheme;
  std::vector<std::uint64_t> bins;  // tone i drives mode i
  std::vector<double> truth;
  Printed printed;
};

const Cantilever& cantilever();

// In the order of the tables: Hertz 2 tones EE, 2 tones EA, 4 tones EE; DMT 4 tones EE, 4 tones EA.
std::span<const Case> cases();
const Case& find_case(std::string_view key);  // one of the above

// A case, simulated for 20 ms at the paper's sample rate in the accurate setting; the last 2 ms are kept.
struct CaseMotion {
  const Case* of = nullptr;
  std::vector<std::complex<double>> free_nm;  // peak phasors, one a tone
  SteadyState engaged;
};
// `oversampling`: times the paper's sample rate.
CaseMotion simulate(const Case& of, std::uint64_t oversampling = 1);

// The fitter of a case: the paper's method, no noise model.
FitConditions fit_conditions(const CaseMotion& motion);

// The paper's noise (its section 2.3): Gaussian of (Q/k) sqrt(S Delta f / 2) in each quadrature of each tone.
// A function of case and draw (< all_draws) only.
std::vector<std::complex<double>> noisy_tones(const CaseMotion& motion, std::size_t draw);

}  // namespace combforce::paper
