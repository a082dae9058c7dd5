// Whole spectra of real signals, double precision, as peak phasors: x_n = Re sum_k X_k exp(2 pi i k n / N).
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "dsp/fftw.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates; it takes FFTW's planner lock (dsp/fftw.hpp).
class FourierTransform {
 public:
  // N: even, 2 <= N < 2^31; else std::invalid_argument.
  explicit FourierTransform(std::size_t samples);

  // The N samples, of either transform. Kept by to_phasors().
  std::span<double> signal() { return {signal_.get(), samples_}; }

  // Fills signal() from bins 0 … phasors.size() - 1, at most N/2; bins beyond are 0.
  void to_signal(std::span<const std::complex<double>> phasors);

  // Bins 0 … phasors.size() - 1, at most N/2, of signal().
  void to_phasors(std::span<std::complex<double>> phasors);

 private:
  std::span<std::complex<double>> bins() {
    return {reinterpret_cast<std::complex<double>*>(bins_.get()), samples_ / 2 + 1};
  }

  std::size_t samples_;
  FftwReals signal_;
  FftwComplexes bins_;
  FftwPlan to_signal_, to_bins_;
};

// All N/2 + 1 phasors of N samples, N as above. Reentrant.
std::vector<std::complex<double>> spectrum_of(std::span<const double> signal);

// The N samples that have these N/2 + 1 phasors. Reentrant.
std::vector<double> signal_of(std::span<const std::complex<double>> spectrum);

}  // namespace combforce
