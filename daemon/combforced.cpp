// combforced: the daemon. Runs one instrument, as configured, and serves it until SIGTERM or SIGINT.
#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "config/configuration.hpp"
#include "config/field_message.hpp"
#include "daemon/cli/exit_code.hpp"
#include "daemon/instrument.hpp"
#include "daemon/serve/server.hpp"
#include "drivers/simulated/scene.hpp"
#include "fit/force_model.hpp"

namespace {

using namespace combforce;

struct Options {
  std::string config;
  bool check = false;
  bool print = false;
};

// The maps of a scene are else only read when a scan starts.
void check_maps(const DigitizerSettings& digitizer) {
  const SimulationSettings& simulation = digitizer.simulation;
  if (digitizer.kind == DigitizerSettings::Kind::simulated &&
      simulation.scene.kind == SceneSettings::Kind::maps)
    make_scene(simulation.scene, find_model(simulation.model), simulation.layout);
}

Configuration load(const Options& options) {
  if (options.config.empty()) return {};
  Configuration configuration = load_configuration(options.config);
  if (configuration.digitizer.kind == DigitizerSettings::Kind::none) {
    throw InputError(options.config, "/digitizer", "is missing: the daemon needs one");
  }
  check_maps(configuration.digitizer);
  return configuration;
}

// What only the parts find, said of the file.
Instrument make_instrument(const Options& options, const Configuration& configuration,
                           const PipelineOutputs& outputs) {
  try {
    return {configuration, outputs};
  } catch (const std::invalid_argument& error) {
    const FieldMessage refused = split_field(error.what());
    throw InputError(options.config, refused.pointer, refused.message);
  }
}

void start_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("combforced"));
  spdlog::set_level(spdlog::level::from_str(level));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %^%l%$ %v", spdlog::pattern_time_type::utc);
}

spdlog::level::level_enum rank_of(const Event& event) {
  if (event.kind == "record_failed") return spdlog::level::err;
  if (event.kind == "stream_ended") return event.text.empty() ? spdlog::level::info : spdlog::level::err;
  return event.kind == "scan_ended" ? spdlog::level::info : spdlog::level::warn;
}

void log_event(const Event& event) {
  spdlog::log(rank_of(event), "{} at sample {}{}{}", event.kind, event.first_sample,
              event.text.empty() ? "" : ": ", event.text);
}

PipelineOutputs outputs_to(Server& server) {
  PipelineOutputs outputs;
  outputs.pixel = [&server](const RetiredPixel& pixel) { server.publish_pixel(pixel); };
  outputs.line = [&server](const LineDone& line) { server.publish_line(line); };
  outputs.frame = [&server](const FrameDone& frame) { server.publish_frame(frame); };
  outputs.spectrum = [&server](const Spectrum& spectrum) { server.publish_spectrum(spectrum); };
  outputs.event = [&server](const Event& event) {
    log_event(event);
    server.publish_event(event);
  };
  return outputs;
}

void log_addresses(const ServerSettings& settings, const Server& server) {
  if (!settings.unix_socket.empty()) spdlog::info("listening on unix:{}", settings.unix_socket);
  if (const std::string tcp = server.tcp_endpoint(); !tcp.empty()) spdlog::info("listening on {}", tcp);
}

int serve(const Options& options, const Configuration& configuration) {
  start_logging(configuration.log_level);
  std::signal(SIGPIPE, SIG_IGN);
  Server server(configuration.server);
  server.stop_on_signals();
  Instrument instrument = make_instrument(options, configuration, outputs_to(server));
  log_addresses(configuration.server, server);
  instrument.start();
  spdlog::info("{} runs at {} samples/s", instrument.info().name, instrument.info().sample_rate_hz);
  server.run(instrument);
  spdlog::info("stopped");
  return exit_done;
}

int run(const Options& options) {
  const Configuration configuration = load(options);
  if (options.print) {
    std::printf("%s\n", print_configuration(configuration).c_str());
    return exit_done;
  }
  if (options.check) {
    PipelineOutputs outputs;
    outputs.event = [](const Event& event) { fmt::print(stderr, "combforced: {}\n", event.text); };
    make_instrument(options, configuration, outputs);
    std::printf("%s: good\n", options.config.c_str());
    return exit_done;
  }
  return serve(options, configuration);
}

int run(int argc, char** argv) {
  CLI::App app{"Combforce daemon: forces from multifrequency AFM, live", "combforced"};
  app.set_version_flag("--version", "combforced " COMBFORCE_VERSION);
  Options options;
  app.add_option("--config", options.config, "Configuration, JSON with comments")->type_name("FILE");
  app.add_flag("--check-config", options.check, "Only check the configuration");
  app.add_flag("--print-config", options.print,
               "Only print the configuration with every default; without --config the defaults alone");
  try {
    app.parse(argc, argv);
    if (options.config.empty() && !options.print) throw CLI::RequiredError("--config");
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_done : exit_usage;
  }
  return run(options);
}

}  // namespace

int main(int argc, char** argv) {
  return combforce::run_program("combforced", [argc, argv] { return run(argc, argv); });
}
