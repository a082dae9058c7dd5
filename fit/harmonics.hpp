// The harmonics of a pixel's motion, on the comb and off it, and how the tip answers there.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "dsp/comb.hpp"
#include "fit/cantilever.hpp"

namespace combforce {

// The motion repeats after T/g, g the greatest common divisor of the comb's bins; harmonic n of it lies at n
// g Delta f. Immutable: may be shared by threads.
class Harmonics {
 public:
  // Of the band in fastest tones. Beyond it forces move the tip too little to matter: parameters to 5e-5 for
  // the paper's cases. Fast motion matters more where the force sees the tip's velocity: with a retardation
  // time of 0.3 us a band of 3 leaves 1.5 % of the contact strength, one of 12 less than 1e-4.
  static constexpr double band_of_elastic_forces = 3.0, band_of_viscous_forces = 9.0;

  // comb, cantilever: valid.
  Harmonics(const Comb& comb, const Cantilever& cantilever, double delta_f_hz,
            double band_of_tones = band_of_elastic_forces);

  // The band: up to so many times the fastest tone, and to where the tip's compliance has fallen to a
  // thousandth of the static one.
  std::size_t band() const { return response_.size() - 1; }
  std::span<const std::size_t> tones() const { return tones_; }  // of the comb, in its order
  std::size_t highest_tone() const { return highest_tone_; }
  std::uint64_t periods() const { return periods_; }      // in a window of the comb: g
  double spacing_hz() const { return spacing_hz_; }       // of the harmonics: g Delta f
  double angular_frequency(std::size_t harmonic) const {  // rad/s
    return 2.0 * std::numbers::pi * spacing_hz_ * static_cast<double>(harmonic);
  }
  bool is_tone(std::size_t harmonic) const { return is_tone_[harmonic]; }

  // chi, nm/nN, of harmonics 0 … band.
  const std::vector<std::complex<double>>& response() const { return response_; }

  // Off the comb, those with the greatest |chi|, greatest first: they couple most strongly.
  std::span<const std::size_t> strong() const { return strong_; }

 private:
  std::vector<std::size_t> tones_;
  std::size_t highest_tone_ = 0;
  std::uint64_t periods_ = 1;
  double spacing_hz_ = 0.0;
  std::vector<bool> is_tone_;
  std::vector<std::complex<double>> response_;
  std::vector<std::size_t> strong_;
};

}  // namespace combforce
