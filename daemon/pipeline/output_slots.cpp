#include "daemon/pipeline/output_slots.hpp"

namespace combforce {

OutputSlots::OutputSlots(std::size_t slots, std::size_t max_tones, std::size_t channels)
    : entries_(std::make_unique<Entry[]>(slots)), size_(slots) {
  for (std::size_t i = 0; i < slots; ++i) {
    entries_[i].slot.pixel.phasors.resize(max_tones);
    entries_[i].slot.tip_nm.resize(max_tones);
    entries_[i].slot.pixel.channel_means.resize(channels);
  }
}

OutputSlot* OutputSlots::acquire() {
  Entry& entry = entries_[head_];
  return entry.state.load(std::memory_order_acquire) == State::empty ? &entry.slot : nullptr;
}

std::uint32_t OutputSlots::commit_pending() {
  const auto index = static_cast<std::uint32_t>(head_);
  entries_[head_].state.store(State::pending, std::memory_order_release);
  head_ = (head_ + 1) % size_;
  return index;
}

void OutputSlots::commit_complete() {
  complete(commit_pending());
}

void OutputSlots::complete(std::uint32_t index) {
  entries_[index].state.store(State::complete, std::memory_order_release);
  entries_[index].state.notify_all();
}

OutputSlot* OutputSlots::front() {
  Entry& entry = entries_[tail_];
  return entry.state.load(std::memory_order_acquire) == State::complete ? &entry.slot : nullptr;
}

void OutputSlots::retire() {
  Entry& entry = entries_[tail_];
  tail_ = (tail_ + 1) % size_;
  entry.state.store(State::empty, std::memory_order_release);
  entry.state.notify_all();
}

void OutputSlots::wait_front() {
  auto& state = entries_[tail_].state;
  for (State now = state.load(std::memory_order_acquire); now != State::complete;
       now = state.load(std::memory_order_acquire))
    state.wait(now, std::memory_order_acquire);
}

void OutputSlots::wait_room() {
  wait_empty(head_);
}

void OutputSlots::wait_retired() {
  wait_empty((head_ + size_ - 1) % size_);
}

void OutputSlots::wait_empty(std::size_t index) {
  auto& state = entries_[index].state;
  for (State now = state.load(std::memory_order_acquire); now != State::empty;
       now = state.load(std::memory_order_acquire))
    state.wait(now, std::memory_order_acquire);
}

}  // namespace combforce
