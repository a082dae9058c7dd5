#include "daemon/cli/calibrate_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "daemon/cli/line_output.hpp"

namespace combforce {
namespace {

constexpr std::array method_names{"equipartition, sensitivity given", "equipartition, stiffness given",
                                  "Sader's method"};
constexpr std::array scaling_names{"k_m/k_1 = (C_m/C_1)^4", "alpha_m/alpha_1 by the slope at the end"};

// "25.19 ± 0.14": the error with two digits.
std::string with_error(double value, double error) {
  if (!(error > 0.0) || !std::isfinite(error)) return fmt::format("{:.6g}", value);
  const int decimals = 1 - static_cast<int>(std::floor(std::log10(error)));
  if (decimals >= 0) return fmt::format("{:.{}f} ± {:.{}f}", value, decimals, error, decimals);
  return fmt::format("{:.0f} ± {:.0f}", value, error);
}

std::string scientific(double value, double relative_error) {
  return fmt::format("{:.4g} ± {:.1g}", value, value * relative_error);
}

std::string mode_text(const ThermalResult& result, const BandFit& one, std::size_t within, std::size_t mode) {
  const FittedMode& fitted = one.fit.modes[within];
  std::string text = fmt::format("mode {}\n", mode + 1);
  const auto row = [&](const char* name, const std::string& value) {
    text += fmt::format("  {:<17}{}\n", name, value);
  };
  row("frequency",
      with_error(fitted.frequency_hz, fitted.frequency_hz * one.fit.frequency_error(within)) + " Hz");
  row("quality factor",
      with_error(fitted.quality_factor, fitted.quality_factor * one.fit.quality_error(within)));
  row("thermal signal", scientific(fitted.variance_v2, one.fit.variance_error(within)) + " V²");
  if (!result.calibrated) return text;
  const Mode& calibrated = result.calibrated->modes[mode];
  const auto& errors = result.calibrated->uncertainty[mode].std_errors;
  row("stiffness", with_error(calibrated.stiffness_n_per_m, errors[2]) + " N/m");
  row("sensitivity", with_error(calibrated.sensitivity_nm_per_v, errors[3]) + " nm/V");
  return text;
}

std::string band_text(const BandFit& one) {
  const ThermalFit& fit = one.fit;
  std::string text = fmt::format(
      "fitted over {:.6g} to {:.6g} Hz, {} bins: {}, χ²/ν {:.3f} (ν {}), scatter that of {} averages\n",
      one.settings.band.low_hz, one.settings.band.high_hz, fit.bins, to_string(fit.status), fit.chi2_reduced,
      fit.chi2_degrees, with_error(fit.scatter.averages, fit.scatter.averages_std_error));
  text += fmt::format("  {:<17}{} V²/Hz\n", "floor",
                      fit.floor_determined ? scientific(fit.floor_v2_per_hz, fit.floor_error())
                                           : std::string("not determined"));
  if (one.band_spread)
    text += fmt::format("  {:<17}{:.2g} % in the thermal signal, over bands 2/3 and 4/3 as wide\n",
                        "band spread", 100.0 * *one.band_spread);
  return text;
}

Json fit_json(const BandFit& one) {
  const ThermalFit& fit = one.fit;
  Json modes = Json::array();
  for (std::size_t m = 0; m < fit.modes.size(); ++m)
    modes.push_back({{"frequency_hz", number9(fit.modes[m].frequency_hz)},
                     {"quality_factor", number9(fit.modes[m].quality_factor)},
                     {"variance_v2", number9(fit.modes[m].variance_v2)},
                     {"relative_errors",
                      {{"frequency_hz", number9(fit.frequency_error(m))},
                       {"quality_factor", number9(fit.quality_error(m))},
                       {"variance_v2", number9(fit.variance_error(m))}}}});
  return {{"band_hz", {one.settings.band.low_hz, one.settings.band.high_hz}},
          {"bins", fit.bins},
          {"status", to_string(fit.status)},
          {"chi2_reduced", number9(fit.chi2_reduced)},
          {"chi2_degrees", fit.chi2_degrees},
          {"averages_from_scatter", number9(fit.scatter.averages)},
          {"floor_v2_per_hz", number9(fit.floor_v2_per_hz)},
          {"floor_relative_error", number9(fit.floor_error())},
          {"band_spread", one.band_spread ? number9(*one.band_spread) : Json(nullptr)},
          {"modes", std::move(modes)}};
}

void check_fit(const BandFit& one, const ThermalSource& source, std::vector<std::string>& said) {
  const ThermalFit& fit = one.fit;
  const auto say = [&](const std::string& text) {
    said.push_back(
        fmt::format("{:.6g} to {:.6g} Hz: {}", one.settings.band.low_hz, one.settings.band.high_hz, text));
  };
  if (fit.status == ThermalStatus::misfit)
    say(fmt::format("the model does not describe the spectrum, χ²/ν {:.3g}: standard errors are too small",
                    fit.chi2_reduced));
  else if (fit.status != ThermalStatus::converged)
    say(fmt::format("the fit is {}", to_string(fit.status)));
  const SpectrumStatistics& statistics = source.spectrum.statistics;
  // A Gamma variable exceeds 1 + 30/n + 8/sqrt(n) once in 1e12 times.
  const double stands_out = 1.0 + 30.0 / statistics.averages + 8.0 / std::sqrt(statistics.averages);
  if (fit.greatest_ratio > stands_out)
    say(fmt::format("{:.6g} Hz stands out, {:.3g} times the model: a tone? --exclude takes it out",
                    fit.greatest_at_hz, fit.greatest_ratio));
  const double deviations = std::abs(std::log(fit.scatter.averages / statistics.averages)) *
                            fit.scatter.averages / fit.scatter.averages_std_error;
  constexpr double most_deviations = 6.0, least_change = 0.1;
  if (source.averages_known && deviations > most_deviations &&
      std::abs(fit.scatter.averages / statistics.averages - 1.0) > least_change)
    say(fmt::format("bins scatter as of {:.4g} averages, not {:.4g}: standard errors are off",
                    fit.scatter.averages, statistics.averages));
  // Of independent bins it scatters by 1/sqrt(bins).
  const double least_correlation = std::max(0.1, 4.0 / std::sqrt(static_cast<double>(fit.bins)));
  if (std::abs(fit.scatter.neighbour_correlation - statistics.correlation[0]) > least_correlation)
    say(
        fmt::format("neighbouring bins are correlated by {:.2f}, not {:.2f} as the window has it: standard "
                    "errors are off",
                    fit.scatter.neighbour_correlation, statistics.correlation[0]));
  for (const FittedMode& mode : fit.modes) {
    if (!source.spectrum.record) continue;
    const HannRecord& record = *source.spectrum.record;
    const double ring_downs = static_cast<double>(record.samples) / record.sample_rate_hz * std::numbers::pi *
                              mode.frequency_hz / mode.quality_factor;
    constexpr double least_ring_downs = 10.0;
    if (ring_downs < least_ring_downs)
      say(fmt::format(
          "segments are {:.2g} ring-downs long: the values stay unbiased, but standard errors are "
          "10 % too small at 8, 25 % at 4 and 50 % at 2; --segment {}",
          ring_downs, 4 * record.samples));
  }
}

// The fit whose floor is the detector's noise: that of the lowest mode which tells it to 30 %, since noise
// depends on frequency; if none does, the one that tells it best. Null when no floor is determined.
const BandFit* floor_of_detector(const ThermalResult& result) {
  constexpr double well_known = 0.3;
  const BandFit* best = nullptr;
  for (const BandFit& one : result.fits) {
    const double error = one.fit.floor_error();
    if (!one.fit.floor_determined || !std::isfinite(error)) continue;
    if (error <= well_known) return &one;
    if (best == nullptr || error < best->fit.floor_error()) best = &one;
  }
  return best;
}

void check_calibration(const ThermalResult& result, std::vector<std::string>& said) {
  if (floor_of_detector(result) == nullptr)
    said.emplace_back("no fit tells the floor: detector noise is 0 in the calibration");
  if (result.settings.known != KnownQuantity::sensitivity) return;  // stiffness is not by the factor
  const double factor = result.settings.correction_factor;
  const auto& vendor = result.source.vendor;
  if (vendor && vendor->correction_factor && std::abs(*vendor->correction_factor - factor) > 1e-6)
    said.push_back(
        fmt::format("the vendor's correction factor is {0:.6g}, not {1:.6g} as here: "
                    "--correction-factor {0:.6g} for what compares with the vendor's stiffness",
                    *vendor->correction_factor, factor));
  if (factor != 1.0)
    said.push_back(fmt::format(
        "with a correction factor of {:.6g} stiffness is not that of the mode, which fits of forces need",
        factor));
}

}  // namespace

std::string report_text(const ThermalResult& result) {
  const ThermalSource& source = result.source;
  std::string text =
      fmt::format("{}: bins of {:.6g} Hz, {:.5g} averages{}\n", source.name, source.spectrum.bin_hz,
                  source.spectrum.statistics.averages, source.averages_known ? "" : ", from the scatter");
  if (source.segments > 0)
    text += fmt::format("{} Hann segments of {} samples, 50 % overlap, {} gaps, {} clipped samples\n",
                        source.segments, source.spectrum.record->samples, source.gaps, source.clipped);
  std::size_t mode = 0;
  for (const BandFit& one : result.fits) {
    for (std::size_t m = 0; m < one.fit.modes.size(); ++m) text += mode_text(result, one, m, mode++);
    text += band_text(one);
  }
  if (result.calibrated)
    text += fmt::format("{}; correction factor {:.6g}, {:.6g} K{}\n",
                        method_names[static_cast<std::size_t>(result.settings.known)],
                        result.settings.correction_factor, result.settings.temperature_k,
                        mode > 1 && result.settings.values.size() < 2
                            ? fmt::format("; other modes: {}",
                                          scaling_names[static_cast<std::size_t>(result.settings.scaling)])
                            : "");
  if (const auto& vendor = source.vendor) {
    text += "the vendor's fit:";
    if (vendor->frequency_hz) text += fmt::format(" {:.6g} Hz", *vendor->frequency_hz);
    if (vendor->quality_factor) text += fmt::format(", Q {:.4g}", *vendor->quality_factor);
    if (vendor->stiffness_n_per_m) text += fmt::format(", {:.6g} N/m", *vendor->stiffness_n_per_m);
    if (result.vendor_stiffness_n_per_m)
      text += fmt::format("; by our formula {:.6g} N/m", *result.vendor_stiffness_n_per_m);
    if (vendor->correction_factor)
      text += fmt::format(" (correction factor {:.6g})", *vendor->correction_factor);
    text += "\n";
  }
  return text;
}

Json report_json(const ThermalResult& result) {
  const SpectrumStatistics& statistics = result.source.spectrum.statistics;
  Json fits = Json::array();
  for (const BandFit& one : result.fits) fits.push_back(fit_json(one));
  Json report{{"source", result.source.name},
              {"bin_hz", result.source.spectrum.bin_hz},
              {"averages", number9(statistics.averages)},
              {"averages_from_scatter", !result.source.averages_known},
              {"segments", result.source.segments},
              {"gaps", result.source.gaps},
              {"clipped", result.source.clipped},
              {"fits", std::move(fits)}};
  if (!result.calibrated) return report;
  report["method"] = method_names[static_cast<std::size_t>(result.settings.known)];
  report["correction_factor"] = result.settings.correction_factor;
  if (result.calibrated->modes.size() > 1 && result.settings.values.size() < 2)
    report["scaling"] = scaling_names[static_cast<std::size_t>(result.settings.scaling)];
  if (result.vendor_stiffness_n_per_m)
    report["vendor"] = {{"stiffness_n_per_m", *result.source.vendor->stiffness_n_per_m},
                        {"by_our_formula_n_per_m", number9(*result.vendor_stiffness_n_per_m)}};
  return report;
}

std::vector<std::string> warnings(const ThermalResult& result) {
  std::vector<std::string> said = result.source.warnings;
  for (const BandFit& one : result.fits) check_fit(one, result.source, said);
  if (result.calibrated) check_calibration(result, said);
  return said;
}

Calibration calibration_of(const ThermalResult& result) {
  const Cantilever& calibrated = result.calibrated.value();
  const BandFit* known = floor_of_detector(result);
  const double detector = known != nullptr ? std::sqrt(known->fit.floor_v2_per_hz) : 0.0;
  return {calibrated,
          {result.settings.temperature_k, {detector * calibrated.modes[0].sensitivity_nm_per_v}},
          report_json(result)};
}

void write_table(const ThermalResult& result, const std::string& path) {
  LineOutput out(path);
  out.write("# frequency_hz density_v2_per_hz model_v2_per_hz residual scatter\n");
  const AveragedSpectrum& spectrum = result.source.spectrum;
  for (const BandFit& one : result.fits) {
    if (&one != &result.fits.front()) out.write("\n\n");
    const auto bins = bins_of(spectrum, one.settings);
    const auto model = model_density(spectrum, one.fit, bins);
    constexpr double wanted = 0.05;
    const auto together =
        static_cast<std::size_t>(std::ceil(1.0 / (wanted * wanted * spectrum.statistics.averages)));
    const std::size_t block =
        std::clamp<std::size_t>(together, 1, std::max<std::size_t>(bins.size() / 50, 1));
    for (std::size_t first = 0; first + block <= bins.size(); first += block) {
      double hz = 0.0, density = 0.0, expected = 0.0, ratio = 0.0;
      for (std::size_t i = first; i < first + block; ++i) {
        const auto share = 1.0 / static_cast<double>(block);
        hz += share * spectrum.frequency_hz(bins[i]);
        density += share * spectrum.density[bins[i]];
        expected += share * model[i];
        ratio += share * spectrum.density[bins[i]] / model[i];
      }
      const double scatter = 1.0 / std::sqrt(static_cast<double>(block) * spectrum.statistics.averages);
      out.write(
          fmt::format("{:.9g} {:.6g} {:.6g} {:.6g} {:.6g}\n", hz, density, expected, ratio - 1.0, scatter));
    }
  }
  out.close();
}

}  // namespace combforce
