// The partial motion over one period, as a polynomial in every one of many short cells of time.
//
// d(t) = Re sum_i D_i exp(i w_i t) repeats after T/g, g the greatest common divisor of the bins; that period
// is cut into cells no longer than a quarter of the fastest tone's period. In a cell, with s in [-1, 1]
// across it,
//     d(s) = sum_k c_k s^k,  k = 0 … 9,
// from the Chebyshev expansion of exp(i theta s), theta <= pi/4: exact to 5e-11 of the amplitudes. The same
// expansion turns moments of a force over cells into its phasors, so what happens inside a cell costs nothing
// a tone.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace combforce {

// Thread-bound. Only the constructor allocates.
class Motion {
 public:
  static constexpr std::size_t order = 10;  // coefficients of a cell's polynomial
  using Polynomial = std::array<double, order>;
  using Moments = std::array<double, order>;  // integral over s of F(s) s^k

  // `bins`: of the comb, each > 0.
  explicit Motion(std::span<const std::uint64_t> bins);

  // The motion of these peak phasors, nm, one a bin.
  void set(std::span<const std::complex<double>> tones);

  std::size_t tones() const { return harmonics_.size(); }
  std::size_t cells() const { return polynomials_.size(); }
  std::uint64_t highest_harmonic() const;  // of the period: a bound on its turning points is twice this
  // nm/s per unit of dd/ds in a cell; `spacing_hz`: of the bins.
  double velocity_per_slope(double spacing_hz) const {
    return 2.0 * static_cast<double>(cells() * divisor_) * spacing_hz;
  }

  const Polynomial& polynomial(std::size_t cell) const { return polynomials_[cell]; }
  double lowest_nm() const { return lowest_; }  // sampled: true to a fraction of a percent of the amplitudes
  double highest_nm() const { return highest_; }

  // exp(i w t) of a tone at the centre of a cell, and at s from the centre: table of exp(i theta s) for given
  // s.
  std::complex<double> centre_phase(std::size_t cell, std::size_t tone) const;
  std::complex<double> local_phase(std::size_t tone, double s) const;

  // Adds the share of one cell to the phasors (2/T) integral F(t) exp(-i w t) dt of several functions F:
  // column j of `phasors` (one row a tone) is of moments[j].
  void add_moments(std::size_t cell, std::span<const Moments> moments, std::complex<double>* phasors) const;
  // What an integrand's weight ds in a cell contributes per unit to those phasors, but for the phase.
  double cell_weight() const { return 1.0 / static_cast<double>(polynomials_.size()); }

 private:
  std::uint64_t divisor_ = 0;             // g
  std::vector<std::uint64_t> harmonics_;  // of the period: bins / g
  std::vector<Polynomial> expansion_;  // a tone: even k the real part of exp(i theta s), odd k the imaginary
  std::vector<std::complex<double>> roots_;  // exp(i pi j / cells), j = 0 … 2 cells - 1
  std::vector<Polynomial> polynomials_;
  double lowest_ = 0.0, highest_ = 0.0;
};

// Coefficients of exp(i theta s) in powers of s, |s| <= 1: even k the real part, odd k the imaginary; exact
// to 2 J_10(theta): 5e-11 at pi/4, 1e-6 at 3 pi/4.
Motion::Polynomial expand_exponential(double theta);

// Value of a polynomial, and value with derivative.
inline double value_at(const Motion::Polynomial& c, double s) {
  double value = c[Motion::order - 1];
  for (std::size_t k = Motion::order - 1; k-- > 0;) value = value * s + c[k];
  return value;
}

inline std::pair<double, double> value_and_slope_at(const Motion::Polynomial& c, double s) {
  double value = c[Motion::order - 1], slope = 0.0;
  for (std::size_t k = Motion::order - 1; k-- > 0;) {
    slope = slope * s + value;
    value = value * s + c[k];
  }
  return {value, slope};
}

// Bounds of d over a cell, not tight: c_0 -+ spread.
inline double spread(const Motion::Polynomial& c) {
  double sum = 0.0;
  for (std::size_t k = 1; k < Motion::order; ++k) sum += c[k] < 0.0 ? -c[k] : c[k];
  return sum;
}

}  // namespace combforce
