#include "drivers/replay/sample_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace combforce {

static_assert(std::endian::native == std::endian::little,
              "samples of files are little-endian unless they say so");

namespace {

constexpr std::size_t chunk_bytes = 1u << 16;

void swap_bytes(std::byte* samples, std::size_t bytes, std::size_t width) {
  for (std::size_t i = 0; i < bytes; i += width) std::reverse(samples + i, samples + i + width);
}

// Bytes to i16; `sign_bit` is 0x80 for signed ones, else 0.
void widen(const std::byte* raw, std::size_t samples, int sign_bit, std::byte* out) {
  for (std::size_t i = 0; i < samples; ++i) {
    const auto value = static_cast<std::int16_t>((std::to_integer<int>(raw[i]) ^ sign_bit) - sign_bit);
    std::memcpy(out + i * sizeof(value), &value, sizeof(value));
  }
}

}  // namespace

SampleFile::SampleFile(const std::string& path, SigmfDatatype datatype, std::uint32_t channels, bool hash)
    : path_(path),
      datatype_(datatype),
      channels_(channels),
      descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status {};
  if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    const std::string why = descriptor_ < 0 ? std::strerror(errno) : "not a regular file";
    if (descriptor_ >= 0) ::close(descriptor_);
    throw InputError(path, "", "cannot read the samples: " + why);
  }
  bytes_ = static_cast<std::uint64_t>(status.st_size);
  raw_.resize(chunk_bytes / frame_bytes() * frame_bytes() + frame_bytes());
  if (hash) hash_.emplace();
}

SampleFile::~SampleFile() {
  ::close(descriptor_);
}

SampleFormat SampleFile::format() const {
  return datatype_.kind == SigmfDatatype::Kind::f32 ? SampleFormat::f32 : SampleFormat::i16;
}

void SampleFile::read(std::uint64_t frames, std::byte* out) {
  const std::size_t frame_size = frame_bytes();
  while (frames > 0) {
    const std::uint64_t chunk = std::min<std::uint64_t>(frames, raw_.size() / frame_size);
    const std::size_t bytes = chunk * frame_size, samples = chunk * channels_;
    if (read_some(raw_.data(), bytes) < bytes)
      throw std::runtime_error(path_ + ": ends before its samples do");
    convert(raw_.data(), samples, out);
    out += samples * sample_bytes(format());
    frames -= chunk;
  }
}

std::string SampleFile::sha512() {
  while (read_some(raw_.data(), raw_.size()) == raw_.size()) {
  }
  return hash_.value().hex();
}

std::size_t SampleFile::read_some(std::byte* out, std::size_t bytes) {
  std::size_t done = 0;
  while (done < bytes) {
    const ssize_t count = ::read(descriptor_, out + done, bytes - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw std::runtime_error(path_ + ": cannot read: " + std::strerror(errno));
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
  }
  if (hash_) hash_->update(out, done);
  return done;
}

void SampleFile::convert(const std::byte* raw, std::size_t samples, std::byte* out) const {
  switch (datatype_.kind) {
    case SigmfDatatype::Kind::i8:
      widen(raw, samples, 0x80, out);
      break;
    case SigmfDatatype::Kind::u8:
      widen(raw, samples, 0, out);
      break;
    case SigmfDatatype::Kind::i16:
    case SigmfDatatype::Kind::f32:
      std::memcpy(out, raw, samples * datatype_.bytes());
      if (datatype_.big_endian) swap_bytes(out, samples * datatype_.bytes(), datatype_.bytes());
  }
}

}  // namespace combforce
