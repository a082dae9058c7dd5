#include "daemon/record/recording_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace combforce {

namespace {

[[noreturn]] void fail(const std::string& path, const char* what) {
  throw std::runtime_error(fmt::format("{}: cannot {}: {}", path, what, std::strerror(errno)));
}

// Closes on every way out.
class Descriptor {
 public:
  Descriptor(const std::string& path, int flags) : path_(path), number_(::open(path.c_str(), flags, 0666)) {
    if (number_ < 0) fail(path, "open");
  }
  ~Descriptor() { ::close(number_); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int number() const { return number_; }
  void sync() const {
    if (::fsync(number_) != 0) fail(path_, "sync");
  }

 private:
  std::string path_;
  int number_;
};

void write_all(int descriptor, const std::string& path, const char* data, std::size_t bytes) {
  while (bytes > 0) {
    const ssize_t count = ::write(descriptor, data, bytes);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(path, "write");
    data += count;
    bytes -= static_cast<std::size_t>(count);
  }
}

// Room for the metadata that one second of marks may add.
constexpr std::size_t least_reserve_bytes = 64 << 10;

}  // namespace

RecordingFile::RecordingFile(SigmfPaths paths) : paths_(std::move(paths)) {
  if (std::filesystem::exists(paths_.meta)) throw std::runtime_error(paths_.meta + ": exists already");
  data_ = ::open(paths_.data.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0666);
  if (data_ < 0 && errno == EEXIST) throw std::runtime_error(paths_.data + ": exists already");
  if (data_ < 0) fail(paths_.data, "create");
  const std::string reserve = paths_.meta + ".reserve";
  reserve_ = ::open(reserve.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  ::unlink(reserve.c_str());
}

RecordingFile::~RecordingFile() {
  ::close(data_);
  release_reserve();
}

void RecordingFile::append(const void* data, std::size_t bytes) {
  try {
    write_all(data_, paths_.data, static_cast<const char*>(data), bytes);
  } catch (const std::runtime_error&) {
    // Should this fail too, a replay finds and states the odd bytes.
    [[maybe_unused]] const int ignored = ::ftruncate(data_, static_cast<off_t>(bytes_));
    throw;
  }
  bytes_ += bytes;
  hash_.update(data, bytes);
}

void RecordingFile::sync() const {
  if (::fdatasync(data_) != 0) fail(paths_.data, "sync");
}

void RecordingFile::replace_meta(const SigmfMeta& meta, std::uint64_t version, Durability durability) {
  const bool durable = durability == Durability::power;
  const std::string text = encode_sigmf(meta).dump(1) + "\n";
  const std::string next = paths_.meta + (durable ? ".tmp" : ".new");
  {
    const Descriptor file(next, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC);
    write_all(file.number(), next, text.data(), text.size());
    if (durable) file.sync();
  }
  {
    const std::lock_guard lock(replace_mutex_);
    if (version < replaced_version_) {
      ::unlink(next.c_str());
      return;
    }
    replaced_version_ = version;
    if (std::rename(next.c_str(), paths_.meta.c_str()) != 0) fail(paths_.meta, "replace");
    grow_reserve(least_reserve_bytes + 2 * text.size());
  }
  if (!durable) return;
  const std::string directory = std::filesystem::path(paths_.meta).parent_path().string();
  Descriptor(directory.empty() ? "." : directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC).sync();
}

// Without room for it there is simply none.
void RecordingFile::grow_reserve(std::size_t bytes) {
  if (reserve_ < 0 || bytes <= reserved_bytes_) return;
  if (::posix_fallocate(reserve_, 0, static_cast<off_t>(2 * bytes)) == 0) reserved_bytes_ = 2 * bytes;
}

void RecordingFile::release_reserve() {
  const std::lock_guard lock(replace_mutex_);
  if (reserve_ >= 0) ::close(std::exchange(reserve_, -1));
}

}  // namespace combforce
