// The data file of a recording, read front to back: frames as the stream carries them, and the file's
// SHA-512.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/sha512.hpp"
#include "dsp/sample_block.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

// Thread-bound.
class SampleFile {
 public:
  // Opens `path`; throws InputError naming it when it cannot be read. `channels` >= 1. With `hash` every byte
  // that is read is hashed.
  SampleFile(const std::string& path, SigmfDatatype datatype, std::uint32_t channels, bool hash);
  ~SampleFile();
  SampleFile(const SampleFile&) = delete;
  SampleFile& operator=(const SampleFile&) = delete;

  // As of opening.
  std::uint64_t frames() const { return bytes_ / frame_bytes(); }
  std::uint64_t trailing_bytes() const { return bytes_ % frame_bytes(); }

  // f32 for rf32; i16 for all others. Codes of ri8 and ru8 keep their value (-128..127, 0..255).
  SampleFormat format() const;

  // The next `frames` frames, converted, to `out` (room for frames * channels samples of format()). Throws
  // std::runtime_error naming the file when it ends early or cannot be read.
  void read(std::uint64_t frames, std::byte* out);
  // Reads to the end; the hash of the whole file. Requires `hash`.
  std::string sha512();

 private:
  std::size_t frame_bytes() const { return datatype_.bytes() * channels_; }
  std::size_t read_some(std::byte* out, std::size_t bytes);  // fewer only at the end of the file
  void convert(const std::byte* raw, std::size_t samples, std::byte* out) const;

  std::string path_;
  SigmfDatatype datatype_;
  std::uint32_t channels_;
  int descriptor_ = -1;
  std::uint64_t bytes_ = 0;
  std::vector<std::byte> raw_;
  std::optional<Sha512> hash_;
};

}  // namespace combforce
