// combforce drive design: which further tones would sharpen the parameters of a comb and drive most.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/number_checks.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/tone_advice.hpp"
#include "daemon/cli/tone_information.hpp"
#include "fit/force_model.hpp"
#include "proto/json.hpp"

namespace combforce {
namespace {

constexpr unsigned refinements = 30;

struct DesignCommand {
  std::string config, model;
  std::vector<double> parameters;
  double sample_rate_hz = 0.0;
  std::uint32_t tones = 6;
  bool json = false;
};

template <typename Value>
Value need(std::optional<Value> value, const DesignCommand& options, const char* pointer) {
  if (!value) throw InputError(options.config, pointer, "is missing");
  return *std::move(value);
}

std::vector<double> driven_frequencies(const FitConditions& conditions) {
  std::vector<double> frequencies_hz;
  for (const Tone& tone : conditions.comb.tones)
    if (tone.driven)
      frequencies_hz.push_back(conditions.sample_rate_hz * static_cast<double>(tone.bin) /
                               static_cast<double>(conditions.comb.window_samples));
  return frequencies_hz;
}

// The drive forces that a free response tells.
std::vector<std::complex<double>> forces_of(const FreeResponse& free, const FitConditions& conditions) {
  const std::vector<double> frequencies_hz = driven_frequencies(conditions);
  std::vector<std::complex<double>> forces;
  for (std::size_t i = 0; i < conditions.comb.tones.size(); ++i)
    if (conditions.comb.tones[i].driven)
      forces.push_back(free.mean_nm[i] / tip_response(conditions.cantilever, frequencies_hz[forces.size()]));
  return forces;
}

// In the bounds of the fit.
void check_parameters(const std::vector<double>& parameters, const FitSettings& fit) {
  const ModelInfo& model = find_model(fit.model);
  std::string names;
  for (const ParameterInfo& info : model.parameters)
    names += fmt::format("{}{}", names.empty() ? "" : ",", info.name);
  if (parameters.size() != model.parameters.size())
    throw std::invalid_argument(fmt::format("--parameters: {} values, must be {}: {}", parameters.size(),
                                            model.parameters.size(), names));
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const ParameterInfo& info = model.parameters[k];
    const auto own = std::ranges::find(fit.bounds, info.name, &ParameterBounds::parameter);
    const double lower = own != fit.bounds.end() ? own->lower : info.lower,
                 upper = own != fit.bounds.end() ? own->upper : info.upper;
    if (!(parameters[k] >= lower && parameters[k] <= upper))
      throw std::invalid_argument(
          fmt::format("--parameters: {} is {}, must be in [{}, {}]", info.name, parameters[k], lower, upper));
  }
}

// What is fitted where the configuration does not say.
FitSettings default_fit(const Configuration& configuration) {
  FitSettings fit;
  if (configuration.digitizer.kind == DigitizerSettings::Kind::simulated)
    fit.model = configuration.digitizer.simulation.model;
  return fit;
}

// The simulation drives its own comb: another one may be analysed, but its drive must be that.
void check_comb(const DesignCommand& options, const Comb& comb, const Comb& simulated) {
  const auto driven = [](const Comb& of) {
    std::vector<std::uint64_t> bins;
    for (const Tone& tone : of.tones)
      if (tone.driven) bins.push_back(tone.bin);
    return bins;
  };
  if (comb.window_samples != simulated.window_samples || driven(comb) != driven(simulated))
    throw InputError(options.config, "/comb",
                     "must have the window and the driven tones of the simulation's comb");
}

TypicalPixel pixel_of(const DesignCommand& options) {
  const Configuration configuration = load_configuration(options.config);
  const Description& description = configuration.description;
  TypicalPixel pixel;
  FitConditions& conditions = pixel.conditions;
  conditions.settings = description.fit.value_or(default_fit(configuration));
  if (!options.model.empty() && options.model != conditions.settings.model) {
    conditions.settings.model = options.model;
    conditions.settings.bounds.clear();
  }
  conditions.settings = single_fit(conditions.settings, conditions.settings.model);
  conditions.settings.background = Background::none;  // the pixel is made without one
  check_parameters(options.parameters, conditions.settings);
  conditions.settings.refine = std::max(conditions.settings.refine, refinements);
  conditions.windows = description.scan ? description.scan->windows : 1;
  pixel.parameters = options.parameters;
  if (configuration.digitizer.kind == DigitizerSettings::Kind::simulated) {
    const SimulationSettings& simulation = configuration.digitizer.simulation;
    if (options.sample_rate_hz > 0.0)
      throw std::invalid_argument("--sample-rate: " + options.config +
                                  " simulates an instrument that has its own");
    conditions.sample_rate_hz = simulation.sample_rate_hz;
    conditions.comb = description.comb.value_or(simulation.comb);
    check_comb(options, conditions.comb, simulation.comb);
    conditions.cantilever = description.cantilever.value_or(simulation.cantilever);
    conditions.noise =
        description.noise.value_or(Noise{simulation.temperature_k, {simulation.detector_nm_per_sqrt_hz}});
    pixel.drive_forces_nn =
        drive_forces(simulation.drive, conditions.cantilever, driven_frequencies(conditions));
    return pixel;
  }
  if (!(options.sample_rate_hz > 0.0))
    throw std::invalid_argument("--sample-rate: is missing, and " + options.config +
                                " simulates no instrument that has one");
  conditions.sample_rate_hz = options.sample_rate_hz;
  conditions.comb = need(description.comb, options, "/comb");
  conditions.cantilever = need(description.cantilever, options, "/cantilever");
  conditions.noise = need(description.noise, options, "/noise");
  pixel.drive_forces_nn = forces_of(need(description.free_response, options, "/free_response"), conditions);
  return pixel;
}

void print_text(const TypicalPixel& pixel, const ToneAdvice& advice, double delta_f_hz) {
  const ModelInfo& model = find_model(pixel.conditions.settings.model);
  fmt::print(
      "Standard errors of a refined fit of {} (\"refine\": {}), with the tones of the comb and with more, "
      "one after "
      "the other:\n\n{:>24}",
      model.name, pixel.conditions.settings.refine, "");
  for (const ParameterInfo& info : model.parameters) fmt::print("  {:>28}", info.name);
  fmt::print("\n{:>24}", "comb");
  for (const double error : advice.std_errors) fmt::print("  {:>28.3g}", error);
  for (const ToneAdvice::Step& step : advice.steps) {
    fmt::print("\n{:>24}", fmt::format("+ bin {} ({:.6g} kHz)", step.bin,
                                       1e-3 * delta_f_hz * static_cast<double>(step.bin)));
    for (std::size_t k = 0; k < step.std_errors.size(); ++k)
      fmt::print("  {:>28}", fmt::format("{:.3g} ({:.0f} %)", step.std_errors[k],
                                         100.0 * step.std_errors[k] / advice.std_errors[k]));
  }
  fmt::print("\n");
  if (advice.steps.empty()) fmt::print("\nNo other bin moves.\n");
}

Json named(const std::vector<double>& values, const ModelInfo& model) {
  Json object = Json::object();
  for (std::size_t k = 0; k < values.size(); ++k)
    object[std::string(model.parameters[k].name)] = number9(values[k]);
  return object;
}

void print_json(const TypicalPixel& pixel, const ToneAdvice& advice, double delta_f_hz) {
  const ModelInfo& model = find_model(pixel.conditions.settings.model);
  Json added = Json::array();
  for (const ToneAdvice::Step& step : advice.steps)
    added.push_back({{"bin", step.bin},
                     {"frequency_hz", number9(delta_f_hz * static_cast<double>(step.bin))},
                     {"std_errors", named(step.std_errors, model)}});
  fmt::print("{}\n", Json{{"model", model.name},
                          {"refine", pixel.conditions.settings.refine},
                          {"parameters", named(pixel.parameters, model)},
                          {"std_errors", named(advice.std_errors, model)},
                          {"added", added}}
                         .dump());
}

// Empty for a model there is.
std::string model_error(const std::string& name) {
  try {
    find_model(name);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

int run_design(const DesignCommand& options) {
  const TypicalPixel pixel = pixel_of(options);
  Progress progress;
  const ToneAdvice advice = advise_tones(pixel, options.tones, [&](std::size_t done, std::size_t all) {
    if (progress.due()) progress.show(fmt::format("fit {} of {}", done, all));
  });
  progress.clear();
  const double delta_f_hz = bin_hz(pixel.conditions);
  (options.json ? print_json : print_text)(pixel, advice, delta_f_hz);
  return exit_done;
}

}  // namespace

void add_drive(CLI::App& app, Command& command) {
  CLI::App* drive = app.add_subcommand("drive", "The comb and its drive");
  drive->require_subcommand(1);
  auto options = std::make_shared<DesignCommand>();
  CLI::App* design = drive->add_subcommand("design", "Which further tones sharpen the parameters most");
  design->add_option("--config", options->config, "configuration with cantilever, comb, noise and a drive")
      ->required();
  design
      ->add_option("--parameters", options->parameters,
                   "of a typical pixel, in the model's order: -40,1,5,0.5 for dmt")
      ->required()
      ->delimiter(',');
  design->add_option("--model", options->model, "force model instead of the configured one")
      ->check(CLI::Validator(model_error, "MODEL"));
  design
      ->add_option(
          "--sample-rate", options->sample_rate_hz,
          "Hz, where the configuration simulates nothing; the drive is then that of its free response")
      ->check(positive_number());
  design->add_option("--tones", options->tones, "how many to add")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  design->add_flag("--json", options->json, "as JSON");
  design->callback([options, &command] { command = [options] { return run_design(*options); }; });
}

}  // namespace combforce
