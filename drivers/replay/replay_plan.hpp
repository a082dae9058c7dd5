// What a recording's metadata and the length of its data make of the stream: where its frames belong, and
// which marks travel with them. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dsp/sample_block.hpp"
#include "proto/sigmf.hpp"

namespace combforce {

// The next `frames` frames of the file are the stream's from first_sample on, without a break.
struct ReplayRun {
  std::uint64_t frames = 0;  // > 0
  std::uint64_t first_sample = 0;
  std::uint64_t lost_before = 0;  // since the run before it, in the same epoch
  std::uint32_t epoch = 0;
  EpochReason epoch_reason = EpochReason::start;
  std::uint64_t epoch_first_sample = 0;

  bool operator==(const ReplayRun&) const = default;
};

struct ReplayPlan {
  std::vector<ReplayRun> runs;        // in order
  std::vector<StreamMark> marks;      // ordered by sample; none at or past the end of the stream
  std::vector<std::string> warnings;  // data and metadata disagree about the length
};

// `data_frames`: whole frames in the data file. Frames beyond what the metadata describes belong to the last
// capture: a crash leaves the metadata up to a second behind. Order and indices are as read_sigmf_meta()
// checks them.
ReplayPlan plan_replay(const SigmfMeta& meta, std::uint64_t data_frames);

}  // namespace combforce
