// The simulator's own random numbers: the same seed gives the same noise with every standard library, whose
// distributions are free to differ.
#pragma once

#include <array>
#include <cstdint>

namespace combforce {

// xoshiro256++ 1.0 (Blackman, Vigna 2019), seeded through SplitMix64. Period 2^256 - 1. Thread-bound.
class Random {
 public:
  // Different `stream`s of one seed are independent for all purposes here.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  std::uint64_t bits() {
    const std::uint64_t result = rotate(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotate(state_[3], 45);
    return result;
  }

  // In [0, 1), a multiple of 2^-53.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

  // Standard normal, by the ziggurat of 256 layers (Marsaglia, Tsang 2000; layer and position from different
  // bits, as Doornik 2005 asks). Exact in the tail.
  double normal() {
    const std::uint64_t random = bits();
    const std::size_t layer = random & 255;
    const double x = static_cast<double>(random >> 11) * 0x1.0p-53 * edge_[layer];
    const double sign = (random & 256) != 0 ? -1.0 : 1.0;
    return x < edge_[layer + 1] ? sign * x : sign * normal_beyond(layer, x);
  }

 private:
  static std::uint64_t rotate(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
  double normal_beyond(std::size_t layer, double x);

  static const std::array<double, 257> edge_;  // of the layers, falling from the base strip's to 0
  std::array<std::uint64_t, 4> state_{};
};

}  // namespace combforce
