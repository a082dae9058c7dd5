// Settled pixels of known force, from the simulator: it integrates in time, the fit balances in frequency.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "drivers/simulated/steady_state.hpp"
#include "dsp/comb_extractor.hpp"
#include "fit/drive.hpp"
#include "fit/pixel_fitter.hpp"

namespace combforce::test {

using Phasors = std::vector<std::complex<double>>;

inline const std::vector<std::uint64_t> four_tones{234, 1348, 3516, 6470};  // the paper's

// A cantilever under a drive, its comb and its free motion; Delta f = 500 Hz.
struct SimulatedPixels {
  static constexpr double sample_rate_hz = 25e6;  // tones alias below 0.001 pm from there on
  static constexpr std::uint64_t window_samples = 50'000;

  Cantilever cantilever;
  std::vector<std::uint64_t> drive_bins, bins;
  DriveScheme scheme = DriveScheme::equal_energy;
  // Of a 16-bit converter through which the motion goes before its tones are extracted; none: tones are
  // exact.
  std::optional<double> nm_per_code = std::nullopt;

  // The paper's cantilever (table 1), driven and measured on these bins; free amplitudes sum to 50 nm.
  static SimulatedPixels paper(const std::vector<std::uint64_t>& bins,
                               DriveScheme scheme = DriveScheme::equal_energy) {
    return {{{{117e3, 212.0, 4.0, 1.0},
              {674e3, 457.0, 78.5, 1.0},
              {1758e3, 507.0, 366.0, 1.0},
              {3235e3, 600.0, 1330.0, 1.0}}},
            bins,
            bins,
            scheme};
  }

  // The first mode alone, driven on two neighbouring bins, measured on twelve about them.
  static SimulatedPixels intermodulation() {
    return {{{{117e3, 212.0, 4.0, 1.0}}},
            {234, 235},
            {229, 230, 231, 232, 233, 234, 235, 236, 237, 238, 239, 240},
            DriveScheme::equal_amplitude};
  }

  // The same as an int16 recording keeps them: full scale is twice the free amplitudes' sum of 50 nm, as the
  // simulated digitizer has it.
  SimulatedPixels recorded() const {
    SimulatedPixels recorded = *this;
    recorded.nm_per_code = 100.0 / 32768.0;
    return recorded;
  }

  std::vector<std::complex<double>> drive_forces_nn() const {
    std::vector<double> frequencies_hz;
    for (const std::uint64_t bin : drive_bins) frequencies_hz.push_back(frequency_hz(bin));
    Drive drive;
    drive.scheme = scheme;
    return drive_forces(drive, cantilever, frequencies_hz);
  }

  static double frequency_hz(std::uint64_t bin) {
    return sample_rate_hz / static_cast<double>(window_samples) * static_cast<double>(bin);
  }

  FitConditions conditions(const std::string& model, unsigned refine) const {
    FitConditions conditions;
    conditions.sample_rate_hz = sample_rate_hz;
    conditions.comb = comb();
    conditions.cantilever = cantilever;
    conditions.free_response = FreeResponse{0, 0, free_tones(), {}};
    conditions.noise = Noise{300.0, {rounding_nm_per_sqrt_hz()}};
    conditions.settings.model = model;
    conditions.settings.refine = refine;
    return conditions;
  }

  // Tones over this surface, settled until they move by less than 0.005 pm from one window to the next; empty
  // where they do not (bistable or chaotic motion).
  std::optional<Phasors> tones(const std::string& model, const std::vector<double>& parameters) const {
    SteadyStateSettings settings;
    settings.oscillator.sample_rate_hz = sample_rate_hz;
    settings.oscillator.window_samples = window_samples;
    settings.oscillator.cantilever = cantilever;
    settings.oscillator.drive_bins = drive_bins;
    settings.oscillator.drive_forces_nn = drive_forces_nn();
    settings.oscillator.accuracy = IntegratorAccuracy::accurate;
    settings.model = model;
    settings.parameters = parameters;
    settings.bins = bins;
    for (const std::uint32_t windows : {14U, 40U}) {
      settings.settle_windows = windows;
      settings.keep_motion = false;
      const Phasors before = simulate_steady_state(settings).tip_nm;
      settings.settle_windows = windows + 1;
      settings.keep_motion = nm_per_code.has_value();
      const SteadyState after = simulate_steady_state(settings);
      double moved = 0.0;
      for (std::size_t i = 0; i < before.size(); ++i)
        moved = std::max(moved, std::abs(after.tip_nm[i] - before[i]));
      if (moved < 5e-6)
        return nm_per_code ? through_codes(after.tip_motion_nm, after.first_sample) : after.tip_nm;
    }
    return std::nullopt;
  }

 private:
  Comb comb() const {
    Comb comb;
    comb.window_samples = window_samples;
    for (const std::uint64_t bin : bins)
      comb.tones.push_back({bin, std::ranges::find(drive_bins, bin) != drive_bins.end()});
    return comb;
  }

  Phasors free_tones() const {
    const Phasors forces = drive_forces_nn();
    Phasors free(bins.size());
    std::vector<double> motion(nm_per_code ? window_samples : 0);
    for (std::size_t i = 0; i < drive_bins.size(); ++i) {
      const std::complex<double> tone = tip_response(cantilever, frequency_hz(drive_bins[i])) * forces[i];
      free[static_cast<std::size_t>(std::ranges::find(bins, drive_bins[i]) - bins.begin())] = tone;
      for (std::size_t n = 0; n < motion.size(); ++n)
        motion[n] += (tone * std::polar(1.0, 2.0 * std::numbers::pi / static_cast<double>(window_samples) *
                                                 static_cast<double>(drive_bins[i] * n % window_samples)))
                         .real();
    }
    return nm_per_code ? through_codes(motion, 0) : free;
  }

  Phasors through_codes(std::span<const double> motion_nm, std::uint64_t first_sample) const {
    std::vector<std::int16_t> codes;
    for (const double deflection : motion_nm)
      codes.push_back(static_cast<std::int16_t>(std::lround(deflection / *nm_per_code)));
    constexpr double never = std::numeric_limits<double>::infinity();
    CombExtractor extractor(comb(), 1, SampleFormat::i16, -never, never);
    extractor.begin(first_sample, 1);
    extractor.add(codes.data(), codes.size());
    Phasors tones(bins.size());
    double mean = 0.0;
    extractor.finish(tones, {&mean, 1});
    for (std::complex<double>& tone : tones) tone *= *nm_per_code;
    return tones;
  }

  // Rounding to codes as white noise, of a twelfth of a code squared, in the pixel and in the free motion.
  double rounding_nm_per_sqrt_hz() const {
    return nm_per_code ? *nm_per_code * std::sqrt(2.0 / 12.0 / (sample_rate_hz / 2.0)) : 0.0;
  }
};

// DMT parameters of soft to stiff polymers under the paper's drive.
inline std::vector<double> random_dmt(std::mt19937_64& random) {
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<>(low, high)(random);
  };
  const double p0 = between(-43.0, -37.0), p1 = between(0.4, 2.5), p2 = between(2.0, 9.0),
               p3 = between(0.35, 0.8);
  return {p0, p1, p2, p3};
}

// Greatest error: of the surface position in nm, of the others relative.
inline double greatest_error(const FitResult& result, const std::vector<double>& truth) {
  double greatest = std::abs(result.parameters[0] - truth[0]);
  for (std::size_t k = 1; k < truth.size(); ++k)
    greatest = std::max(greatest, std::abs(result.parameters[k] / truth[k] - 1.0));
  return greatest;
}

}  // namespace combforce::test
