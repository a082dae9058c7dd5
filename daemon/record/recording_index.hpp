// What a recording's metadata must say: where each stretch of the file belongs in the stream, the lines,
// steps and changes of description in it. Pure bookkeeping, no files, no threads; a copy is a snapshot.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/digitizer.hpp"
#include "proto/description.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

using UtcTime = std::chrono::system_clock::time_point;

class RecordingIndex {
 public:
  RecordingIndex(const StreamInfo& info, Description description, Json truth);

  // Takes note of a block about to be written, with its marks. `utc` is the wall clock at its first frame.
  // True: it does not continue the file (the first block, a gap, a new epoch), and a capture has been added
  // for it. Requires header.first_sample >= end_sample().
  bool begin_block(const BlockHeader& header, UtcTime utc);
  void end_block();      // its frames are in the file
  void abandon_block();  // they are not, and never will be

  void add_line(const LineMark& mark);
  // The whole description in force from `first_sample` on.
  void add_change(std::uint64_t first_sample, const Description& description);

  std::uint64_t first_sample() const { return segments_.empty() ? 0 : segments_.front().first_sample; }
  std::uint64_t end_sample() const;  // one past the last frame in the file; 0 before the first block
  std::uint64_t frames() const { return frames_; }  // in the file
  std::uint64_t gaps() const { return gaps_; }      // within an epoch
  std::uint64_t lost_frames() const { return lost_frames_; }

  // All of it but the hash. Lines and changes past the end of the file are left out, what lies before its
  // beginning is taken into the global object (changes) or cut (lines).
  SigmfMeta meta() const;

 private:
  struct Segment {  // up to the next one's file_first, or to the end
    std::uint64_t file_first, first_sample;
    std::uint32_t epoch;
    EpochReason epoch_reason;
    std::uint64_t epoch_first_sample;
    UtcTime utc;
  };
  struct Change {
    std::uint64_t first_sample;
    Description description;
  };
  std::uint64_t file_position(std::uint64_t sample) const;
  SigmfCapture capture_at(std::uint64_t file_frame) const;
  void encode_changes(SigmfMeta& meta) const;
  void encode_marks(SigmfMeta& meta) const;

  SigmfMeta head_;
  std::vector<Segment> segments_;
  std::vector<LineMark> lines_;    // ordered by first_sample
  std::vector<StreamMark> marks_;  // steps and ends of scans
  std::vector<Change> changes_;    // ordered by first_sample
  std::uint64_t frames_ = 0, pending_frames_ = 0, gaps_ = 0, lost_frames_ = 0;
};

}  // namespace combforce
