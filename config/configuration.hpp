// The typed configuration of daemon and tools: recording < file < command line.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/simulated/simulation.hpp"
#include "proto/description.hpp"

namespace combforce {

struct ReplaySettings {
  std::string recording;  // REC.sigmf-meta
  bool realtime = false;  // at the recorded rate, dropping like a live source
  bool verify = true;     // check core:sha512 while streaming
};

struct DigitizerSettings {
  enum class Kind : std::uint8_t { simulated, replay };
  Kind kind = Kind::simulated;
  SimulationSettings simulation;
  ReplaySettings replay;
};

struct PipelineSettings {
  unsigned threads = 0;            // fit workers; 0: one a core
  std::uint32_t ring_blocks = 64;  // blocks between digitizer and extraction, and recorder, each
  std::uint32_t pixel_slots = 256; // pixels between extraction and output
};

struct ServerSettings {
  std::string unix_socket = "/run/combforce/combforce.sock";  // "": none
  std::string address = "127.0.0.1";
  std::uint16_t port = 8720;  // 0: no TCP
  std::uint64_t client_bytes = 4u << 20;  // unsent bytes a client may hold before notifications are skipped
};

struct RecordSettings {
  std::string directory = ".";
};

struct Configuration {
  DigitizerSettings digitizer;
  Description description;  // channels, cantilever, comb, free_response, scan, noise, fit
  PipelineSettings pipeline;
  ServerSettings server;
  RecordSettings record;
  std::string log_level = "info";
};

// A JSON text (comments allowed) to the configuration. Unknown or duplicate key, wrong type, out of range: InputError
// with file, pointer, value and bound. Relative paths in it are relative to the file.
Configuration load_configuration(const std::string& path);
Configuration parse_configuration(std::string_view text, const std::string& file);

// With every default filled in; load_configuration() of it gives the same configuration.
std::string print_configuration(const Configuration& configuration);

}  // namespace combforce
