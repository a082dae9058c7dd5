// The frequency comb: every tone is an integer bin of Delta f = sample rate / window length.
#pragma once

#include <cstdint>
#include <numbers>
#include <vector>

namespace combforce {

struct Tone {
  std::uint64_t bin = 0;
  bool driven = true;  // a drive tone; otherwise a response (intermodulation, harmonic) only

  bool operator==(const Tone&) const = default;
};

struct Comb {
  std::uint64_t window_samples = 0;  // N; Delta f = sample_rate / N
  std::vector<Tone> tones;           // in the order of every per-tone array of the project

  bool operator==(const Comb&) const = default;
};

// Throws std::invalid_argument naming field, value and bound: N >= 3, at least one tone, 0 < bin < N/2 (no
// DC, no Nyquist), no bin twice.
void validate(const Comb& comb);

// Phase index of bin b at stream sample n, in integers: ((b mod N)(n mod N)) mod N. The phase is
// 2 pi index / N, exact for any length of stream; the same in doubles loses 33 pm after a month.
constexpr std::uint64_t phase_index(std::uint64_t bin, std::uint64_t sample, std::uint64_t window_samples) {
  // Both factors are below N; N < 2^32 keeps the product inside 64 bits (validate() enforces it).
  return (bin % window_samples) * (sample % window_samples) % window_samples;
}

constexpr double phase_radians(std::uint64_t index, std::uint64_t window_samples) {
  return 2.0 * std::numbers::pi * static_cast<double>(index) / static_cast<double>(window_samples);
}

}  // namespace combforce
