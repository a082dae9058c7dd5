// Writes the stream to disk as SigMF: a thread that drains the recorder ring of a BlockSink.
//
// REC.sigmf-data grows by whole blocks; REC.sigmf-meta is replaced atomically (write, fsync, rename) at most
// once a second and at the end, when core:sha512 is added: after a crash or kill -9 the pair still replays,
// less at most the last second of marks. A gap starts a new capture with core:global_index. Disk full or a
// write error ends the recording with an event; the acquisition goes on.
//
// Thread rule: start(), stop() from one control thread; note_change() from the output thread; the rest from
// any.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/pipeline/pipeline.hpp"
#include "drivers/block_sink.hpp"
#include "drivers/digitizer.hpp"
#include "proto/description.hpp"
#include "proto/json.hpp"

namespace combforce {

struct RecordingSummary {
  std::string meta_path;
  std::uint64_t first_sample = 0;
  std::uint64_t frames = 0;  // written
  std::uint64_t gaps = 0;
  std::uint64_t lost_frames = 0;
  bool complete = false;  // closed with a sha512, no write failed
  std::string failure;    // why it ended early, for people
};

class Recorder {
 public:
  // `event` is called from the recorder's thread.
  Recorder(const StreamInfo& info, BlockSink& sink, std::function<void(const Event&)> event);
  ~Recorder();  // stops
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Starts REC (existing files are refused: std::runtime_error naming the file). `description` goes to the
  // global object, `truth` (null: none) to afm:truth.
  void start(const std::string& recording, const Description& description, const Json& truth);
  // Writes what the ring still holds, closes and returns the summary. Without a running recording:
  // std::logic_error.
  RecordingSummary stop();
  bool running() const;
  RecordingSummary summary() const;  // so far

  // The description in force from `first_sample` on: a contiguous capture that carries what changed.
  void note_change(std::uint64_t first_sample, const Description& description);
  // A line the client marked (lines of the stream come with their blocks).
  void note_line(const LineMark& mark);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
