#include "daemon/pipeline/free_windows.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace combforce {

FreeWindows::~FreeWindows() {
  delete requested_.load();
}

bool FreeWindows::request(std::unique_ptr<FreeCapture> capture) {
  bool idle = false;
  if (!busy_.compare_exchange_strong(idle, true)) return false;
  requested_.store(capture.release());
  return true;
}

bool FreeWindows::wanted() {
  if (capture_ == nullptr) capture_.reset(requested_.exchange(nullptr));
  return capture_ != nullptr;
}

std::uint64_t FreeWindows::consume(AnalysisStage& stage, const SampleBlock& block, std::uint64_t from,
                                   std::uint64_t until, std::uint64_t settled) {
  if (window_ == never) {
    if (settled >= until) return until;
    window_ = std::max(from, settled);
    from = window_;
    stage.extractor.begin(window_, 1);
  }
  from += stage.add(block, from, until);
  if (stage.extractor.missing() > 0) return from;
  const Analysis& analysis = *stage.analysis;
  const std::span tones(tones_.data(), analysis.tip_per_volt.size());
  stage.extractor.finish(tones, means_);
  const double scale = analysis.description.channels->front().scale;
  for (std::size_t i = 0; i < tones.size(); ++i) tones[i] *= scale * analysis.tip_per_volt[i];
  complete_ = capture_->add(window_, tones);
  window_ = from;
  stage.extractor.begin(window_, 1);
  return from;
}

std::unique_ptr<FreeCapture> FreeWindows::end(const char* failure) {
  if (capture_ == nullptr) return nullptr;
  if (failure != nullptr) capture_->fail(failure);
  window_ = never;
  complete_ = false;
  busy_.store(false, std::memory_order_release);
  return std::move(capture_);
}

}  // namespace combforce
