// The pair of files of a recording while it grows: samples appended, metadata replaced atomically.
//
// While it grows it holds back some room on the disk, so that the metadata can still be written when the
// samples have filled it.
//
// Thread rule: append() and sha512() from one thread; sync(), replace_meta() and release_reserve() from any.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>

#include "drivers/sha512.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

// Every failure is a std::runtime_error naming the file and the system's reason.
class RecordingFile {
 public:
  // Creates REC.sigmf-data; refuses when it or REC.sigmf-meta exists.
  explicit RecordingFile(SigmfPaths paths);
  ~RecordingFile();
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;

  // All or nothing: what a failed write left behind is cut off again.
  void append(const void* data, std::size_t bytes);
  std::string sha512() const { return hash_.hex(); }  // of what was appended

  // The samples appended so far survive a loss of power.
  void sync() const;

  enum class Durability : std::uint8_t {
    process,  // survives the end of this process, however it ends
    power     // and a loss of power; may take long on a busy disk
  };
  // Writes a new file and renames it over REC.sigmf-meta. `version` counts snapshots: an older one never
  // replaces a newer one. At most one thread a durability at a time.
  void replace_meta(const SigmfMeta& meta, std::uint64_t version, Durability durability);

  // Gives the room held back to the last replace_meta().
  void release_reserve();

  const SigmfPaths& paths() const { return paths_; }

 private:
  void grow_reserve(std::size_t bytes);

  SigmfPaths paths_;
  int data_ = -1;
  int reserve_ = -1;  // a file without a name; -1: none, guarded by replace_mutex_
  std::uint64_t bytes_ = 0;
  Sha512 hash_;
  std::size_t reserved_bytes_ = 0;
  std::mutex replace_mutex_;
  std::uint64_t replaced_version_ = 0;
};

}  // namespace combforce
