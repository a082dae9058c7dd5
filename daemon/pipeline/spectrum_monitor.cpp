#include "daemon/pipeline/spectrum_monitor.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace combforce {
namespace {

using Clock = std::chrono::steady_clock;

// A bin scatters by 13 %, and a spectrum costs some ten milliseconds.
constexpr std::size_t most_segments = 64;

std::size_t samples_of(std::size_t segments, std::size_t segment) {
  return segment + (segments - 1) * (segment / 2);
}

// nm per volt of channel 0; absent: volts have no one length.
std::optional<double> nm_per_volt(const Description& description) {
  if (!description.cantilever) return description.channels->front().nm_per_v;
  const std::vector<Mode>& modes = description.cantilever->modes;
  const double first = modes.front().sensitivity_nm_per_v;
  const bool shared =
      std::ranges::all_of(modes, [&](const Mode& mode) { return mode.sensitivity_nm_per_v == first; });
  return shared ? std::optional(first) : std::nullopt;
}

}  // namespace

void SpectrumTap::add(const SampleBlock& block) {
  if (state_.load(std::memory_order_acquire) != State::armed) return;
  const BlockHeader& header = block.header;
  if (filled_ > 0 && (header.epoch != epoch_ || header.first_sample != first_sample_ + filled_)) filled_ = 0;
  if (filled_ == 0) {
    first_sample_ = header.first_sample;
    epoch_ = header.epoch;
  }
  const std::size_t count = std::min<std::size_t>(header.frames, wanted_ - filled_);
  float* const to = codes_.data() + filled_;
  const auto copy = [&](auto codes) {
    for (std::size_t i = 0; i < count; ++i) to[i] = static_cast<float>(codes[i * header.channels]);
  };
  if (header.format == SampleFormat::i16)
    copy(block.i16());
  else
    copy(block.f32());
  filled_ += count;
  if (filled_ < wanted_) return;
  State armed = State::armed;
  if (state_.compare_exchange_strong(armed, State::full, std::memory_order_acq_rel)) state_.notify_all();
}

void SpectrumTap::arm(std::size_t samples) {
  wanted_ = std::min(samples, codes_.size());
  filled_ = 0;
  State now = state_.load();
  while (now != State::cancelled && !state_.compare_exchange_weak(now, State::armed)) {
  }
}

bool SpectrumTap::wait_full() {
  state_.wait(State::armed);
  return state_.load(std::memory_order_acquire) == State::full;
}

void SpectrumTap::cancel() {
  state_.store(State::cancelled);
  state_.notify_all();
}

SpectrumMonitor::SpectrumMonitor(const StreamInfo& info, std::size_t segment,
                                 std::function<std::shared_ptr<const Analysis>()> analysis,
                                 std::function<void(const Spectrum&)> publish)
    : sample_rate_hz_(info.sample_rate_hz),
      segment_(segment),
      analysis_(std::move(analysis)),
      publish_(std::move(publish)),
      tap_(samples_of(most_segments, segment)),
      welch_(segment, info.sample_rate_hz),
      thread_([this] { run(); }) {}

SpectrumMonitor::~SpectrumMonitor() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  tap_.cancel();
  thread_.join();
}

void SpectrumMonitor::set_rate(double hz) {
  {
    const std::scoped_lock lock(mutex_);
    hz_ = hz;
  }
  changed_.notify_all();
}

void SpectrumMonitor::run() {
  auto last = Clock::now() - std::chrono::hours(1);
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    if (!(hz_ > 0.0)) {
      changed_.wait(lock);
      continue;
    }
    const auto due =
        last + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / hz_));
    if (Clock::now() < due) {
      changed_.wait_until(lock, due);
      continue;
    }
    last = Clock::now();
    const std::size_t samples = stretch(hz_);
    lock.unlock();
    const auto analysis = analysis_();
    tap_.arm(samples);
    if (tap_.wait_full() && analysis_() == analysis) make(*analysis);
    lock.lock();
  }
}

// As many segments as fit the time between two spectra.
std::size_t SpectrumMonitor::stretch(double hz) const {
  const auto available = static_cast<std::size_t>(sample_rate_hz_ / hz);
  if (available <= segment_) return segment_;
  const std::size_t segments = 1 + (available - segment_) / (segment_ / 2);
  return samples_of(std::min(segments, most_segments), segment_);
}

void SpectrumMonitor::make(const Analysis& analysis) {
  const Channel& channel = analysis.description.channels->front();
  const std::optional<double> nm_per_v = nm_per_volt(analysis.description);
  const double scale = channel.scale * nm_per_v.value_or(1.0);
  const std::span<const float> codes = tap_.codes();
  std::array<double, 4096> part{};
  welch_.reset();
  for (std::size_t first = 0; first < codes.size(); first += part.size()) {
    const std::size_t count = std::min(part.size(), codes.size() - first);
    for (std::size_t i = 0; i < count; ++i) part[i] = scale * static_cast<double>(codes[first + i]);
    welch_.push({part.data(), count});
  }
  publish_({.first_sample = tap_.first_sample(),
            .samples = codes.size(),
            .segments = welch_.segments(),
            .bin_hz = welch_.bin_hz(),
            .unit = nm_per_v ? "nm^2/Hz" : "V^2/Hz",
            .density = welch_.density()});
}

}  // namespace combforce
