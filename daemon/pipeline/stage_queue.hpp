// The analyses that will take over: those known beforehand, by sample, and the latest one asked for.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/pipeline/analysis.hpp"

namespace combforce {

// A stage that takes over at the first pixel boundary at or after `first_sample`.
struct ScheduledStage {
  std::uint64_t first_sample = 0;
  std::unique_ptr<AnalysisStage> stage;
};

// Thread rule: post() by any one control thread at a time, next() by the extraction thread; it neither
// allocates nor locks.
class StageQueue {
 public:
  explicit StageQueue(std::vector<ScheduledStage> scheduled)  // ordered by first_sample
      : scheduled_(std::move(scheduled)) {}
  ~StageQueue() { delete posted_.load(); }
  StageQueue(const StageQueue&) = delete;
  StageQueue& operator=(const StageQueue&) = delete;

  // Replaces a posted stage that has not taken over.
  void post(std::unique_ptr<AnalysisStage> stage) {
    delete posted_.exchange(stage.release(), std::memory_order_acq_rel);
  }

  // The stage that takes over at `boundary`, or null. Scheduled ones come first, in order; one for which
  // `may_begin` is false keeps those behind it waiting. Call until null.
  template <typename MayBegin>
  std::unique_ptr<AnalysisStage> next(std::uint64_t boundary, MayBegin may_begin) {
    if (next_ < scheduled_.size() && scheduled_[next_].first_sample <= boundary &&
        may_begin(*scheduled_[next_].stage))
      return std::move(scheduled_[next_++].stage);
    if (waiting_ == nullptr) waiting_.reset(posted_.exchange(nullptr, std::memory_order_acq_rel));
    if (waiting_ == nullptr || !may_begin(*waiting_)) return nullptr;
    return std::move(waiting_);
  }

 private:
  std::vector<ScheduledStage> scheduled_;
  std::size_t next_ = 0;
  std::atomic<AnalysisStage*> posted_{nullptr};
  std::unique_ptr<AnalysisStage> waiting_;  // taken from posted_, waits for the end of the line
};

}  // namespace combforce
