// Writes the stream to disk as SigMF: a thread that drains the recorder ring of a BlockSink.
//
// REC.sigmf-data grows by whole blocks. REC.sigmf-meta is replaced atomically: when a recording starts, at
// most once a second while it runs, and at the end, when core:sha512 is added. After a crash or kill -9 the
// pair still replays, less at most the last second of marks. A gap or a new epoch starts a new capture with
// core:global_index, and replaces the metadata at once: the capture is stated before any sample after it is
// written, so no sample is ever misplaced. Replacing costs time in
// proportion to the lines recorded so far, plus an fsync, on a second thread; for gaps on the writer's own,
// without the fsync.
//
// Disk full or a write error ends the recording with an event `record_failed`; the acquisition goes on. What
// was written until then is closed as well as the disk allows.
//
// Thread rule: start(), stop() from one control thread; note_change() and the rest from any.
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
  std::uint64_t gaps = 0;    // within an epoch
  std::uint64_t lost_frames = 0;
  bool complete = false;  // closed with a sha512, no write failed
  std::string failure;    // why it ended early, for people
};

class Recorder {
 public:
  // `event` is called from the recorder's thread, with kinds record_gap and record_failed.
  Recorder(const StreamInfo& info, BlockSink& sink, std::function<void(const Event&)> event);
  ~Recorder();  // stops
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Starts REC with the next block. Existing files are refused, and what cannot be written:
  // std::runtime_error naming the file. `description` goes to the global object, `truth` (null: none) to
  // afm:truth. std::logic_error while running().
  void start(const std::string& recording, const Description& description, const Json& truth);
  // Writes what the ring still holds, closes and returns the summary, also of a recording that ended by
  // itself since start(). std::logic_error when there is none to stop.
  RecordingSummary stop();
  // False before start(), and once the recording is closed: by stop(), by a failure, by the end of the
  // stream.
  bool running() const;
  RecordingSummary summary() const;  // of the running or the last recording

  // The description in force from `first_sample` on: a contiguous capture that carries what changed, also
  // when the writer is past that sample; before the first recorded sample it goes to the global object.
  // Ignored when none runs.
  void note_change(std::uint64_t first_sample, const Description& description);
  // A line the client marked (lines of the stream come with their blocks). Ignored when none runs.
  void note_line(const LineMark& mark);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
