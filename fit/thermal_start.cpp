#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "fit/thermal_fit.hpp"
#include "fit/thermal_oscillator.hpp"

namespace combforce {
namespace {

constexpr double down = 0.8, up = 1.25;  // how far the frequency may be off

struct Bin {
  double hz, density;
};

// The stretch of `width` bins with the greatest mean; its middle.
double strongest(const std::vector<Bin>& bins, std::size_t width, double about_hz) {
  double sum = 0.0, greatest = -1.0, at = about_hz;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    sum += bins[i].density;
    if (i >= width) sum -= bins[i - width].density;
    if (i + 1 < width) continue;
    const double middle = bins[i - (width - 1) / 2].hz;
    if (middle < down * about_hz || middle > up * about_hz || sum <= greatest) continue;
    greatest = sum;
    at = middle;
  }
  return at;
}

// -ln likelihood a bin and average of a peak and a floor whose sizes come from the means within half a width
// of the peak and beyond.
double misfit(const std::vector<Bin>& bins, double frequency_hz, double quality) {
  const double reach = 0.5 * frequency_hz / quality;
  double inside = 0.0, outside = 0.0, shape_inside = 0.0, shape_outside = 0.0;
  std::size_t count_inside = 0, count_outside = 0;
  std::vector<double> shape;
  for (const Bin& bin : bins) {
    shape.push_back(oscillator_density(frequency_hz, quality, bin.hz).value);
    const bool in = std::abs(bin.hz - frequency_hz) <= reach;
    (in ? inside : outside) += bin.density;
    (in ? shape_inside : shape_outside) += shape.back();
    ++(in ? count_inside : count_outside);
  }
  constexpr std::size_t least_inside = 3;
  if (count_inside < least_inside || count_outside == 0) return std::numeric_limits<double>::infinity();
  inside /= static_cast<double>(count_inside);
  shape_inside /= static_cast<double>(count_inside);
  outside /= static_cast<double>(count_outside);
  shape_outside /= static_cast<double>(count_outside);
  constexpr double smallest_floor = 1e-6;
  double variance = (inside - outside) / (shape_inside - shape_outside);
  double floor = outside - variance * shape_outside;
  if (!(variance > 0.0)) return std::numeric_limits<double>::infinity();
  if (floor < smallest_floor * inside) {
    floor = smallest_floor * inside;
    variance = inside / shape_inside;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const double expected = variance * shape[i] + floor;
    sum += bins[i].density / expected + std::log(expected);
  }
  return sum;
}

}  // namespace

OscillatorStart find_start(const AveragedSpectrum& spectrum, double about_hz, const FrequencyBand& within) {
  std::vector<Bin> bins;
  for (std::size_t i = 0; i < spectrum.density.size(); ++i) {
    const double hz = spectrum.frequency_hz(i);
    if (hz >= within.low_hz && hz <= within.high_hz && hz > spectrum.bin_hz)
      bins.push_back({hz, spectrum.density[i]});
  }
  if (!(about_hz > 0.0) || bins.empty() || down * about_hz > bins.back().hz ||
      up * about_hz < bins.front().hz)
    throw std::invalid_argument(fmt::format("frequency_hz: {}, the spectrum has nothing there: {} to {} Hz",
                                            about_hz, bins.empty() ? 0.0 : bins.front().hz,
                                            bins.empty() ? 0.0 : bins.back().hz));
  OscillatorStart best{about_hz, 1.0};
  double least = std::numeric_limits<double>::infinity();
  constexpr double most = 20000.0, step = 1.5;
  for (double quality = 1.0; quality <= most; quality *= step) {
    const auto width = static_cast<std::size_t>(about_hz / quality / spectrum.bin_hz);
    const double frequency = strongest(bins, std::clamp<std::size_t>(width, 1, bins.size()), about_hz);
    const double value = misfit(bins, frequency, quality);
    if (value >= least) continue;
    least = value;
    best = {frequency, quality};
  }
  return best;
}

}  // namespace combforce
