// SigMF 1.2.5 metadata with the extension afm 0.1.0 (recording contract). No samples: drivers/replay reads
// them, daemon/record writes them.
//
// Keys of captures beyond the contract's table: afm:epoch, afm:epoch_reason and afm:epoch_first_sample (a
// break of the clock and where in the stream it was; all stay in force until the next break), afm:steps,
// afm:scan_ends, and afm:free_response may be null. Not readable,
// with an error that says so: non-conforming datasets (core:dataset, core:trailing_bytes, core:header_bytes),
// core:metadata_only, and parts of split recordings (core:offset).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
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

  std::size_t bytes() const {
    if (kind == Kind::f32) return 4;
    return kind == Kind::i16 ? 2 : 1;
  }
  bool operator==(const SigmfDatatype&) const = default;
};

// ri16_le, ri16_be, rf32_le, ri8, ru8. Throws std::invalid_argument with the list of what is readable.
SigmfDatatype parse_datatype(std::string_view name);
std::string to_string(SigmfDatatype datatype);

struct SigmfCapture {
  std::uint64_t sample_start = 0;  // frame in the file
  std::uint64_t global_index = 0;  // frame in the stream; sample_start when the file does not say
  std::optional<std::string> datetime;
  std::uint32_t epoch = 0;  // that of the previous capture (0 for the first) when the file does not say
  EpochReason epoch_reason = EpochReason::start;
  // Where in the stream the epoch began, <= global_index; that of its first capture when the file does not
  // say, 0 in epoch 0.
  std::uint64_t epoch_first_sample = 0;
  std::vector<std::uint64_t> steps;      // stream samples of commanded steps (drive, set-point), ascending
  std::vector<std::uint64_t> scan_ends;  // first stream samples after a scan ended or was stopped, ascending
  Description changes;                   // afm: objects valid from here on
  bool drops_free_response = false;      // afm:free_response is null: none is valid from here on
  Json rest;                             // other keys, preserved
};

// The frames sample_start … sample_start + sample_count - 1 lie, mapped through the captures, within the
// line's stream range. A line may cross a gap; sample_count 0: nothing of it survived.
struct SigmfLine {
  LineMark mark;                   // stream indices
  std::uint64_t sample_start = 0;  // surviving range in the file
  std::uint64_t sample_count = 0;
  Json rest;  // other keys, preserved
};

struct SigmfMeta {
  SigmfDatatype datatype;
  double sample_rate_hz = 0.0;
  std::uint32_t num_channels = 1;
  std::optional<std::string> sha512;    // of the data file, lower-case hexadecimal
  Description description;              // of the global object
  Json truth;                           // afm:truth as it stands, null when absent
  std::vector<SigmfCapture> captures;   // ordered by sample_start, the first at 0; never empty after reading
  std::vector<SigmfLine> lines;         // ordered as in the file: by sample_start
  std::vector<Json> other_annotations;  // those that mark no line, preserved
  Json rest;                            // what else the global object holds (core:recorder, …), preserved
  std::vector<std::string> warnings;    // for people: newer minor version, unknown afm: keys
};

// Reads and checks REC.sigmf-meta: types, bounds, order of captures and annotations, global_index that runs
// backwards, surviving ranges of lines, versions. Throws InputError with file and pointer.
SigmfMeta read_sigmf_meta(const std::string& path);
SigmfMeta parse_sigmf_meta(const Json& root, const std::string& file);

// What is in force from a capture on, given what was before it.
Description in_force_from(const SigmfCapture& capture, Description before);

// The stream index of a frame of the file, through the captures: at least one, the first at 0.
std::uint64_t stream_index(const std::vector<SigmfCapture>& captures, std::uint64_t file_frame);

// The whole metadata object, ready to be written; validates against the standard's schema. Annotations are
// sorted; core:version and core:extensions are those of `rest`, if it has them, with afm added.
Json encode_sigmf(const SigmfMeta& meta);

// REC, REC.sigmf-meta or REC.sigmf-data -> the pair of paths.
struct SigmfPaths {
  std::string meta, data;
};
SigmfPaths sigmf_paths(const std::string& recording);

}  // namespace combforce
