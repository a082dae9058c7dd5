// An averaged periodogram with what is known of its scatter.
//
// A periodogram bin of Gaussian noise is the expected density times a Gamma variable of mean 1 and variance
// 1/averages, averages = 1 for one periodogram (an exponential variable); real when windows overlap.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace combforce {

// Neighbouring bins of a windowed spectrum are not independent: correlation of a bin with those 1, 2 and 3
// bins away.
using BinCorrelation = std::array<double, 3>;

struct SpectrumStatistics {
  double averages = 1.0;  // > 0
  BinCorrelation correlation{};
};

// Of `segments` periodic-Hann periodograms averaged with 50 % overlap within `runs` stretches without a gap,
// far from DC and Nyquist, where the spectrum is smooth over a few bins (segments long against the
// ring-down). With s = (segments - runs)/segments: averages = segments/(1 + 2s/36), and the correlation at l
// bins is
//     [h_l + 2s c_l]/(1 + 2s/36),   h = 4/9, 1/36, 0,   c_l = 16/(9 pi^2 l^2 (l^2 - 4)^2) (odd l), c_2 =
//     1/144,
// the squared transforms of w_n^2 and w_n w_{n+N/2} (Welch 1967 for the first).
SpectrumStatistics hann_statistics(std::uint64_t segments, std::uint64_t runs = 1);

// One periodogram through a Hann window has h_l, and without window none.
inline constexpr BinCorrelation hann_correlation{4.0 / 9.0, 1.0 / 36.0, 0.0};

// The record behind each periodogram, when its window was periodic Hann.
struct HannRecord {
  std::size_t samples = 0;
  double sample_rate_hz = 0.0;
};

struct AveragedSpectrum {
  double first_hz = 0.0;        // of density[0]; a multiple of bin_hz when there is a record
  double bin_hz = 0.0;          // > 0
  std::vector<double> density;  // one-sided, V^2/Hz
  SpectrumStatistics statistics;
  std::optional<HannRecord> record;  // absent: the density is taken as not smeared by a window

  double frequency_hz(std::size_t bin) const { return first_hz + bin_hz * static_cast<double>(bin); }
};

// The shape of the Gamma distribution that `ratios`, measured over expected density, follow: the maximum
// likelihood estimate of `averages` from the scatter alone, with its standard error for independent bins; and
// the correlation of neighbouring ratios. At least 8 ratios, all > 0.
struct MeasuredScatter {
  double averages = 0.0, averages_std_error = 0.0;
  double neighbour_correlation = 0.0;
};
MeasuredScatter measure_scatter(const std::vector<double>& ratios);

}  // namespace combforce
