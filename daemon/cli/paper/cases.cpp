#include "daemon/cli/paper/cases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "drivers/simulated/random.hpp"

namespace combforce::paper {
namespace {

constexpr std::array<std::uint64_t, 4> mode_bins{234, 1348, 3516, 6470};
constexpr double total_amplitude_nm = 50.0;  // 100 nm peak to peak

std::vector<std::uint64_t> first_bins(std::size_t count) {
  return {mode_bins.begin(), mode_bins.begin() + static_cast<std::ptrdiff_t>(count)};
}

std::vector<double> frequencies(const Case& of) {
  std::vector<double> hz;
  for (const std::uint64_t bin : of.bins) hz.push_back(delta_f_hz * static_cast<double>(bin));
  return hz;
}

}  // namespace

const Cantilever& cantilever() {
  static const Cantilever table_1{{{117e3, 212, 4.0, 1.0},
                                   {674e3, 457, 78.5, 1.0},
                                   {1758e3, 507, 366.0, 1.0},
                                   {3235e3, 600, 1330.0, 1.0}}};
  return table_1;
}

std::span<const Case> cases() {
  using enum DriveScheme;
  static const std::vector<double> hertz{-40.0, 1.0}, dmt{-40.0, 1.0, 5.0, 0.5};
  static const std::vector<Case> all{
      {"hertz_2tone_equal_energy",
       "2 tones, equal energy",
       "hertz",
       equal_energy,
       first_bins(2),
       hertz,
       {{-40.12, 1.04}, {-40.11, 1.03}, {0.10, 0.05}}},
      {"hertz_2tone_equal_amplitude",
       "2 tones, equal amplitude",
       "hertz",
       equal_amplitude,
       first_bins(2),
       hertz,
       {{-39.28, 0.70}, {-39.18, 0.80}, {1.07, 0.45}}},
      {"hertz_4tone_equal_energy",
       "4 tones, equal energy",
       "hertz",
       equal_energy,
       first_bins(4),
       hertz,
       {{-40.12, 1.05}, {-40.12, 1.05}, {0.05, 0.02}}},
      {"dmt_4tone_equal_energy",
       "4 tones, equal energy",
       "dmt",
       equal_energy,
       first_bins(4),
       dmt,
       {{-40.14, 1.07, 5.23, 0.49}, {-40.16, 1.08, 5.24, 0.49}, {0.07, 0.03, 0.11, 0.04}}},
      {"dmt_4tone_equal_amplitude",
       "4 tones, equal amplitude",
       "dmt",
       equal_amplitude,
       first_bins(4),
       dmt,
       {{-40.02, 1.07, 5.23, 0.65}, {-39.92, 1.09, 5.60, 0.46}, {0.25, 0.33, 1.25, 0.67}}}};
  return all;
}

const Case& find_case(std::string_view key) {
  const auto found = std::ranges::find(cases(), key, &Case::key);
  if (found == cases().end()) throw std::invalid_argument(fmt::format("\"{}\" is no case of the paper", key));
  return *found;
}

CaseMotion simulate(const Case& of, std::uint64_t oversampling) {
  CaseMotion motion{&of, {}, {}};
  const std::vector<double> hz = frequencies(of);
  SteadyStateSettings settings;
  settings.oscillator.sample_rate_hz = sample_rate_hz * static_cast<double>(oversampling);
  settings.oscillator.cantilever = cantilever();
  settings.oscillator.window_samples = window_samples * oversampling;
  settings.oscillator.drive_bins = of.bins;
  settings.oscillator.drive_forces_nn =
      drive_forces({of.scheme, total_amplitude_nm, {}, {}}, cantilever(), hz);
  settings.oscillator.accuracy = IntegratorAccuracy::accurate;
  settings.model = of.model;
  settings.parameters = of.truth;
  settings.bins = of.bins;
  settings.keep_motion = true;
  for (std::size_t i = 0; i < hz.size(); ++i)
    motion.free_nm.push_back(tip_response(cantilever(), hz[i]) * settings.oscillator.drive_forces_nn[i]);
  motion.engaged = simulate_steady_state(settings);
  return motion;
}

FitConditions fit_conditions(const CaseMotion& motion) {
  FitConditions conditions;
  conditions.sample_rate_hz = sample_rate_hz;
  conditions.comb.window_samples = window_samples;
  for (const std::uint64_t bin : motion.of->bins) conditions.comb.tones.push_back({bin, true});
  conditions.cantilever = cantilever();
  conditions.free_response = FreeResponse{0, 0, motion.free_nm, {}};
  conditions.settings.model = motion.of->model;
  return conditions;
}

std::vector<std::complex<double>> noisy_tones(const CaseMotion& motion, std::size_t draw) {
  const auto row = static_cast<std::uint64_t>(motion.of - cases().data());
  Random random(seed, row * all_draws + draw);
  std::vector<std::complex<double>> tones = motion.engaged.tip_nm;
  for (std::size_t i = 0; i < tones.size(); ++i) {
    const Mode& mode = cantilever().modes[i];
    const double force_nn = std::sqrt(thermal_force_density(mode, temperature_k) * delta_f_hz);
    const double quadrature_nm =
        mode.quality_factor / mode.stiffness_n_per_m * force_nn / std::numbers::sqrt2;
    const double re = random.normal();
    const double im = random.normal();
    tones[i] += quadrature_nm * std::complex<double>(re, im);
  }
  return tones;
}

}  // namespace combforce::paper
