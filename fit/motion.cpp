#include "fit/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace combforce {
// J_k(theta), theta < 3 and k < order: Bessel's integral by the trapezoidal rule, which leaves out J_23 and
// higher, below 1e-17. (std::cyl_bessel_j calls lgamma, which writes a global: a race when fitters are made
// by several threads.)
static double bessel(std::size_t k, double theta) {
  constexpr std::size_t points = 32;
  double sum = 0.0;
  for (std::size_t j = 0; j < points; ++j) {
    const double phi = 2.0 * std::numbers::pi * static_cast<double>(j) / points;
    sum += std::cos(static_cast<double>(k) * phi - theta * std::sin(phi));
  }
  return sum / points;
}

// exp(i theta s) = J_0(theta) + 2 sum_k i^k J_k(theta) T_k(s) (Jacobi-Anger), cut after degree 9, in powers
// of s. T_k has the parity of k, so even powers are real and odd ones imaginary.
Motion::Polynomial expand_exponential(double theta) {
  Motion::Polynomial previous{}, current{}, sum{};
  previous[0] = 1.0;  // T_0
  current[1] = 1.0;   // T_1
  sum[0] = bessel(0, theta);
  for (std::size_t k = 1; k < Motion::order; ++k) {
    const double sign = k % 4 < 2 ? 1.0 : -1.0;  // i^k = sign * (1 or i)
    const double weight = 2.0 * sign * bessel(k, theta);
    for (std::size_t j = 0; j < Motion::order; ++j) sum[j] += weight * current[j];
    Motion::Polynomial next{};
    for (std::size_t j = 0; j < Motion::order; ++j)
      next[j] = (j > 0 ? 2.0 * current[j - 1] : 0.0) - previous[j];
    previous = current;
    current = next;
  }
  return sum;
}

Motion::Motion(std::span<const std::uint64_t> bins) : harmonics_(bins.begin(), bins.end()) {
  for (const std::uint64_t bin : bins) divisor_ = std::gcd(divisor_, bin);
  for (std::uint64_t& harmonic : harmonics_) harmonic /= divisor_;
  const std::size_t cells = std::max<std::size_t>(8, 4 * highest_harmonic());
  polynomials_.resize(cells);
  for (const std::uint64_t harmonic : harmonics_)
    expansion_.push_back(
        expand_exponential(std::numbers::pi * static_cast<double>(harmonic) / static_cast<double>(cells)));
  roots_.resize(2 * cells);
  for (std::size_t j = 0; j < roots_.size(); ++j)
    roots_[j] = std::polar(1.0, std::numbers::pi * static_cast<double>(j) / static_cast<double>(cells));
}

std::uint64_t Motion::highest_harmonic() const {
  return *std::ranges::max_element(harmonics_);
}

std::complex<double> Motion::centre_phase(std::size_t cell, std::size_t tone) const {
  return roots_[harmonics_[tone] * (2 * cell + 1) % roots_.size()];
}

std::complex<double> Motion::local_phase(std::size_t tone, double s) const {
  const Polynomial& e = expansion_[tone];
  double real = e[order - 2], imaginary = e[order - 1];
  for (std::size_t k = order - 2; k > 0; k -= 2) {
    real = real * s * s + e[k - 2];
    imaginary = imaginary * s * s + e[k - 1];
  }
  return {real, imaginary * s};
}

void Motion::set(std::span<const std::complex<double>> tones) {
  lowest_ = highest_ = 0.0;
  for (std::size_t cell = 0; cell < polynomials_.size(); ++cell) {
    Polynomial& c = polynomials_[cell];
    c.fill(0.0);
    for (std::size_t i = 0; i < harmonics_.size(); ++i) {
      const std::complex<double> phase = centre_phase(cell, i);
      const double real = tones[i].real() * phase.real() - tones[i].imag() * phase.imag();
      const double imaginary = tones[i].real() * phase.imag() + tones[i].imag() * phase.real();
      const Polynomial& e = expansion_[i];
      for (std::size_t k = 0; k < order; k += 2) {
        c[k] += e[k] * real;
        c[k + 1] -= e[k + 1] * imaginary;
      }
    }
    const double reach = spread(c);
    if (c[0] - reach >= lowest_ && c[0] + reach <= highest_) continue;
    for (const double s : {-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0}) {
      const double d = value_at(c, s);
      lowest_ = std::min(lowest_, d);
      highest_ = std::max(highest_, d);
    }
  }
}

void Motion::add_moments(std::size_t cell, std::span<const Moments> moments,
                         std::complex<double>* phasors) const {
  for (std::size_t i = 0; i < harmonics_.size(); ++i) {
    const Polynomial& e = expansion_[i];
    const std::complex<double> phase = cell_weight() * centre_phase(cell, i);
    for (std::size_t j = 0; j < moments.size(); ++j) {
      double real = 0.0, imaginary = 0.0;
      for (std::size_t k = 0; k < order; k += 2) {
        real += e[k] * moments[j][k];
        imaginary -= e[k + 1] * moments[j][k + 1];
      }
      phasors[j * harmonics_.size() + i] += std::complex<double>(
          real * phase.real() + imaginary * phase.imag(), imaginary * phase.real() - real * phase.imag());
    }
  }
}

}  // namespace combforce
