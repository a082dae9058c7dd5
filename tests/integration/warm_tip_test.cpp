// Soft levers in liquid, whose tips heat carries about by as much as the surface is dented: what the fit
// finds must be the surface, not the surface as that motion smears it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include "drivers/simulated/steady_state.hpp"
#include "fit/drive.hpp"
#include "fit/pixel_fitter.hpp"

namespace combforce::test {
namespace {

constexpr double temperature_k = 300.0, sample_rate_hz = 1e6;
constexpr std::uint64_t window_samples = 1000;

struct Lever {
  const char* name;
  Cantilever cantilever;
  std::vector<std::uint64_t> drive_bins, bins;
  std::vector<double> amplitudes_nm;  // free, one a driven bin
  std::string model;
  std::vector<double> truth;
  std::uint32_t windows;  // averaged in a pixel
  std::size_t pixels;
  double off_without_heat;  // in standard errors, of the surface's position, as once measured

  friend std::ostream& operator<<(std::ostream& out, const Lever& lever) { return out << lever.name; }
};

std::vector<double> frequencies_hz(const std::vector<std::uint64_t>& bins) {
  std::vector<double> frequencies;
  for (const std::uint64_t bin : bins)
    frequencies.push_back(sample_rate_hz / static_cast<double>(window_samples) * static_cast<double>(bin));
  return frequencies;
}

FitConditions conditions_of(const Lever& lever, const std::vector<std::complex<double>>& drive) {
  FitConditions conditions;
  conditions.sample_rate_hz = sample_rate_hz;
  conditions.comb.window_samples = window_samples;
  conditions.windows = lever.windows;
  conditions.cantilever = lever.cantilever;
  conditions.noise = Noise{temperature_k, {0.0}};
  conditions.settings.model = lever.model;
  conditions.settings.refine = 30;
  FreeResponse free;
  for (const double frequency : frequencies_hz(lever.bins)) {
    const auto bin = lever.bins[free.mean_nm.size()];
    const auto driven = std::ranges::find(lever.drive_bins, bin);
    conditions.comb.tones.push_back({bin, driven != lever.drive_bins.end()});
    free.mean_nm.push_back(driven == lever.drive_bins.end()
                               ? 0.0
                               : tip_response(lever.cantilever, frequency) *
                                     drive[static_cast<std::size_t>(driven - lever.drive_bins.begin())]);
  }
  conditions.free_response = free;
  return conditions;
}

class WarmTip : public testing::TestWithParam<Lever> {};

// The mean of n pixels scatters by their standard error over sqrt(n): four times that is allowed.
TEST_P(WarmTip, FindsTheSurfaceAndNotItsSmearedImage) {
  const Lever& lever = GetParam();
  SteadyStateSettings settings;
  settings.oscillator.sample_rate_hz = sample_rate_hz;
  settings.oscillator.window_samples = window_samples;
  settings.oscillator.cantilever = lever.cantilever;
  settings.oscillator.drive_bins = lever.drive_bins;
  settings.oscillator.drive_forces_nn = drive_forces({DriveScheme::amplitudes, 0.0, lever.amplitudes_nm, {}},
                                                     lever.cantilever, frequencies_hz(lever.drive_bins));
  settings.oscillator.temperature_k = temperature_k;
  settings.oscillator.accuracy = IntegratorAccuracy::accurate;
  settings.model = lever.model;
  settings.parameters = lever.truth;
  settings.bins = lever.bins;
  settings.windows = lever.windows;
  PixelFitter fitter(conditions_of(lever, settings.oscillator.drive_forces_nn));
  std::vector<double> off(lever.truth.size()), squares = off;
  for (std::size_t pixel = 0; pixel < lever.pixels; ++pixel) {
    settings.oscillator.seed = pixel + 1;
    FitResult result;
    fitter.fit(simulate_steady_state(settings).tip_nm, result);
    ASSERT_EQ(result.status, FitStatus::converged) << pixel;
    for (std::size_t k = 0; k < off.size(); ++k) {
      const double deviate = (result.parameters[k] - lever.truth[k]) / result.std_errors[k];
      off[k] += deviate / static_cast<double>(lever.pixels);
      squares[k] += deviate * deviate / static_cast<double>(lever.pixels);
    }
  }
  const double allowed = 4.0 / std::sqrt(static_cast<double>(lever.pixels));
  ASSERT_LT(allowed, 0.6 * lever.off_without_heat);
  for (std::size_t k = 0; k < off.size(); ++k) {
    EXPECT_LT(std::abs(off[k]), allowed) << "parameter " << k;
    EXPECT_NEAR(std::sqrt(squares[k]), 1.0, 0.75 * allowed) << "parameter " << k;  // scatters by 1/sqrt(2n)
  }
}

const Lever softest{
    "soft", {{{20e3, 2.0, 0.05, 1.0}}}, {20}, {20, 40, 60, 80}, {15.0}, "hertz", {-10.0, 0.05}, 64, 60, 1.02};
const Lever two_modes{"two modes",  {{{20e3, 2.0, 0.05, 1.0}, {130e3, 5.0, 1.9, 1.0}}},
                      {20, 130},    {20, 40, 60, 90, 110, 130, 150},
                      {15.0, 2.0},  "cone",
                      {-12.0, 0.1}, 64,
                      25,           2.29};

INSTANTIATE_TEST_SUITE_P(InLiquid, WarmTip, testing::Values(softest, two_modes));

}  // namespace
}  // namespace combforce::test
