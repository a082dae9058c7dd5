#include "fit/thermal_spectrum.hpp"

#include <algorithm>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/trigamma.hpp>
#include <cmath>
#include <numbers>

namespace combforce {

SpectrumStatistics hann_statistics(std::uint64_t segments, std::uint64_t runs) {
  const double pi = std::numbers::pi;
  const BinCorrelation overlap{16.0 / (81.0 * pi * pi), 1.0 / 144.0, 16.0 / (2025.0 * pi * pi)};
  const auto count = static_cast<double>(segments);
  const double pairs = 2.0 * (count - static_cast<double>(std::min(runs, segments))) / count;
  const double variance = 1.0 + pairs / 36.0;
  SpectrumStatistics statistics;
  statistics.averages = count / variance;
  for (std::size_t l = 0; l < overlap.size(); ++l)
    statistics.correlation[l] = (hann_correlation[l] + pairs * overlap[l]) / variance;
  return statistics;
}

MeasuredScatter measure_scatter(const std::vector<double>& ratios) {
  const auto count = static_cast<double>(ratios.size());
  double mean = 0.0, mean_log = 0.0;
  for (const double ratio : ratios) {
    mean += ratio / count;
    mean_log += std::log(ratio) / count;
  }
  // ln n - digamma(n) = s, the likelihood's condition; starts from its expansion for large n.
  const double s = std::max(std::log(mean) - mean_log, 1e-9);
  double shape = (3.0 - s + std::sqrt((s - 3.0) * (s - 3.0) + 24.0 * s)) / (12.0 * s);
  constexpr int most_steps = 50;
  for (int step = 0; step < most_steps; ++step) {
    const double error = std::log(shape) - boost::math::digamma(shape) - s;
    const double next = shape - error / (1.0 / shape - boost::math::trigamma(shape));
    const bool done = std::abs(next - shape) <= 1e-12 * shape;
    shape = next > 0.0 ? next : 0.5 * shape;
    if (done) break;
  }
  double variance = 0.0, product = 0.0;
  for (std::size_t i = 0; i < ratios.size(); ++i) {
    variance += (ratios[i] - mean) * (ratios[i] - mean);
    if (i > 0) product += (ratios[i] - mean) * (ratios[i - 1] - mean);
  }
  return {shape, 1.0 / std::sqrt(count * (boost::math::trigamma(shape) - 1.0 / shape)), product / variance};
}

}  // namespace combforce
