// The paper's cantilever and its five cases, for tests of the simulator.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/simulated/steady_state.hpp"
#include "fit/drive.hpp"

namespace combforce::test {

inline constexpr double pm = 1e-3;  // nm

inline Cantilever paper_cantilever() {
  return {{{117e3, 212.0, 4.0, 1.0},
           {674e3, 457.0, 78.5, 1.0},
           {1758e3, 507.0, 366.0, 1.0},
           {3235e3, 600.0, 1330.0, 1.0}}};
}

// Drive tones at bins of 500 Hz, phases 0, free amplitudes that sum to 50 nm.
inline OscillatorSettings paper_oscillator(std::vector<std::uint64_t> bins, DriveScheme scheme,
                                           double sample_rate_hz, IntegratorAccuracy accuracy) {
  OscillatorSettings settings;
  settings.sample_rate_hz = sample_rate_hz;
  settings.cantilever = paper_cantilever();
  settings.window_samples = static_cast<std::uint64_t>(std::llround(sample_rate_hz / 500.0));
  settings.drive_bins = std::move(bins);
  std::vector<double> frequencies;
  for (const std::uint64_t bin : settings.drive_bins) frequencies.push_back(500.0 * static_cast<double>(bin));
  Drive drive;
  drive.scheme = scheme;
  settings.drive_forces_nn = drive_forces(drive, settings.cantilever, frequencies);
  settings.accuracy = accuracy;
  return settings;
}

struct PaperCase {
  std::string name, model;
  std::vector<double> truth;
  std::vector<std::uint64_t> bins;
  DriveScheme scheme = DriveScheme::equal_energy;
  std::vector<std::complex<double>> free_nm, engaged_nm;

  SteadyStateSettings steady_state(double sample_rate_hz, IntegratorAccuracy accuracy) const {
    SteadyStateSettings settings;
    settings.oscillator = paper_oscillator(bins, scheme, sample_rate_hz, accuracy);
    settings.model = model;
    settings.parameters = truth;
    settings.bins = bins;
    return settings;
  }
};

inline std::vector<std::complex<double>> phasors(const nlohmann::json& pairs) {
  std::vector<std::complex<double>> values;
  for (const auto& pair : pairs) values.emplace_back(pair.at(0).get<double>(), pair.at(1).get<double>());
  return values;
}

// Empty when the reference material is absent.
inline std::vector<PaperCase> paper_cases() {
  const std::filesystem::path path =
      std::filesystem::path(COMBFORCE_SHARED_DIR) / "cases" / "paper_cases.json";
  std::ifstream file(path);
  if (!file) return {};
  std::vector<PaperCase> cases;
  for (const auto& json : nlohmann::json::parse(file)) {
    PaperCase& paper_case = cases.emplace_back();
    paper_case.name = json.at("name");
    paper_case.model = json.at("model");
    paper_case.truth = json.at("truth").get<std::vector<double>>();
    paper_case.bins = json.at("bins").get<std::vector<std::uint64_t>>();
    const bool energy = paper_case.name.find("equal_energy") != std::string::npos;
    paper_case.scheme = energy ? DriveScheme::equal_energy : DriveScheme::equal_amplitude;
    paper_case.free_nm = phasors(json.at("free_nm"));
    paper_case.engaged_nm = phasors(json.at("engaged_nm"));
  }
  return cases;
}

}  // namespace combforce::test
