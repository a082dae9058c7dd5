#include "daemon/cli/paper/thermal_pixels.hpp"

#include <algorithm>

#include "dsp/fourier.hpp"

namespace combforce::paper {
namespace {

constexpr int settle_windows = 9;

std::vector<std::complex<double>> drive_of(const Case& of) {
  std::vector<double> frequencies_hz;
  for (const std::uint64_t bin : of.bins) frequencies_hz.push_back(delta_f_hz * static_cast<double>(bin));
  Drive drive;
  drive.scheme = of.scheme;
  return drive_forces(drive, cantilever(), frequencies_hz);
}

OscillatorSettings settings_of(const Case& of, double noise_k, std::uint64_t draw_seed) {
  OscillatorSettings settings;
  settings.sample_rate_hz = ThermalPixels::sample_rate_hz;
  settings.cantilever = cantilever();
  settings.window_samples = ThermalPixels::window_samples;
  settings.drive_bins = of.bins;
  settings.drive_forces_nn = drive_of(of);
  settings.temperature_k = noise_k;
  settings.seed = draw_seed;
  return settings;
}

}  // namespace

ThermalPixels::ThermalPixels(const Case& of, unsigned windows, double noise_k, std::uint64_t draw_seed)
    : windows_(windows), oscillator_(settings_of(of, noise_k, draw_seed)), samples_(window_samples) {
  oscillator_.engage(find_model(of.model), of.truth);
  for (int i = 0; i < settle_windows; ++i) oscillator_.advance(samples_);
}

std::vector<std::complex<double>> ThermalPixels::next(std::span<const std::uint64_t> bins) {
  std::vector<std::complex<double>> tones(bins.size());
  for (unsigned i = 0; i < windows_; ++i) {
    oscillator_.advance(samples_);  // 1 nm/V in every mode
    const std::vector<std::complex<double>> all = spectrum_of(samples_);
    for (std::size_t b = 0; b < bins.size(); ++b) tones[b] += all[bins[b]] / static_cast<double>(windows_);
  }
  return tones;
}

std::vector<std::complex<double>> free_response(const Case& of, std::span<const std::uint64_t> bins) {
  const std::vector<std::complex<double>> forces = drive_of(of);
  std::vector<std::complex<double>> tones(bins.size());
  for (std::size_t b = 0; b < bins.size(); ++b) {
    const auto driven = std::ranges::find(of.bins, bins[b]);
    if (driven != of.bins.end())
      tones[b] = tip_response(cantilever(), delta_f_hz * static_cast<double>(bins[b])) *
                 forces[static_cast<std::size_t>(driven - of.bins.begin())];
  }
  return tones;
}

}  // namespace combforce::paper
