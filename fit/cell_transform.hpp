// Between the spectrum of a periodic function and its cells of time, for every harmonic of a band at once.
//
// The period is cut into cells; s in [-1, 1] runs across a cell, theta_n = pi n/cells is the phase of
// harmonic n over half a cell, and exp(i theta s) = sum_k e_k(theta) s^k (motion.hpp). Hence a motion's
// polynomials are inverse Fourier transforms over the cells of e_k D_n, and phasors of a force are sums over
// k of the transforms of its moments over cells: one real FFT an order, instead of a sum over cells for every
// harmonic. What happens inside a cell, a contact of nanoseconds, is kept.
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "dsp/fftw.hpp"
#include "fit/motion.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates; it takes FFTW's planner lock (dsp/fftw.hpp).
class CellTransform {
 public:
  static constexpr std::size_t order = Motion::order;  // of the motion, and of moments as exact as it
  // Moments enough for derivatives: at theta <= pi/2, the highest tone of a comb, to 2 %.
  static constexpr std::size_t low_order = 6;

  // Harmonics 0 … band of the period; cells no longer than half the period of `highest_tone`, and than one
  // and a half of that of the band's end: exact to 5e-8 and 3e-3 of what moves there. 0 < highest_tone <=
  // band.
  CellTransform(std::size_t highest_tone, std::size_t band);

  std::size_t band() const { return band_; }
  std::size_t cells() const { return cells_; }

  // `spectrum`: peak phasors of harmonics 0 … band; the first is the mean (its imaginary part is not used).
  void to_polynomials(std::span<const std::complex<double>> spectrum,
                      std::span<Motion::Polynomial> polynomials);

  // Phasors (2/T) integral F exp(-i w_n t) dt, n = 0 … band, and the mean at n = 0, of a function whose
  // moments, integral over s of F s^k, k = 0 … orders - 1 stand in `moments`, a row a cell; `orders` is order
  // or low_order.
  void to_phasors(std::span<const double> moments, std::size_t orders,
                  std::span<std::complex<double>> phasors);

 private:
  FftwPlan forward_plan(std::size_t orders);

  std::size_t band_, cells_;
  std::vector<Motion::Polynomial> expansion_;    // a harmonic: even k the real part, odd k the imaginary
  std::vector<std::complex<double>> half_step_;  // exp(i theta_n)
  FftwReals in_time_;                            // cells x order
  FftwComplexes in_frequency_;                   // (cells/2 + 1) x order
  FftwPlan inverse_, forward_, forward_low_;
};

}  // namespace combforce
