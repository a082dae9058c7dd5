#include "daemon/pipeline/fit_pool.hpp"

#include <algorithm>

namespace combforce {

FitPool::FitPool(unsigned workers, OutputSlots& slots) : slots_(slots) {
  for (unsigned i = 0; i < workers; ++i) workers_.push_back(std::make_unique<Worker>());
  for (unsigned i = 0; i < workers; ++i) workers_[i]->thread = std::thread([this, i] { work(i); });
}

FitPool::~FitPool() {
  ending_.store(true);
  for (auto& worker : workers_) {
    worker->offered.fetch_add(1);
    worker->offered.notify_one();
  }
  for (auto& worker : workers_) worker->thread.join();
}

bool FitPool::offer(std::uint32_t slot) {
  taken_seen_ = taken_.load();
  auto least = std::ranges::max_element(workers_, [](const auto& a, const auto& b) {
    return a->queue.write_available() < b->queue.write_available();
  });
  Worker& worker = **least;
  if (!worker.queue.push(slot)) return false;
  worker.offered.fetch_add(1);
  worker.offered.notify_one();
  return true;
}

void FitPool::wait_room() {
  taken_.wait(taken_seen_);
}

void FitPool::work(unsigned index) {
  Worker& worker = *workers_[index];
  for (;;) {
    const std::uint32_t seen = worker.offered.load();
    std::uint32_t slot_index = 0;
    while (worker.queue.pop(slot_index)) {
      taken_.fetch_add(1);
      taken_.notify_one();
      OutputSlot& slot = slots_.at(slot_index);
      slot.stage->fitters[index].fit(slot.tones(), slot.fit, slot.pixel.span.analysis_first);
      slots_.complete(slot_index);
    }
    if (ending_.load()) {
      if (worker.queue.read_available() == 0) return;
      continue;
    }
    worker.offered.wait(seen);
  }
}

}  // namespace combforce
