#include "config/configuration.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <limits>

#include "config/simulation_codec.hpp"
#include "proto/calibration.hpp"

namespace combforce {
namespace {

constexpr std::array<std::string_view, 7> log_levels = {"trace", "debug",    "info", "warning",
                                                        "error", "critical", "off"};

ReplaySettings decode_replay(const JsonView& view, const std::filesystem::path& base) {
  view.only({"recording", "realtime", "verify"});
  ReplaySettings replay;
  replay.recording = resolve_path(view.get("recording"), base);
  if (const auto realtime = view.find("realtime")) replay.realtime = realtime->boolean();
  if (const auto verify = view.find("verify")) replay.verify = verify->boolean();
  return replay;
}

DigitizerSettings decode_digitizer(const JsonView& view, const Description& top,
                                   const std::filesystem::path& base) {
  DigitizerSettings digitizer;
  if (view.get("kind").one_of({"simulated", "replay"}) == 0) {
    view.only({"kind", "simulation"});
    digitizer.kind = DigitizerSettings::Kind::simulated;
    digitizer.simulation = decode_simulation(view.get("simulation"), top, base);
  } else {
    view.only({"kind", "replay"});
    digitizer.kind = DigitizerSettings::Kind::replay;
    digitizer.replay = decode_replay(view.get("replay"), base);
  }
  return digitizer;
}

PipelineSettings decode_pipeline(const JsonView& view) {
  constexpr std::uint64_t most_threads = 1024;
  constexpr std::uint64_t most_slots = 1U << 20;
  constexpr std::uint64_t most_segment = 1U << 17;
  view.only({"threads", "ring_blocks", "pixel_slots", "drift_tolerance", "spectrum_segment"});
  PipelineSettings pipeline;
  if (const auto threads = view.find("threads"))
    pipeline.threads = static_cast<unsigned>(threads->integer(0, most_threads));
  if (const auto blocks = view.find("ring_blocks"))
    pipeline.ring_blocks = static_cast<std::uint32_t>(blocks->integer(2, most_slots));
  if (const auto slots = view.find("pixel_slots"))
    pipeline.pixel_slots = static_cast<std::uint32_t>(slots->integer(2, most_slots));
  if (const auto tolerance = view.find("drift_tolerance"))
    pipeline.drift_tolerance = tolerance->number({.lower = 0.0, .upper = 1.0, .lower_open = true});
  if (const auto segment = view.find("spectrum_segment")) {
    pipeline.spectrum_segment = static_cast<std::uint32_t>(segment->integer(4, most_segment));
    if (pipeline.spectrum_segment % 2 != 0)
      segment->fail(fmt::format("is {}, must be even", pipeline.spectrum_segment));
  }
  return pipeline;
}

ServerSettings decode_server(const JsonView& view) {
  constexpr std::size_t longest_socket = 107;  // sockaddr_un::sun_path less its NUL
  constexpr std::uint64_t least_bytes = 64U << 10;
  constexpr std::uint64_t most_bytes = 1U << 30;
  view.only({"unix_socket", "address", "port", "client_bytes"});
  ServerSettings server;
  if (const auto socket = view.find("unix_socket")) {
    server.unix_socket = socket->string();
    if (server.unix_socket.size() > longest_socket)
      socket->fail("has " + std::to_string(server.unix_socket.size()) + " bytes, must have at most 107");
  }
  if (const auto address = view.find("address")) {
    server.address = address->string();
    if (server.address.empty()) address->fail("is empty, must be an address; port 0 turns TCP off");
  }
  if (const auto port = view.find("port"))
    server.port = static_cast<std::uint16_t>(port->integer(0, std::numeric_limits<std::uint16_t>::max()));
  if (const auto bytes = view.find("client_bytes"))
    server.client_bytes = bytes->integer(least_bytes, most_bytes);
  return server;
}

RecordSettings decode_record(const JsonView& view) {
  view.only({"directory"});
  RecordSettings record;
  if (const auto directory = view.find("directory")) {
    record.directory = directory->string();
    if (record.directory.empty()) directory->fail("is empty, must name a directory");
  }
  return record;
}

// The cantilever has one source; a configuration may know its noise better than the calibration did.
void include_calibration(const JsonView& file, const std::filesystem::path& base, Description& description) {
  if (description.cantilever)
    file.fail("gives the cantilever, which /cantilever gives too; one of them must go");
  const Calibration calibration = load_calibration(resolve_path(file, base));
  description.cantilever = calibration.cantilever;
  if (!description.noise) description.noise = calibration.noise;
}

Configuration decode_configuration(const JsonView& root, const std::filesystem::path& base) {
  root.only({"digitizer", "calibration", "channels", "cantilever", "excitation", "comb", "free_response",
             "scan", "noise", "fit", "pipeline", "server", "record", "log_level"});
  Configuration configuration;
  configuration.description = decode_description(root, "");
  if (const auto calibration = root.find("calibration"))
    include_calibration(*calibration, base, configuration.description);
  if (const auto digitizer = root.find("digitizer"))
    configuration.digitizer = decode_digitizer(*digitizer, configuration.description, base);
  if (const auto& excitation = configuration.description.excitation;
      excitation && excitation->kind == Excitation::Kind::base &&
      configuration.digitizer.kind == DigitizerSettings::Kind::simulated)
    root.get("excitation").get("kind").fail("is \"base\", but the simulated drive acts at the tip");
  if (const auto pipeline = root.find("pipeline")) configuration.pipeline = decode_pipeline(*pipeline);
  if (const auto server = root.find("server")) configuration.server = decode_server(*server);
  if (const auto record = root.find("record")) configuration.record = decode_record(*record);
  if (const auto level = root.find("log_level"))
    configuration.log_level = log_levels[level->one_of(log_levels)];
  return configuration;
}

Json encode(const DigitizerSettings& digitizer) {
  if (digitizer.kind == DigitizerSettings::Kind::simulated)
    return Json{{"kind", "simulated"}, {"simulation", encode(digitizer.simulation)}};
  return Json{{"kind", "replay"},
              {"replay",
               {{"recording", digitizer.replay.recording},
                {"realtime", digitizer.replay.realtime},
                {"verify", digitizer.replay.verify}}}};
}

}  // namespace

Configuration parse_configuration(std::string_view text, const std::string& file) {
  const Json root = parse_json(text, file, Comments::allow);
  return decode_configuration(JsonView(root, file), std::filesystem::absolute(file).parent_path());
}

Configuration load_configuration(const std::string& path) {
  const Json root = parse_json_file(path, Comments::allow);
  return decode_configuration(JsonView(root, path), std::filesystem::absolute(path).parent_path());
}

std::string print_configuration(const Configuration& configuration) {
  Json root = Json::object();
  if (configuration.digitizer.kind != DigitizerSettings::Kind::none)
    root["digitizer"] = encode(configuration.digitizer);
  encode_into(root, configuration.description, "");
  root["pipeline"] = Json{{"threads", configuration.pipeline.threads},
                          {"ring_blocks", configuration.pipeline.ring_blocks},
                          {"pixel_slots", configuration.pipeline.pixel_slots},
                          {"drift_tolerance", configuration.pipeline.drift_tolerance},
                          {"spectrum_segment", configuration.pipeline.spectrum_segment}};
  root["server"] = Json{{"unix_socket", configuration.server.unix_socket},
                        {"address", configuration.server.address},
                        {"port", configuration.server.port},
                        {"client_bytes", configuration.server.client_bytes}};
  root["record"] = Json{{"directory", configuration.record.directory}};
  root["log_level"] = configuration.log_level;
  constexpr int indent = 2;
  return root.dump(indent) + "\n";
}

}  // namespace combforce
