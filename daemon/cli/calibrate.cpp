// combforce calibrate thermal: stiffness and sensitivity from thermal motion.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/cli/calibrate_report.hpp"
#include "daemon/cli/calibrate_source.hpp"
#include "daemon/cli/client.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/line_output.hpp"
#include "daemon/cli/number_checks.hpp"
#include "proto/sigmf.hpp"

namespace combforce {
namespace {

struct ThermalCommand {
  std::string source, config, connect, output, table;
  double seconds = 0.0;
  std::vector<std::string> modes, bands, excluded;
  double reach = 3.0;
  bool joint = false;
  SpectrumFileOptions file;
  std::string window = "none";
  StreamOptions stream;
  bool no_verify = false;
  std::vector<double> sensitivity, stiffness;
  bool sader = false;
  BeamInFluid beam;
  std::optional<double> temperature_k;
  CalibrationSettings settings;
  std::string scaling = "stiffness";
  bool json = false;
};

std::vector<double> numbers(const std::string& option, const std::string& text, std::size_t least,
                            const char* form) {
  std::vector<double> values;
  for (const auto& word : CLI::detail::split(text, ':')) {
    double value = 0.0;
    if (!CLI::detail::lexical_cast(word, value) || !(value >= 0.0) || !std::isfinite(value)) break;
    values.push_back(value);
  }
  if (values.size() < least || values.size() > 2 ||
      static_cast<std::ptrdiff_t>(values.size()) != std::ranges::count(text, ':') + 1)
    throw std::invalid_argument(fmt::format("{}: \"{}\", must be {}", option, text, form));
  return values;
}

std::vector<FrequencyBand> bands_of(const std::string& option, const std::vector<std::string>& texts) {
  std::vector<FrequencyBand> bands;
  for (const auto& text : texts) {
    const auto ends = numbers(option, text, 2, "LOW:HIGH in Hz");
    if (ends[0] >= ends[1])
      throw std::invalid_argument(fmt::format("{}: \"{}\", LOW must be below HIGH", option, text));
    bands.push_back({ends[0], ends[1]});
  }
  return bands;
}

// Quality factor 0: not known.
std::vector<OscillatorStart> starts_of(const ThermalCommand& options, const Description& description,
                                       const std::optional<VendorFit>& vendor) {
  std::vector<OscillatorStart> starts;
  for (const auto& text : options.modes) {
    const auto values = numbers("--mode", text, 1, "FREQUENCY or FREQUENCY:Q, in Hz");
    starts.push_back({values[0], values.size() > 1 ? values[1] : 0.0});
  }
  if (starts.empty() && vendor && vendor->frequency_hz)
    starts.push_back({*vendor->frequency_hz, vendor->quality_factor.value_or(0.0)});
  if (starts.empty() && description.cantilever)
    for (const Mode& mode : description.cantilever->modes)
      starts.push_back({mode.frequency_hz, mode.quality_factor});
  if (starts.empty())
    throw std::invalid_argument("--mode: absent, and nothing else says at which frequencies the modes are");
  std::ranges::sort(starts, {}, &OscillatorStart::frequency_hz);
  return starts;
}

bool is_recording(const std::string& path) {
  const std::filesystem::path extension = std::filesystem::path(path).extension();
  return extension == ".sigmf-meta" || extension == ".sigmf-data" ||
         (!std::filesystem::exists(path) && std::filesystem::exists(sigmf_paths(path).meta));
}

ThermalSource open(const ThermalCommand& options, const Description& configured) {
  if (!options.source.empty() && !is_recording(options.source)) {
    SpectrumFileOptions file = options.file;
    file.hann = options.window == "hann";
    ThermalSource source = read_density(options.source, file);
    source.description = configured;
    return source;
  }
  const std::string recording =
      options.source.empty() ? record_live(options.connect, options.seconds) : options.source;
  const Description known = overlay(read_sigmf_meta(sigmf_paths(recording).meta).description, configured);
  std::vector<OscillatorStart> starts = starts_of(options, known, std::nullopt);
  constexpr double likely_quality = 300.0;
  for (OscillatorStart& start : starts)
    if (start.quality_factor == 0.0) start.quality_factor = likely_quality;
  StreamOptions stream = options.stream;
  stream.verify = !options.no_verify;
  return read_stream(recording, configured, starts, stream);
}

FrequencyBand around(const AveragedSpectrum& spectrum, const OscillatorStart& mode, double reach) {
  const double width = mode.frequency_hz / mode.quality_factor;
  const double last = spectrum.frequency_hz(spectrum.density.size() - 1);
  return {std::max({mode.frequency_hz - reach * width, spectrum.first_hz, 0.0}),
          std::min(mode.frequency_hz + reach * width, last)};
}

OscillatorStart start_of(const FittedMode& mode) {
  return {mode.frequency_hz, mode.quality_factor};
}

BandFit fit_one(const ThermalSource& source, ThermalFitSettings settings) {
  try {
    const ThermalFit fit = fit_thermal(source.spectrum, settings);
    return {std::move(settings), fit, {}};
  } catch (const std::invalid_argument& error) {
    throw InputError(source.name, "", error.what());
  }
}

// Of a tone the fit makes an oscillator as narrow as it may.
void require_resolved(const ThermalSource& source, const OscillatorStart& mode, double reach) {
  constexpr double least_bins = 31.0;  // a fit wants 32 of them, of which one may lie at the edge
  const double width_hz = mode.frequency_hz / mode.quality_factor;
  if (2.0 * reach * width_hz >= least_bins * source.spectrum.bin_hz) return;
  throw InputError(
      source.name, "",
      fmt::format(
          "the peak at {:.6g} Hz is {:.2g} Hz wide, too narrow for bins of {:.3g} Hz: if it is a tone of "
          "the drive, record with the drive off; if not, longer segments (--segment) resolve it",
          mode.frequency_hz, width_hz, source.spectrum.bin_hz));
}

// Over a band that follows the mode, until it stays within 1 % of the width: the start does not matter then.
BandFit fit_around(const ThermalSource& source, OscillatorStart start, double reach,
                   const std::vector<FrequencyBand>& excluded) {
  constexpr std::array other_reaches{2.0 / 3.0, 4.0 / 3.0};
  const auto fit_with = [&](double wide) {
    return fit_one(source, {around(source.spectrum, start, wide), excluded, {start}});
  };
  BandFit result = fit_with(reach);
  constexpr int most_rounds = 20;
  constexpr double tolerance = 0.01;
  for (int round = 0; round < most_rounds; ++round) {
    const OscillatorStart last = start;
    start = start_of(result.fit.modes[0]);
    require_resolved(source, start, reach);
    const double width = start.frequency_hz / start.quality_factor;
    const bool stays = std::abs(start.frequency_hz - last.frequency_hz) < tolerance * width &&
                       std::abs(start.quality_factor / last.quality_factor - 1.0) < tolerance;
    if (stays) break;
    result = fit_with(reach);
  }
  require_resolved(source, start, other_reaches.front() * reach);
  double spread = 0.0;
  for (const double factor : other_reaches)
    spread = std::max(spread, std::abs(std::log(fit_with(factor * reach).fit.modes[0].variance_v2 /
                                                result.fit.modes[0].variance_v2)));
  result.band_spread = spread;
  return result;
}

std::vector<BandFit> fit_all(const ThermalCommand& options, const ThermalSource& source,
                             const std::vector<OscillatorStart>& starts) {
  const AveragedSpectrum& spectrum = source.spectrum;
  const auto bands = bands_of("--band", options.bands);
  const auto excluded = bands_of("--exclude", options.excluded);
  const std::size_t wanted = options.joint ? 1 : starts.size();
  if (!bands.empty() && bands.size() != wanted)
    throw std::invalid_argument(
        fmt::format("--band: given {} times, must be {}", bands.size(),
                    options.joint ? "one for a joint fit" : fmt::format("{}, one a mode", wanted)));
  std::vector<BandFit> fits;
  if (options.joint) {
    FrequencyBand band = around(spectrum, starts.front(), options.reach);
    for (const OscillatorStart& start : starts)
      band.high_hz = std::max(band.high_hz, around(spectrum, start, options.reach).high_hz);
    fits.push_back(fit_one(source, {bands.empty() ? band : bands.front(), excluded, starts}));
    return fits;
  }
  for (std::size_t m = 0; m < starts.size(); ++m) {
    if (bands.empty()) {
      fits.push_back(fit_around(source, starts[m], options.reach, excluded));
      continue;
    }
    fits.push_back(fit_one(source, {bands[m], excluded, {starts[m]}}));
  }
  return fits;
}

void require_count(const char* option, const std::vector<double>& values, std::size_t modes) {
  if (values.size() > 1 && values.size() != modes)
    throw std::invalid_argument(
        fmt::format("{}: {} values, must be one, or {}, one a mode", option, values.size(), modes));
}

void choose_known(const ThermalCommand& options, const ThermalSource& source, CalibrationSettings& settings) {
  if (options.sader) {
    settings.known = KnownQuantity::sader;
    settings.beam = options.beam;
  } else if (!options.stiffness.empty()) {
    settings.known = KnownQuantity::stiffness;
    settings.values = options.stiffness;
  } else {
    settings.known = KnownQuantity::sensitivity;
    settings.values = options.sensitivity;
    if (settings.values.empty() && source.vendor && source.vendor->sensitivity_nm_per_v)
      settings.values = {*source.vendor->sensitivity_nm_per_v};
  }
}

double temperature(const ThermalCommand& options, const ThermalSource& source) {
  if (options.temperature_k) return *options.temperature_k;
  if (source.vendor && source.vendor->temperature_k) return *source.vendor->temperature_k;
  if (source.description.noise) return source.description.noise->temperature_k;
  throw std::invalid_argument("--temperature: absent, and nothing else says the temperature");
}

std::optional<double> vendor_stiffness(const VendorFit& vendor) {
  if (!vendor.frequency_hz || !vendor.quality_factor || !vendor.amplitude_v_per_sqrt_hz ||
      !vendor.sensitivity_nm_per_v || !vendor.temperature_k || !vendor.stiffness_n_per_m)
    return std::nullopt;
  MeasuredMode mode;
  const double peak = *vendor.amplitude_v_per_sqrt_hz * *vendor.amplitude_v_per_sqrt_hz;
  mode.mode = {*vendor.frequency_hz, *vendor.quality_factor,
               0.5 * std::numbers::pi * peak * *vendor.frequency_hz * *vendor.quality_factor};
  CalibrationSettings settings;
  settings.temperature_k = *vendor.temperature_k;
  settings.correction_factor = vendor.correction_factor.value_or(1.0);
  settings.values = {*vendor.sensitivity_nm_per_v};
  return calibrate_thermal(std::vector{mode}, settings).modes[0].stiffness_n_per_m;
}

// Two modes fitted in bands of their own, each for itself, may both have found the greater peak.
void require_peaks_of_their_own(std::span<const BandFit> fits, const std::vector<OscillatorStart>& starts) {
  if (fits.size() < starts.size()) return;  // a joint fit: both are in its model
  for (std::size_t a = 0; a < fits.size(); ++a)
    for (std::size_t b = a + 1; b < fits.size(); ++b) {
      const FittedMode &one = fits[a].fit.modes.front(), &other = fits[b].fit.modes.front();
      const double half_width_hz = 0.5 * one.frequency_hz / one.quality_factor;
      if (std::abs(one.frequency_hz - other.frequency_hz) < half_width_hz)
        throw std::invalid_argument(
            fmt::format("--mode: modes {} and {} were both found at {:.6g} Hz; give their frequencies and "
                        "quality factors (FREQUENCY:Q), bands of their own (--band), or --joint",
                        a + 1, b + 1, one.frequency_hz));
    }
}

ThermalResult calibrate(const ThermalCommand& options) {
  const Description configured =
      options.config.empty() ? Description{} : load_configuration(options.config).description;
  ThermalResult result{open(options, configured), {}, options.settings, {}, {}};
  result.settings.scaling =
      options.scaling == "sensitivity" ? ModeScaling::sensitivity : ModeScaling::stiffness;
  AveragedSpectrum& spectrum = result.source.spectrum;
  std::vector<OscillatorStart> starts = starts_of(options, result.source.description, result.source.vendor);
  for (OscillatorStart& start : starts)
    if (start.quality_factor == 0.0)
      start = find_start(spectrum, start.frequency_hz, {0.5 * start.frequency_hz, 2.0 * start.frequency_hz});
  require_count("--sensitivity", options.sensitivity, starts.size());
  require_count("--stiffness", options.stiffness, starts.size());
  result.fits = fit_all(options, result.source, starts);
  if (!result.source.averages_known) {
    spectrum.statistics.averages = result.fits.front().fit.scatter.averages;
    result.fits = fit_all(options, result.source, starts);
  }
  require_peaks_of_their_own(result.fits, starts);
  choose_known(options, result.source, result.settings);
  if (result.settings.known != KnownQuantity::sader && result.settings.values.empty()) return result;
  result.settings.temperature_k = temperature(options, result.source);
  std::vector<MeasuredMode> measured;
  for (const BandFit& one : result.fits)
    for (std::size_t m = 0; m < one.fit.modes.size(); ++m) measured.push_back(measured_mode(one.fit, m));
  result.calibrated = calibrate_thermal(measured, result.settings);
  if (result.source.vendor) result.vendor_stiffness_n_per_m = vendor_stiffness(*result.source.vendor);
  return result;
}

int run_thermal(const ThermalCommand& options) {
  const SigmfPaths recording = sigmf_paths(options.source);
  for (const std::string& output : {options.output, options.table})
    refuse_input(output, {options.source, recording.meta, recording.data, options.config});
  const ThermalResult result = calibrate(options);
  for (const auto& warning : warnings(result)) fmt::print(stderr, "combforce: {}\n", warning);
  if (!options.output.empty() && !result.calibrated)
    throw std::invalid_argument("--output: needs --sensitivity, --stiffness or --sader");
  if (!options.table.empty()) write_table(result, options.table);
  if (!options.output.empty()) {
    LineOutput output(options.output);
    constexpr int indent = 2;
    output.write(encode(calibration_of(result)).dump(indent) + "\n");
    output.close();
  }
  if (options.json) {
    fmt::print("{}\n", result.calibrated ? encode(calibration_of(result)).dump()
                                         : Json{{"origin", report_json(result)}}.dump());
  } else if (options.output != "-" && options.table != "-") {
    fmt::print("{}", report_text(result));
  }
  const bool good = std::ranges::all_of(result.fits, [](const BandFit& one) {
    return one.fit.status == ThermalStatus::converged || one.fit.status == ThermalStatus::misfit;
  });
  return good ? exit_done : exit_failed;
}

void add_source_options(CLI::App& thermal, ThermalCommand& options) {
  thermal.add_option(
      "source", options.source,
      "REC.sigmf-meta, or a file of densities (V²/Hz): text in columns, or JPK's .tnd; absent: "
      "the daemon's stream");
  add_connect(thermal, options.connect);
  thermal.add_option("--seconds", options.seconds, "of the daemon's stream, which it records")
      ->default_val(2.0)
      ->check(positive_number());
  thermal.add_option("--config", options.config, "channels, cantilever to start from and noise temperature");
  thermal
      .add_option("--segment", options.stream.segment_samples,
                  "samples a Hann segment; default: 30 ring-downs")
      ->check(CLI::Range(std::size_t{256}, std::size_t{1} << 24));
  thermal.add_flag("--no-verify", options.no_verify, "do not check core:sha512");
  thermal.add_option("--column", options.file.column, "of a file: where the density stands")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000));
  thermal.add_flag("--two-sided", options.file.two_sided,
                   "of a file: the density is that of both signs of frequency");
  thermal.add_option("--window", options.window, "of a file: what each periodogram was seen through")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "hann"}));
  thermal
      .add_option("--averages", options.file.averages,
                  "of a file: independent periodograms averaged; default: from the scatter")
      ->check(positive_number());
}

void add_fit_options(CLI::App& thermal, ThermalCommand& options) {
  thermal.add_option("--mode", options.modes,
                     "FREQUENCY or FREQUENCY:Q (Hz) to start from, one a mode; default: what source or "
                     "configuration say");
  thermal.add_option("--band", options.bands, "LOW:HIGH (Hz) to fit over, one a mode or one for a joint fit");
  thermal.add_option("--reach", options.reach, "without --band: f0 ± REACH f0/Q")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 1000.0));
  thermal.add_flag("--joint", options.joint, "all modes over one band, with one floor");
  thermal.add_option("--exclude", options.excluded, "LOW:HIGH (Hz) to leave out");
}

void add_calibration_options(CLI::App& thermal, ThermalCommand& options) {
  auto* sensitivity = thermal
                          .add_option("--sensitivity", options.sensitivity,
                                      "nm/V, known: of mode 1, or of every mode; gives stiffness")
                          ->check(positive_number());
  auto* stiffness = thermal
                        .add_option("--stiffness", options.stiffness,
                                    "N/m, known: of mode 1, or of every mode; gives sensitivity")
                        ->check(positive_number());
  auto* sader =
      thermal.add_flag("--sader", options.sader, "stiffness of mode 1 by Sader's method; gives sensitivity");
  stiffness->excludes(sensitivity);
  sader->excludes(sensitivity)->excludes(stiffness);
  for (const auto& [name, value] :
       {std::pair{"--length-um", &options.beam.length_um}, std::pair{"--width-um", &options.beam.width_um}}) {
    auto* size = thermal.add_option(name, *value, "of the rectangular cantilever")->check(positive_number());
    size->needs(sader);
    sader->needs(size);
  }
  options.beam.density_kg_per_m3 = 1.18;
  options.beam.viscosity_pa_s = 1.86e-5;
  thermal.add_option("--density", options.beam.density_kg_per_m3, "of the fluid, kg/m³; default: air")
      ->check(positive_number())
      ->capture_default_str();
  thermal.add_option("--viscosity", options.beam.viscosity_pa_s, "of the fluid, Pa s; default: air")
      ->check(positive_number())
      ->capture_default_str();
  thermal
      .add_option("--relative-error", options.settings.relative_error,
                  "standard error of what is known, relative")
      ->check(non_negative_number());
  thermal.add_option("--temperature", options.temperature_k, "K; default: what source or configuration say")
      ->check(positive_number());
  thermal
      .add_option("--correction-factor", options.settings.correction_factor,
                  "c in k α² P = c kB T; 1: k and α of the mode; 0.971: static k of a beam; 0.817: static k "
                  "and static α")
      ->capture_default_str()
      ->check(positive_number());
  thermal.add_option("--scaling", options.scaling, "how mode 1 gives the others, as in a beam")
      ->capture_default_str()
      ->check(CLI::IsMember({"stiffness", "sensitivity"}));
  thermal.add_option("--mode-numbers", options.settings.mode_numbers, "of the beam; default: 1, 2, …");
}

}  // namespace

void add_calibrate(CLI::App& app, Command& command) {
  auto options = std::make_shared<ThermalCommand>();
  CLI::App* calibrate = app.add_subcommand("calibrate", "Calibrate the cantilever");
  calibrate->require_subcommand(1);
  CLI::App* thermal = calibrate->add_subcommand("thermal", "Stiffness and sensitivity from thermal motion");
  add_source_options(*thermal, *options);
  add_fit_options(*thermal, *options);
  add_calibration_options(*thermal, *options);
  thermal->add_option("--output", options->output,
                      "calibration file, for \"calibration\" of a configuration (-: stdout)");
  thermal->add_option("--table", options->table,
                      "frequency, density, model, residual: for plots/thermal.gp (-: stdout)");
  thermal->add_flag("--json", options->json, "the calibration as JSON");
  thermal->callback([options, &command] { command = [options] { return run_thermal(*options); }; });
}

}  // namespace combforce
