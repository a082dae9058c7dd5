#include "drivers/simulated/random.hpp"

#include <cmath>

namespace combforce {

namespace {

// Where the tail begins and the area of every layer, for 256 layers of exp(-x^2/2).
constexpr double tail_start = 3.6541528853610088;
constexpr double layer_area = 4.92867323399e-3;

double bell(double x) {
  return std::exp(-0.5 * x * x);
}

std::array<double, 257> layer_edges() {
  std::array<double, 257> edge{};
  edge[0] = layer_area / bell(tail_start);
  edge[1] = tail_start;
  for (std::size_t i = 2; i < 256; ++i) {
    edge[i] = std::sqrt(-2.0 * std::log(layer_area / edge[i - 1] + bell(edge[i - 1])));
  }
  edge[256] = 0.0;
  return edge;
}

std::uint64_t split_mix(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15U;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31);
}

}  // namespace

const std::array<double, 257> Random::edge_ = layer_edges();

Random::Random(std::uint64_t seed, std::uint64_t stream) {
  std::uint64_t mixed = stream;
  std::uint64_t state = seed ^ split_mix(mixed);
  for (std::uint64_t& word : state_) word = split_mix(state);
}

double Random::normal_beyond(std::size_t layer, double x) {
  if (layer == 0) {
    double beyond = 0.0;
    double height = 0.0;
    do {
      beyond = -std::log(1.0 - uniform()) / tail_start;
      height = -std::log(1.0 - uniform());
    } while (2.0 * height < beyond * beyond);
    return tail_start + beyond;
  }
  const double below = bell(edge_[layer]);
  const double above = bell(edge_[layer + 1]);
  if (below + uniform() * (above - below) < bell(x)) return x;
  return std::abs(normal());
}

}  // namespace combforce
