// The typed configuration of daemon and tools: recording < file < command line.
//
// A JSON text; // and /* */ comments are allowed. Every section and key but these is optional:
//
//     digitizer    {kind: simulated, simulation: {…}} (keys: simulation_codec.hpp), or
//                  {kind: replay, replay: {recording, realtime false, verify true}}; absent: none
//     channels, cantilever, excitation, comb, free_response, scan, noise, fit
//                  the objects of proto/description.hpp; a simulation takes from these what it does not say
//     calibration  a file (proto/calibration.hpp) that gives cantilever, which must not stand here then, and
//                  noise, unless that stands here
//     pipeline     {threads 0, ring_blocks 64, pixel_slots 256, drift_tolerance 0.01, spectrum_segment 16384}
//     server       {unix_socket, address, port, client_bytes}
//     record       {directory "."}
//     log_level    trace, debug, info, warning, error, critical or off
//
// Files to read (recording, calibration, maps of a scene) are relative to the configuration file; what is
// written (record.directory, server.unix_socket) to the working directory.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "drivers/simulated/simulation.hpp"
#include "proto/description.hpp"

namespace combforce {

struct ReplaySettings {
  std::string recording;  // REC.sigmf-meta
  bool realtime = false;  // at the recorded rate, dropping like a live source
  bool verify = true;     // check core:sha512 while streaming

  bool operator==(const ReplaySettings&) const = default;
};

struct DigitizerSettings {
  enum class Kind : std::uint8_t {
    none,       // not configured: the offline tools bring their own
    simulated,  // `simulation` is valid
    replay      // `replay` is valid
  };
  Kind kind = Kind::none;
  SimulationSettings simulation;
  ReplaySettings replay;

  bool operator==(const DigitizerSettings&) const = default;
};

struct PipelineSettings {
  unsigned threads = 0;             // fit workers; 0: one a core; <= 1024
  std::uint32_t ring_blocks = 64;   // blocks between digitizer and extraction, and recorder, each; >= 2
  std::uint32_t pixel_slots = 256;  // pixels between extraction and output; >= 2
  // Greatest change of a driven tone of the free response, relative to it, during a capture or from one
  // capture to the next, that is no drift: `incoherent` beyond it. > 0, <= 1. At 1 %, 10 mrad, forces are
  // wrong by some percent, the size of the bias of the paper's method.
  double drift_tolerance = 0.01;
  std::uint32_t spectrum_segment =
      16384;        // samples: bins lie sample_rate / spectrum_segment apart; even, 4..2^17
  bool fit = true;  // false: pixels are only extracted. Not in a file: each tool knows what it is for.

  bool operator==(const PipelineSettings&) const = default;
};

struct ServerSettings {
  std::string unix_socket =
      "/run/combforce/combforce.sock";  // "": none; at most 107 bytes, as the system has it
  std::string address = "127.0.0.1";
  std::uint16_t port = 8720;  // 0: no TCP
  std::uint64_t client_bytes =
      4U << 20;  // unsent bytes a client may hold before notifications are skipped; >= 64 KiB

  bool operator==(const ServerSettings&) const = default;
};

struct RecordSettings {
  std::string directory = ".";

  bool operator==(const RecordSettings&) const = default;
};

struct Configuration {
  DigitizerSettings digitizer;
  Description description;  // channels, cantilever, comb, free_response, scan, noise, fit
  PipelineSettings pipeline;
  ServerSettings server;
  RecordSettings record;
  std::string log_level = "info";

  bool operator==(const Configuration&) const = default;
};

// Unknown or duplicate key, wrong type, out of range, or settings that contradict each other: InputError with
// file, pointer, value and bound. `file` names the text in messages and is where relative paths start from.
Configuration load_configuration(const std::string& path);
Configuration parse_configuration(std::string_view text, const std::string& file);

// With every default filled in, the calibration's objects in its place and paths of files to read made
// absolute; parse_configuration() of it gives the same configuration.
std::string print_configuration(const Configuration& configuration);

}  // namespace combforce
