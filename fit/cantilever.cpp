#include "fit/cantilever.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace combforce {
namespace {

void require_positive(std::size_t mode, const char* field, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw std::invalid_argument(
        fmt::format("cantilever.modes[{}].{}: {}, must be positive and finite", mode, field, value));
}

}  // namespace

void validate(const Cantilever& cantilever) {
  if (cantilever.modes.empty())
    throw std::invalid_argument("cantilever.modes: empty, at least one mode is needed");
  for (std::size_t m = 0; m < cantilever.modes.size(); ++m) {
    const Mode& mode = cantilever.modes[m];
    require_positive(m, "frequency_hz", mode.frequency_hz);
    require_positive(m, "quality_factor", mode.quality_factor);
    require_positive(m, "stiffness_n_per_m", mode.stiffness_n_per_m);
    if (mode.sensitivity_nm_per_v == 0.0 || !std::isfinite(mode.sensitivity_nm_per_v))
      throw std::invalid_argument(
          fmt::format("cantilever.modes[{}].sensitivity_nm_per_v: {}, must be finite and not zero", m,
                      mode.sensitivity_nm_per_v));
  }
}

std::complex<double> mode_response(const Mode& mode, double frequency_hz) {
  const double ratio = frequency_hz / mode.frequency_hz;
  return 1.0 /
         (mode.stiffness_n_per_m * std::complex<double>(1.0 - ratio * ratio, ratio / mode.quality_factor));
}

std::complex<double> tip_response(const Cantilever& cantilever, double frequency_hz) {
  std::complex<double> sum = 0.0;
  for (const Mode& mode : cantilever.modes) sum += mode_response(mode, frequency_hz);
  return sum;
}

std::complex<double> detector_response(const Cantilever& cantilever, double frequency_hz) {
  std::complex<double> sum = 0.0;
  for (const Mode& mode : cantilever.modes)
    sum += mode_response(mode, frequency_hz) / mode.sensitivity_nm_per_v;
  return sum;
}

std::complex<double> tip_per_volt(const Cantilever& cantilever, double frequency_hz) {
  return tip_response(cantilever, frequency_hz) / detector_response(cantilever, frequency_hz);
}

double ring_down_s(const Mode& mode) {
  return mode.quality_factor / (std::numbers::pi * mode.frequency_hz);
}

double longest_ring_down_s(const Cantilever& cantilever) {
  double longest = 0.0;
  for (const Mode& mode : cantilever.modes) longest = std::max(longest, ring_down_s(mode));
  return longest;
}

}  // namespace combforce
