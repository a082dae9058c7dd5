// combforce simulate: the simulated instrument and the recorder, as fast as the simulation runs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "config/configuration.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/instrument.hpp"
#include "proto/sigmf.hpp"

namespace combforce {
namespace {

struct SimulateCommand {
  std::string config, output;
  bool json = false;
};

// Enough windows that the reference is better known than any pixel of one window.
constexpr double least_free_windows = 16.0;

double window_s(const SimulationSettings& simulation) {
  return static_cast<double>(simulation.comb.window_samples) / simulation.sample_rate_hz;
}

Configuration configure(const SimulateCommand& options) {
  Configuration configuration = load_configuration(options.config);
  if (configuration.digitizer.kind == DigitizerSettings::Kind::none)
    throw InputError(options.config, "/digitizer", "is missing, must be of kind \"simulated\"");
  if (configuration.digitizer.kind != DigitizerSettings::Kind::simulated)
    throw InputError(options.config, "/digitizer/kind",
                     "\"replay\" cannot be simulated; expected \"simulated\"");
  SimulationSettings& simulation = configuration.digitizer.simulation;
  configuration.pipeline.fit = false;
  simulation.paced = false;
  simulation.ends_with_scan = true;
  simulation.free_seconds = std::max(simulation.free_seconds, least_free_windows * window_s(simulation));
  const std::filesystem::path output = sigmf_paths(options.output).meta;
  configuration.record.directory = output.parent_path().empty() ? "." : output.parent_path().string();
  return configuration;
}

// Everything is asked for before the stream starts, so that the same configuration gives the same samples;
// the recording last, so that what is refused leaves no files.
int run_simulate(const SimulateCommand& options) {
  const Configuration configuration = configure(options);
  const SimulationSettings& simulation = configuration.digitizer.simulation;
  Progress progress;
  PipelineOutputs outputs;
  outputs.line = [&](const LineDone& line) {
    if (progress.due()) progress.show(fmt::format("frame {} line {}", line.mark.frame, line.mark.line));
  };
  std::string no_reference;
  Instrument instrument(configuration, outputs);
  instrument.capture_free(static_cast<std::uint32_t>(simulation.free_seconds / window_s(simulation)),
                          Instrument::Height::far,
                          [&](const std::optional<FreeResponse>& free, const std::string& why) {
                            if (!why.empty())
                              no_reference = (free ? "incoherent: " : "no free response: ") + why;
                          });
  instrument.start_scan(simulation.layout, simulation.frames);
  instrument.start_recording(std::filesystem::path(sigmf_paths(options.output).meta).stem().string());
  instrument.start();
  instrument.wait();
  const RecordingSummary summary = instrument.stop_recording();
  const StreamStatus stream = instrument.status().stream;
  progress.clear();
  if (!summary.complete) throw std::runtime_error(fmt::format("{}: {}", summary.meta_path, summary.failure));
  if (!no_reference.empty()) fmt::print(stderr, "combforce: {}\n", no_reference);
  if (options.json)
    fmt::print("{}\n", Json{{"recording", summary.meta_path},
                            {"frames", summary.frames},
                            {"gaps", summary.gaps},
                            {"realtime_factor", number9(stream.realtime_factor)}}
                           .dump());
  else
    fmt::print("{}: {} frames, {} gaps, {:.3g} times real time\n", summary.meta_path, summary.frames,
               summary.gaps, stream.realtime_factor);
  return exit_done;
}

}  // namespace

void add_simulate(CLI::App& app, Command& command) {
  auto options = std::make_shared<SimulateCommand>();
  CLI::App* simulate = app.add_subcommand("simulate", "Record a scan of the simulated instrument");
  simulate->add_option("--config", options->config, "configuration with a simulated digitizer")->required();
  simulate->add_option("--output", options->output, "recording to write (REC or REC.sigmf-meta)")->required();
  simulate->add_flag("--json", options->json, "summary as JSON");
  simulate->callback([options, &command] { command = [options] { return run_simulate(*options); }; });
}

}  // namespace combforce
