// A SigMF recording as a digitizer: the stream it holds, with the gaps, epochs, line marks
// and steps it states.
//
// - The stream index starts at the first capture's global_index. A jump of global_index is lost_before of the
//   next block; a capture of a later afm:epoch starts a new epoch.
// - Line annotations, afm:steps and afm:scan_ends become marks of the block that holds their sample, or, when
//   that was lost, of the first block after it.
// - Data that disagrees with the metadata in length is replayed as far as it goes: warnings() says so. A file
//   that ends while it is read, or does not match core:sha512, ends the stream as `failed`, with everything
//   before delivered.
// - afm: objects of captures are not applied here: meta() hands them to whoever analyses the stream.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/digitizer.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

struct ReplayOptions {
  // At the recorded rate, dropping like a live source; otherwise as fast as blocks are taken.
  bool realtime = false;
  bool verify = true;                  // check core:sha512, when there is one, while streaming
  std::uint32_t block_frames = 16384;  // 1..2^20; fewer when frames are so wide that a block exceeds 16 MiB
};

// Thread rule as of every digitizer.
class ReplayDigitizer final : public Digitizer {
 public:
  // REC, REC.sigmf-meta or REC.sigmf-data. Throws InputError naming file and field: unreadable files,
  // metadata that breaks the contract, afm:channels that do not match core:num_channels;
  // std::invalid_argument on bad options.
  explicit ReplayDigitizer(const std::string& recording, ReplayOptions options = {});
  ~ReplayDigitizer() override;  // stops

  const StreamInfo& info() const override;
  void start(BlockSink& sink) override;
  void stop() override;
  StreamStatus status() const override;

  const SigmfMeta& meta() const;
  // Of the metadata, its disagreement with the data, a recording never closed.
  const std::vector<std::string>& warnings() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
