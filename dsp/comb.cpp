#include "dsp/comb.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace combforce {

void validate(const Comb& comb) {
  const std::uint64_t n = comb.window_samples;
  if (n < 3) throw std::invalid_argument(fmt::format("comb.window_samples: {} is less than 3", n));
  if (n > std::numeric_limits<std::uint32_t>::max())
    throw std::invalid_argument(fmt::format("comb.window_samples: {} is not less than 2^32", n));
  if (comb.tones.empty()) throw std::invalid_argument("comb.tones: 0 tones, at least 1 is needed");
  std::vector<std::uint64_t> bins;
  for (std::size_t i = 0; i < comb.tones.size(); ++i) {
    const std::uint64_t bin = comb.tones[i].bin;
    if (bin == 0) throw std::invalid_argument(fmt::format("comb.tones[{}].bin: 0 is not above 0 (DC)", i));
    if (bin > (n - 1) / 2)
      throw std::invalid_argument(
          fmt::format("comb.tones[{}].bin: {} is not below half of window_samples, {} (Nyquist)", i, bin, n));
    if (std::ranges::find(bins, bin) != bins.end())
      throw std::invalid_argument(fmt::format("comb.tones[{}].bin: {} occurs twice", i, bin));
    bins.push_back(bin);
  }
}

}  // namespace combforce
