// SigMF 1.2.5 metadata with the extension afm 0.1.0 (recording contract). No samples: drivers/replay reads
// them, daemon/record writes them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dsp/sample_block.hpp"
#include "dsp/scan.hpp"
#include "proto/description.hpp"
#include "proto/json.hpp"

namespace combforce {

// How samples lie in the data file. `bytes` a sample of one channel.
struct SigmfDatatype {
  enum class Kind : std::uint8_t { i8, u8, i16, f32 };
  Kind kind = Kind::i16;
  bool big_endian = false;

  std::size_t bytes() const { return kind == Kind::f32 ? 4 : kind == Kind::i16 ? 2 : 1; }
  bool operator==(const SigmfDatatype&) const = default;
};

// ri16_le, ri16_be, rf32_le, ri8, ru8. Throws std::invalid_argument with the list of what is readable.
SigmfDatatype parse_datatype(std::string_view name);
std::string to_string(SigmfDatatype datatype);

struct SigmfCapture {
  std::uint64_t sample_start = 0;  // frame in the file
  std::uint64_t global_index = 0;  // frame in the stream; sample_start when the file does not say
  std::optional<std::string> datetime;
  std::uint32_t epoch = 0;  // afm:epoch, afm:epoch_reason: a break of the clock
  EpochReason epoch_reason = EpochReason::start;
  std::vector<std::uint64_t> steps;  // afm:steps: stream samples of commanded steps (drive, set-point)
  std::vector<std::uint64_t>
      scan_ends;        // afm:scan_ends: first stream samples after a scan ended or was stopped
  Description changes;  // afm: objects valid from here on
};

struct SigmfLine {
  LineMark mark;                   // stream indices
  std::uint64_t sample_start = 0;  // surviving range in the file
  std::uint64_t sample_count = 0;
};

struct SigmfMeta {
  SigmfDatatype datatype;
  double sample_rate_hz = 0.0;
  std::uint32_t num_channels = 1;
  std::optional<std::string> sha512;
  Description description;             // of the global object
  Json truth;                          // afm:truth as it stands, null when absent
  std::vector<SigmfCapture> captures;  // ordered by sample_start; never empty after reading
  std::vector<SigmfLine> lines;        // ordered as in the file: by sample_start
  Json rest;                           // what else the file holds (global only), preserved
  std::vector<std::string> warnings;   // for people: newer minor version, …
};

// Reads and checks REC.sigmf-meta: types, bounds, order of captures and annotations, global_index that runs
// backwards, versions. Throws InputError with file and pointer.
SigmfMeta read_sigmf_meta(const std::string& path);
SigmfMeta parse_sigmf_meta(const Json& root, const std::string& file);

// The whole metadata object, ready to be written; validates against the standard's schema.
Json encode_sigmf(const SigmfMeta& meta);

// REC, REC.sigmf-meta or REC.sigmf-data -> the pair of paths.
struct SigmfPaths {
  std::string meta, data;
};
SigmfPaths sigmf_paths(const std::string& recording);

}  // namespace combforce
