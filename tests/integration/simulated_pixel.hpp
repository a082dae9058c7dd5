// Settled pixels of known force, from the simulator: it integrates in time, the fit balances in frequency.
#pragma once

#include <algorithm>
#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "drivers/simulated/steady_state.hpp"
#include "fit/drive.hpp"
#include "fit/pixel_fitter.hpp"

namespace combforce::testing {

using Phasors = std::vector<std::complex<double>>;

// A cantilever under a drive, its comb and its free motion; Delta f = 500 Hz.
struct SimulatedPixels {
  static constexpr double sample_rate_hz = 25e6;  // tones alias below 0.001 pm from there on
  static constexpr std::uint64_t window_samples = 50'000;

  Cantilever cantilever;
  std::vector<std::uint64_t> drive_bins, bins;
  DriveScheme scheme = DriveScheme::equal_energy;

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
    conditions.comb.window_samples = window_samples;
    conditions.cantilever = cantilever;
    FreeResponse free;
    const auto forces = drive_forces_nn();
    for (const std::uint64_t bin : bins) {
      const auto driven = std::ranges::find(drive_bins, bin);
      conditions.comb.tones.push_back({bin, driven != drive_bins.end()});
      free.mean_nm.push_back(driven == drive_bins.end()
                                 ? 0.0
                                 : tip_response(cantilever, frequency_hz(bin)) *
                                       forces[static_cast<std::size_t>(driven - drive_bins.begin())]);
    }
    conditions.free_response = free;
    conditions.noise = Noise{300.0, {0.0}};
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
      const Phasors before = simulate_steady_state(settings).tip_nm;
      settings.settle_windows = windows + 1;
      Phasors after = simulate_steady_state(settings).tip_nm;
      double moved = 0.0;
      for (std::size_t i = 0; i < after.size(); ++i) moved = std::max(moved, std::abs(after[i] - before[i]));
      if (moved < 5e-6) return after;
    }
    return std::nullopt;
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

}  // namespace combforce::testing
