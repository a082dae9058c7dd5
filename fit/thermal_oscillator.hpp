// The spectrum of one thermally driven mode, per unit variance of its motion, and what a Hann-windowed
// periodogram of a finite record of it gives on average.
//
// All densities are one-sided, 1/Hz. Reentrant.
#pragma once

#include <complex>
#include <cstddef>

namespace combforce {

// A density with its derivatives by the logarithms of frequency and quality factor.
struct OscillatorDensity {
  double value = 0.0;
  double by_log_frequency = 0.0;
  double by_log_quality = 0.0;
};

// 2/(pi f0 Q) f0^4/((f0^2 - f^2)^2 + (f f0/Q)^2): its integral over all f >= 0 is 1. f0, Q > 0; f >= 0.
OscillatorDensity oscillator_density(double frequency_hz, double quality_factor, double at_hz);

// The expectation of |sum_n w_n x_n exp(-2 pi i k n/N)|^2 2/(fs sum w^2) where x is the motion sampled at fs
// and w the periodic Hann window of N samples (WelchSpectrum's). It is the transform of the motion's
// autocovariance times that of the window, summed in closed form:
//
//     R(m) = Re c z^m,  z = exp((-g + i w_d)/fs),  g = pi f0/Q,  w_d^2 = (2 pi f0)^2 - g^2,  c = 1 - i g/w_d
//     w*w(m)/w*w(0) = [(N - m)(1 + cos(a m)/2) + (3/4 cot(a/2) + 1/4 tan(a/2)) sin(a m)]/(3N/2), a = 2 pi/N
//
// so leakage, the width of bins and aliasing are in it exactly, for any ratio of N/fs and ring-down time.
class HannPeriodogram {
 public:
  // samples >= 4; sample_rate_hz > 0; 0 < frequency_hz < sample_rate/2; quality_factor > 1/2. Not checked.
  HannPeriodogram(std::size_t samples, double sample_rate_hz, double frequency_hz, double quality_factor);

  // At k fs/N. The mean of the record, when removed from it, changes k = 0 and 1 alone.
  OscillatorDensity at_bin(std::size_t bin) const;

 private:
  struct Sums {
    std::complex<double> sum, by_log_z;  // and its derivative by log z
  };
  Sums windowed_sums(double turn) const;

  double samples_, sample_rate_hz_;
  double decay_, rotation_;    // g/fs, w_d/fs
  double ratio_;               // g/w_d
  std::complex<double> last_;  // z^N
  double sine_weight_;
};

}  // namespace combforce
