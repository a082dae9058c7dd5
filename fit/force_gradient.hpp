// What small changes of a periodic motion do to the force along it, harmonic by harmonic.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdlib>
#include <span>

namespace combforce {

// The spectra of the force's derivatives along a motion. Spans must outlive it.
struct ForceGradient {
  using Complex = std::complex<double>;

  std::span<const Complex> by_surface;   // phasors of dF/dp0 = -dF/dd, harmonics 0 …; 0 beyond
  std::span<const Complex> by_velocity;  // the same of dF/d(velocity); empty: F does not depend on it
  double spacing;                        // of the harmonics, rad/s

  // Coefficient of exp(i m W t), W the spacing, in what a motion of velocity `turn` times itself does to the
  // force.
  Complex coefficient(std::ptrdiff_t m, Complex turn) const {
    return by_velocity.empty() ? stiffness(m) : stiffness(m) + turn * damping(m);
  }

  // What a change (x + iy) of the motion at harmonic m, of velocity i w_m (x + iy), does to the force at n:
  // re x + im y.
  struct Coupling {
    Complex re, im;
  };
  Coupling coupling(std::size_t n, std::size_t m) const {
    const auto j = static_cast<std::ptrdiff_t>(n), k = static_cast<std::ptrdiff_t>(m);
    const Complex turn(0.0, spacing * static_cast<double>(m));
    if (m == 0) return {(n == 0 ? 1.0 : 2.0) * stiffness(j), 0.0};
    if (n == 0) {
      const Complex both = coefficient(k, -turn);
      return {both.real(), both.imag()};
    }
    return coupled(j - k, j + k, turn);
  }

 private:
  // Of a motion with velocity `turn` times itself, `difference` and `sum` of the harmonics apart.
  Coupling coupled(std::ptrdiff_t difference, std::ptrdiff_t sum, Complex turn) const {
    const Complex direct = coefficient(difference, turn), mirrored = coefficient(sum, -turn);
    return {direct + mirrored, Complex(0.0, 1.0) * (direct - mirrored)};
  }

  // Coefficient m of exp(i w_m t) in dF/dd, and in dF/d(velocity).
  Complex stiffness(std::ptrdiff_t m) const { return -of_phasors(by_surface, m); }
  Complex damping(std::ptrdiff_t m) const { return of_phasors(by_velocity, m); }
  static Complex of_phasors(std::span<const Complex> phasors, std::ptrdiff_t m) {
    const auto size = static_cast<std::ptrdiff_t>(phasors.size());
    if (m >= size || -m >= size) return 0.0;
    if (m == 0) return phasors[0];
    const Complex half = 0.5 * phasors[static_cast<std::size_t>(std::abs(m))];
    return m > 0 ? half : std::conj(half);
  }
};

}  // namespace combforce
