// Thermal spectra: oscillators and a white floor, fitted to an averaged periodogram by maximum likelihood.
//
// The model of a bin is M = sum_m P_m D_m + W: D_m the density of an oscillator per unit variance
// (thermal_oscillator.hpp; as the Hann window smears it when the record is known), P_m the variance of the
// signal that mode m makes, V^2, W the white floor, V^2/Hz. A bin S scatters by a Gamma distribution about M
// with a width proportional to M, so plain least squares is biased, by -1/averages for weights 1/S^2. The
// likelihood is that of the Gamma distribution,
//     maximise -n sum (S/M + ln M) = minimise sum r^2/2,  r = sign(S - M) sqrt(2 n (S/M - 1 - ln(S/M))),
// which neither needs n nor is biased by it; Ceres minimises over ln f0, ln Q, ln P and ln W.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "fit/thermal_spectrum.hpp"

namespace combforce {

// Frequencies that count, both ends included.
struct FrequencyBand {
  double low_hz = 0.0, high_hz = 0.0;
  bool operator==(const FrequencyBand&) const = default;
};

struct OscillatorStart {
  double frequency_hz = 0.0;
  double quality_factor = 0.0;
};

// One fit: the modes that lie in the band share a floor.
struct ThermalFitSettings {
  FrequencyBand band;
  std::vector<FrequencyBand> excluded;  // tones, hum: left out
  std::vector<OscillatorStart> modes;   // at least one, each within the band
};

struct FittedMode {
  double frequency_hz = 0.0, quality_factor = 0.0;
  double variance_v2 = 0.0;  // P
};

enum class ThermalStatus : std::uint8_t {
  converged,
  not_converged,
  at_bound,     // f0 at an end of the band, or Q at one of its bounds
  misfit,       // converged, but the model does not describe the spectrum: see chi2_reduced
  undetermined  // the Fisher information is singular: no standard errors
};
std::string_view to_string(ThermalStatus status);

inline constexpr double least_quality_factor = 0.51;  // an oscillator that swings: above 1/2
inline constexpr double most_quality_factor = 1e7;

struct ThermalFit {
  ThermalStatus status = ThermalStatus::not_converged;
  std::vector<FittedMode> modes;  // in the order of the settings
  double floor_v2_per_hz = 0.0;
  bool floor_determined = true;  // false: the floor went to 0 (1e-9 of the mean density) and is held there
  // Of (ln f0, ln Q, ln P of mode 0, of mode 1, …, ln W): G^-1 (G + sum_l c_l (L_l + L_l')) G^-1 with the
  // Fisher information G = n sum_k g_k g_k', g_k = d ln M_k/dp, L_l = n sum_k g_k g_{k+l}', n the averages
  // and c_l the correlation of bins. Statistical alone. For segments of fewer than 10 ring-downs too small,
  // as the motion itself then correlates bins and segments: 10 % at 8, 25 % at 4, 50 % at 2 (measured, 200
  // draws). NaN: not determined.
  Eigen::MatrixXd covariance;
  std::size_t bins = 0;
  // Means of S/M over blocks of bins with relative width ~1/7 against 1: 1 +- sqrt(2/degrees) for a model
  // that fits. `misfit` from 4 standard deviations on.
  double chi2_reduced = 0.0;
  std::size_t chi2_degrees = 0;
  MeasuredScatter scatter;                            // of S/M
  double greatest_ratio = 0.0, greatest_at_hz = 0.0;  // of S/M: a tone, when it is far out

  // Standard errors, relative. mode < modes.size().
  double frequency_error(std::size_t mode) const { return relative_error(3 * mode); }
  double quality_error(std::size_t mode) const { return relative_error(3 * mode + 1); }
  double variance_error(std::size_t mode) const { return relative_error(3 * mode + 2); }
  double floor_error() const { return relative_error(3 * modes.size()); }

 private:
  double relative_error(std::size_t parameter) const;
};

// Throws std::invalid_argument naming field, value and bound: band outside the spectrum or of fewer than
// 8 bins a parameter, a start outside the band, a density in it that is not positive and finite.
ThermalFit fit_thermal(const AveragedSpectrum& spectrum, const ThermalFitSettings& settings);

// The fitted density at bins of the spectrum.
std::vector<double> model_density(const AveragedSpectrum& spectrum, const ThermalFit& fit,
                                  const std::vector<std::size_t>& bins);
// The bins of the settings' band but for those excluded, without the two next to f = 0.
std::vector<std::size_t> bins_of(const AveragedSpectrum& spectrum, const ThermalFitSettings& settings);

// Where to start when frequency is known to -20 … +25 % and Q not at all: the peak, of width f0/Q for Q over
// 1 … 20000, that makes the spectrum in `within` most likely. Throws std::invalid_argument when no bin is
// there.
OscillatorStart find_start(const AveragedSpectrum& spectrum, double about_hz, const FrequencyBand& within);

}  // namespace combforce
