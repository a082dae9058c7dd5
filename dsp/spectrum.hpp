// Welch power spectral density: one-sided, units^2/Hz.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace combforce {

// Averages modified periodograms of Hann-windowed segments with 50 % overlap (Welch 1967): bin k at
// k * sample_rate / segment_samples, k = 0 … segment/2. The integral over frequency is the variance: bins but
// DC and Nyquist carry both signs of frequency. The mean of each segment is removed when asked.
// Thread-bound; push() does not allocate. Construction and destruction take FFTW's planner lock
// (fftw.hpp).
class WelchSpectrum {
 public:
  // segment_samples even, 4 <= segment_samples < 2^31; sample_rate_hz > 0, finite; else
  // std::invalid_argument.
  WelchSpectrum(std::size_t segment_samples, double sample_rate_hz, bool remove_mean = true);
  ~WelchSpectrum();
  WelchSpectrum(WelchSpectrum&&) noexcept;
  WelchSpectrum& operator=(WelchSpectrum&&) noexcept;

  void push(std::span<const double> samples);
  void break_off();  // forgets the pending samples, as at a gap: what is pushed next does not continue them
  void reset();      // forgets the segments too

  std::uint64_t segments() const;  // averaged so far
  double bin_hz() const;
  std::vector<double> density() const;  // segment/2 + 1 values; all 0 before the first segment

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace combforce
