#include "fit/harmonics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace combforce {
namespace {

constexpr double negligible_compliance = 1e-3;
// More take a fit longer than they help it to converge.
constexpr std::size_t most_listed = 96;
constexpr std::size_t most_harmonics = 100'000;

// Where chi, going as sum f_m^2/k_m / f^2 far above all modes, has fallen to the negligible share of chi(0).
double compliant_band_hz(const Cantilever& cantilever) {
  double inertial = 0.0, compliance = 0.0;
  for (const Mode& mode : cantilever.modes) {
    inertial += mode.frequency_hz * mode.frequency_hz / mode.stiffness_n_per_m;
    compliance += 1.0 / mode.stiffness_n_per_m;
  }
  return std::sqrt(inertial / (negligible_compliance * compliance));
}

// The most_listed of `candidates` with the greatest motion(candidate), greatest first.
template <typename Motion>
std::vector<std::size_t> strongest(std::vector<std::size_t> candidates, const Motion& motion) {
  const std::size_t count = std::min(most_listed, candidates.size());
  std::ranges::partial_sort(candidates, candidates.begin() + static_cast<std::ptrdiff_t>(count),
                            std::ranges::greater{}, motion);
  candidates.resize(count);
  return candidates;
}

}  // namespace

Harmonics::Harmonics(const Comb& comb, const Cantilever& cantilever, double delta_f_hz,
                     double band_of_tones) {
  std::uint64_t divisor = 0;
  for (const Tone& tone : comb.tones) divisor = std::gcd(divisor, tone.bin);
  periods_ = divisor;
  for (const Tone& tone : comb.tones) tones_.push_back(tone.bin / divisor);
  highest_tone_ = *std::ranges::max_element(tones_);
  spacing_hz_ = static_cast<double>(divisor) * delta_f_hz;
  const double harmonics = std::max(band_of_tones * static_cast<double>(highest_tone_),
                                    compliant_band_hz(cantilever) / spacing_hz_);
  const std::size_t band =
      std::max(highest_tone_,
               static_cast<std::size_t>(std::min(std::ceil(harmonics), static_cast<double>(most_harmonics))));
  is_tone_.resize(band + 1);
  for (const std::size_t tone : tones_) is_tone_[tone] = true;
  std::vector<std::size_t> others;
  for (std::size_t n = 0; n <= band; ++n) {
    response_.push_back(tip_response(cantilever, static_cast<double>(n) * spacing_hz_));
    if (!is_tone_[n]) others.push_back(n);
  }
  strong_ = strongest(others, [&](std::size_t n) { return std::abs(response_[n]); });
}

}  // namespace combforce
