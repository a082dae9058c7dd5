// Thermal motion of an oscillator at the samples, exactly: the recursion x' = F x + w of (q, q') with F the
// matrix exponential of one sample and cov w = S - F S F', S the equilibrium covariance. Shares nothing with
// the simulator or with the closed forms of fit/.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

namespace combforce::test {

class ThermalStream {
 public:
  ThermalStream(double sample_rate_hz, double frequency_hz, double quality_factor, double variance)
      : deviation_(std::sqrt(variance)) {
    const double w0 = 2.0 * std::numbers::pi * frequency_hz;
    const double g = 0.5 * w0 / quality_factor;
    const double wd = std::sqrt(w0 * w0 - g * g);
    const double h = 1.0 / sample_rate_hz;
    const double decay = std::exp(-g * h), c = std::cos(wd * h), s = std::sin(wd * h);
    // The velocity in units of w0 q.
    f_[0][0] = decay * (c + g / wd * s);
    f_[0][1] = decay * (w0 / wd * s);
    f_[1][0] = -decay * (w0 / wd * s);
    f_[1][1] = decay * (c - g / wd * s);
    const double c00 = variance * (1.0 - f_[0][0] * f_[0][0] - f_[0][1] * f_[0][1]);
    const double c01 = variance * -(f_[0][0] * f_[1][0] + f_[0][1] * f_[1][1]);
    const double c11 = variance * (1.0 - f_[1][0] * f_[1][0] - f_[1][1] * f_[1][1]);
    // Lower triangle with the velocity first: its variance is the larger.
    l11_ = std::sqrt(c11);
    l01_ = c01 / l11_;
    l00_ = std::sqrt(std::max(c00 - l01_ * l01_, 0.0));
  }

  // Adds the motion to `samples`, from equilibrium on.
  void add(std::vector<double>& samples, std::mt19937_64& random) const {
    std::normal_distribution<double> normal;
    double q = deviation_ * normal(random), v = deviation_ * normal(random);
    for (double& sample : samples) {
      sample += q;
      const double a = normal(random), b = normal(random);
      const double next = f_[0][0] * q + f_[0][1] * v + l01_ * a + l00_ * b;
      v = f_[1][0] * q + f_[1][1] * v + l11_ * a;
      q = next;
    }
  }

 private:
  double f_[2][2];
  double l00_, l01_, l11_, deviation_;
};

// White noise of a one-sided density.
inline void add_white(std::vector<double>& samples, double density, double sample_rate_hz,
                      std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, std::sqrt(0.5 * density * sample_rate_hz));
  for (double& sample : samples) sample += normal(random);
}

}  // namespace combforce::test
