#include "drivers/block_sink.hpp"

#include <algorithm>
#include <cstring>

namespace combforce {

namespace {

void bump(std::atomic<std::uint32_t>& counter) {
  counter.fetch_add(1);
  counter.notify_all();
}

template <typename Predicate>
void wait_until(std::atomic<std::uint32_t>& counter, Predicate done) {
  for (;;) {
    const std::uint32_t seen = counter.load();
    if (done()) return;
    counter.wait(seen);
  }
}

}  // namespace

BlockSink::Seam::Seam(std::size_t slots, std::size_t block_bytes) : ring(slots, SampleBlock(block_bytes)) {
  marks.reserve(carried_marks);
}

BlockSink::BlockSink(std::size_t slots, std::size_t block_bytes, WhenFull when_full)
    : when_full_(when_full), extraction_(slots, block_bytes), recorder_(slots, block_bytes) {}

bool BlockSink::push(const BlockHeader& header, const void* samples) {
  const bool delivered = push_to(extraction_, header, samples);
  if (!delivered && waiting_ended_.load() && when_full_ == WhenFull::wait) return false;
  if (recording_.load()) {
    if (recording_restarted_.exchange(false)) {
      recorder_.lost = 0;
      recorder_.epoch = header.epoch;
      recorder_.marks.clear();
      BlockHeader first = header;
      first.lost_before = 0;
      push_to(recorder_, first, samples);
    } else {
      push_to(recorder_, header, samples);
    }
  }
  next_sample_.store(header.first_sample + header.frames);
  return delivered;
}

bool BlockSink::push_to(Seam& seam, const BlockHeader& header, const void* samples) {
  if (header.epoch != seam.epoch) {
    seam.epoch = header.epoch;
    seam.lost = 0;
  }
  const auto own = header.valid_marks();
  const std::size_t kept = std::min(own.size(), carried_marks - seam.marks.size());
  seam.marks.insert(seam.marks.end(), own.begin(), own.begin() + static_cast<std::ptrdiff_t>(kept));
  if (kept < own.size()) seam.lost_marks.fetch_add(own.size() - kept);
  seam.lost += header.lost_before;

  SampleBlock* const slot = acquire(seam, header.bytes());
  if (slot == nullptr) {
    seam.lost += header.frames;
    seam.dropped.fetch_add(header.frames);
    return false;
  }
  slot->header = header;
  slot->header.lost_before = seam.lost;
  const std::size_t count = std::min(seam.marks.size(), BlockHeader::max_marks);
  const auto carried_end = seam.marks.begin() + static_cast<std::ptrdiff_t>(count);
  std::copy(seam.marks.begin(), carried_end, slot->header.marks.begin());
  slot->header.mark_count = static_cast<std::uint32_t>(count);
  seam.marks.erase(seam.marks.begin(), carried_end);
  seam.lost = 0;
  if (header.bytes() > 0) std::memcpy(slot->storage.data(), samples, header.bytes());
  seam.ring.publish();
  bump(seam.filled);
  return true;
}

SampleBlock* BlockSink::acquire(Seam& seam, std::size_t bytes) {
  if (cancelled_.load()) return nullptr;
  SampleBlock* slot = seam.ring.acquire();
  if (slot == nullptr && when_full_ == WhenFull::wait) {
    wait_until(room_, [&] {
      slot = seam.ring.acquire();
      return slot != nullptr || !may_wait_for(seam);
    });
  }
  return slot != nullptr && bytes <= slot->storage.size() ? slot : nullptr;
}

bool BlockSink::may_wait_for(const Seam& seam) const {
  return !cancelled_.load() && !waiting_ended_.load() && (&seam == &extraction_ || recording_.load());
}

void BlockSink::wait_extraction() {
  wait_until(extraction_.filled,
             [&] { return extraction_.ring.filled() > 0 || closed_.load() || cancelled_.load(); });
}

void BlockSink::wait_recorder() {
  wait_until(recorder_.filled, [&] {
    return recorder_.ring.filled() > 0 || closed_.load() || cancelled_.load() || !recording_.load();
  });
}

void BlockSink::released() {
  bump(room_);
}

void BlockSink::start_recording() {
  recording_restarted_.store(true);
  recording_.store(true);
}

void BlockSink::stop_recording() {
  recording_.store(false);
  bump(recorder_.filled);
  bump(room_);
}

void BlockSink::close() {
  for (Seam* seam : {&extraction_, &recorder_}) {
    seam->lost_marks.fetch_add(seam->marks.size());
    seam->marks.clear();
  }
  closed_.store(true);
  bump(extraction_.filled);
  bump(recorder_.filled);
}

void BlockSink::stop_waiting() {
  waiting_ended_.store(true);
  bump(room_);
}

void BlockSink::cancel() {
  cancelled_.store(true);
  bump(extraction_.filled);
  bump(recorder_.filled);
  bump(room_);
}

}  // namespace combforce
