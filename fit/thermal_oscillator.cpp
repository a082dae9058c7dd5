#include "fit/thermal_oscillator.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace combforce {
namespace {

using Complex = std::complex<double>;

// 1 - exp(x + iy) without cancellation near 0.
Complex one_minus_exp(double x, double y) {
  const double half = std::sin(0.5 * y);
  return {2.0 * half * half - std::expm1(x) * std::cos(y), -std::exp(x) * std::sin(y)};
}

}  // namespace

OscillatorDensity oscillator_density(double frequency_hz, double quality_factor, double at_hz) {
  const double u = at_hz / frequency_hz;
  const double stiff = 1.0 - u * u;
  const double damped = u / quality_factor;
  const double denominator = stiff * stiff + damped * damped;
  const double value = 2.0 / (std::numbers::pi * frequency_hz * quality_factor * denominator);
  return {value, value * (-1.0 + (-4.0 * u * u * stiff + 2.0 * damped * damped) / denominator),
          value * (-1.0 + 2.0 * damped * damped / denominator)};
}

HannPeriodogram::HannPeriodogram(std::size_t samples, double sample_rate_hz, double frequency_hz,
                                 double quality_factor)
    : samples_(static_cast<double>(samples)), sample_rate_hz_(sample_rate_hz) {
  const double decay = std::numbers::pi * frequency_hz / quality_factor;
  const double resonance = 2.0 * std::numbers::pi * frequency_hz;
  const double rotation = std::sqrt((resonance - decay) * (resonance + decay));
  decay_ = decay / sample_rate_hz;
  rotation_ = rotation / sample_rate_hz;
  ratio_ = decay / rotation;
  last_ =
      std::polar(std::exp(-decay_ * samples_), std::remainder(rotation_ * samples_, 2.0 * std::numbers::pi));
  const double half_turn = std::numbers::pi / samples_;
  sine_weight_ = 0.75 / std::tan(half_turn) + 0.25 * std::tan(half_turn);
}

HannPeriodogram::Sums HannPeriodogram::windowed_sums(double turn) const {
  const Complex through = 1.0 - last_;
  using Three = std::array<Complex, 3>;
  Three first, second, first_by_log, second_by_log;  // sums of a^m and (N - m) a^m
  for (std::size_t j = 0; j < 3; ++j) {
    const double phase = turn + (static_cast<double>(j) - 1.0) * 2.0 * std::numbers::pi / samples_;
    const Complex rest = one_minus_exp(-decay_, phase);
    const Complex a = 1.0 - rest;
    first[j] = through / rest;
    first_by_log[j] = (a * first[j] - samples_ * last_) / rest;
    second[j] = (samples_ - a * first[j]) / rest;
    second_by_log[j] = a * (second[j] - first[j] - first_by_log[j]) / rest;
  }
  const Complex sine(0.0, -0.5 * sine_weight_);
  const auto combined = [&](const Three& plain, const Three& weighted) {
    return (2.0 / (3.0 * samples_)) *
           (weighted[1] + 0.25 * (weighted[0] + weighted[2]) + sine * (plain[2] - plain[0]));
  };
  return {combined(first, second), combined(first_by_log, second_by_log)};
}

OscillatorDensity HannPeriodogram::at_bin(std::size_t bin) const {
  const double turn = 2.0 * std::numbers::pi * static_cast<double>(bin) / samples_;
  const Sums above = windowed_sums(rotation_ + turn);
  const Sums below = windowed_sums(rotation_ - turn);
  const Complex sum = above.sum + below.sum;
  const Complex by_log_z = above.by_log_z + below.by_log_z;
  const Complex weight(1.0, -ratio_);
  const Complex weight_by_quality(0.0, ratio_ * (1.0 + ratio_ * ratio_));
  const Complex z_by_frequency(-decay_, rotation_);
  const Complex z_by_quality(decay_, decay_ * ratio_);
  const double scale = 2.0 / sample_rate_hz_;
  return {scale * ((weight * sum).real() - 1.0), scale * (weight * by_log_z * z_by_frequency).real(),
          scale * (weight_by_quality * sum + weight * by_log_z * z_by_quality).real()};
}

}  // namespace combforce
