#include "drivers/replay/replay_digitizer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "drivers/replay/replay_plan.hpp"
#include "drivers/replay/sample_file.hpp"

namespace combforce {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t most_block_bytes = 1u << 24;
constexpr double longest_pause_s = 1e8;

std::optional<Channel::ClipCodes> full_scale(SigmfDatatype::Kind kind) {
  if (kind == SigmfDatatype::Kind::i8) return Channel::ClipCodes{-128.0, 127.0};
  if (kind == SigmfDatatype::Kind::u8) return Channel::ClipCodes{0.0, 255.0};
  return std::nullopt;
}

Channels channels_of(const SigmfMeta& meta) {
  Channels channels;
  if (meta.description.channels) {
    channels = *meta.description.channels;
  } else {
    for (std::uint32_t i = 0; i < meta.num_channels; ++i) {
      Channel channel;
      channel.name = i == 0 ? "deflection" : fmt::format("channel{}", i);
      channel.role = i == 0 ? ChannelRole::deflection : ChannelRole::reference;
      channels.push_back(channel);
    }
  }
  for (Channel& channel : channels)
    if (!channel.clip_codes) channel.clip_codes = full_scale(meta.datatype.kind);
  return channels;
}

ReplayOptions checked(ReplayOptions options) {
  if (options.block_frames < 1 || options.block_frames > most_block_frames) {
    throw std::invalid_argument(
        fmt::format("block_frames: {} is outside 1..{}", options.block_frames, most_block_frames));
  }
  return options;
}

// Our recorder writes core:sha512 when it closes; others may never do.
bool never_closed(const SigmfMeta& meta) {
  return !meta.sha512 && meta.rest.is_object() && meta.rest.value("core:recorder", Json()) == "combforce";
}

}  // namespace

class ReplayDigitizer::Impl {
 public:
  Impl(const std::string& recording, ReplayOptions options)
      : options_(checked(options)),
        paths_(sigmf_paths(recording)),
        meta_(read_sigmf_meta(paths_.meta)),
        file_(paths_.data, meta_.datatype, meta_.num_channels, options.verify && meta_.sha512),
        plan_(plan_replay(meta_, file_.frames())),
        warnings_(meta_.warnings) {
    warnings_.insert(warnings_.end(), plan_.warnings.begin(), plan_.warnings.end());
    if (never_closed(meta_))
      warnings_.emplace_back(
          "the recording was not closed: it ends where its recorder was killed, or is still being written; "
          "without core:sha512 its samples are not checked");
    if (file_.trailing_bytes() > 0) {
      warnings_.push_back(
          fmt::format("the last {} bytes of the data are no whole frame: left out", file_.trailing_bytes()));
    }
    info_.sample_rate_hz = meta_.sample_rate_hz;
    info_.format = file_.format();
    info_.channels = channels_of(meta_);
    const std::size_t frame_bytes = meta_.num_channels * sample_bytes(info_.format);
    info_.block_frames = static_cast<std::uint32_t>(
        std::min<std::size_t>(options.block_frames, most_block_bytes / frame_bytes));
    info_.when_full = options.realtime ? WhenFull::drop : WhenFull::wait;
    info_.marks_lines = !meta_.lines.empty();
    info_.is_recording = true;
    info_.name = "replay of " + paths_.meta;
    if (!plan_.runs.empty()) {
      status_.next_sample = plan_.runs.front().first_sample;
      status_.epoch = plan_.runs.front().epoch;
    }
  }

  ~Impl() { stop(); }

  void start(BlockSink& sink) {
    if (sink_ != nullptr) throw std::logic_error("a digitizer runs once: start() was called before");
    sink_ = &sink;
    started_ = Clock::now();
    {
      const std::lock_guard lock(mutex_);
      status_.state = StreamState::running;
    }
    thread_ = std::thread([this] { run(); });
  }

  void stop() {
    if (sink_ == nullptr) return;
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      // The sink need not live longer than the stream.
      if (status_.state == StreamState::running) sink_->stop_waiting();
    }
    stop_asked_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  StreamStatus status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

  const StreamInfo& info() const { return info_; }
  const SigmfMeta& meta() const { return meta_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  void run() {
    StreamState state = StreamState::ended;
    std::string reason = "end of the recording";
    try {
      if (!stream()) {
        reason = "stopped";
      } else if (options_.verify && meta_.sha512) {
        const std::string found = file_.sha512();
        if (found != *meta_.sha512) {
          state = StreamState::failed;
          reason = fmt::format("{}: sha512 is {}, core:sha512 of the metadata is {}", paths_.data, found,
                               *meta_.sha512);
        }
      }
    } catch (const std::exception& error) {
      state = StreamState::failed;
      reason = error.what();
    }
    {
      const std::lock_guard lock(mutex_);
      status_.state = state;
      status_.reason = std::move(reason);
    }
    sink_->close();
  }

  // False: stopped before the end.
  bool stream() {
    SampleBlock block(std::size_t{info_.block_frames} * meta_.num_channels * sample_bytes(info_.format));
    for (const ReplayRun& run : plan_.runs) {
      BlockHeader& header = block.header;
      header.epoch = run.epoch;
      header.epoch_reason = run.epoch_reason;
      header.epoch_first_sample = run.epoch_first_sample;
      header.channels = static_cast<std::uint16_t>(meta_.num_channels);
      header.format = info_.format;
      header.lost_before = run.lost_before;
      const std::uint64_t end = run.first_sample + run.frames;
      for (header.first_sample = run.first_sample; header.first_sample < end;
           header.first_sample += header.frames) {
        take_marks(header, end);
        file_.read(header.frames, block.storage.data());
        if (!pace(header.first_sample + header.frames)) return false;
        const bool delivered = sink_->push(header, block.storage.data());
        if (!delivered && (!options_.realtime || sink_->cancelled())) return false;
        note(header);
        header.lost_before = 0;
      }
    }
    return true;
  }

  // Chooses the length of the block and moves its marks into it; ends it early where it would hold too many.
  void take_marks(BlockHeader& header, std::uint64_t run_end) {
    std::uint64_t end = std::min(header.first_sample + info_.block_frames, run_end);
    const std::size_t overflow = next_mark_ + BlockHeader::max_marks;
    if (overflow < plan_.marks.size() && plan_.marks[overflow].sample > header.first_sample)
      end = std::min(end, plan_.marks[overflow].sample);
    header.frames = static_cast<std::uint32_t>(end - header.first_sample);
    header.mark_count = 0;
    while (next_mark_ < plan_.marks.size() && plan_.marks[next_mark_].sample < end &&
           header.mark_count < BlockHeader::max_marks)
      header.marks.at(header.mark_count++) = plan_.marks[next_mark_++];
  }

  // Until the block's last frame exists, when pacing. False: stopped.
  bool pace(std::uint64_t end_sample) {
    std::unique_lock lock(mutex_);
    if (!options_.realtime) return !stopping_;
    const double seconds =
        static_cast<double>(end_sample - plan_.runs.front().first_sample) / meta_.sample_rate_hz;
    const auto due = started_ + std::chrono::duration_cast<Clock::duration>(
                                    std::chrono::duration<double>(std::min(seconds, longest_pause_s)));
    return !stop_asked_.wait_until(lock, due, [this] { return stopping_; });
  }

  void note(const BlockHeader& header) {
    const std::lock_guard lock(mutex_);
    status_.next_sample = header.first_sample + header.frames;
    status_.epoch = header.epoch;
    status_.lost_frames += header.lost_before;
    const auto streamed = static_cast<double>(status_.next_sample - plan_.runs.front().first_sample);
    const double seconds = std::chrono::duration<double>(Clock::now() - started_).count();
    if (seconds > 0.0) status_.realtime_factor = streamed / meta_.sample_rate_hz / seconds;
  }

  ReplayOptions options_;
  SigmfPaths paths_;
  SigmfMeta meta_;
  SampleFile file_;
  ReplayPlan plan_;
  std::vector<std::string> warnings_;
  StreamInfo info_;
  std::size_t next_mark_ = 0;

  BlockSink* sink_ = nullptr;
  std::thread thread_;
  Clock::time_point started_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable stop_asked_;
  bool stopping_ = false;
  StreamStatus status_;
};

ReplayDigitizer::ReplayDigitizer(const std::string& recording, ReplayOptions options)
    : impl_(std::make_unique<Impl>(recording, options)) {}
ReplayDigitizer::~ReplayDigitizer() = default;
const StreamInfo& ReplayDigitizer::info() const {
  return impl_->info();
}
void ReplayDigitizer::start(BlockSink& sink) {
  impl_->start(sink);
}
void ReplayDigitizer::stop() {
  impl_->stop();
}
StreamStatus ReplayDigitizer::status() const {
  return impl_->status();
}
const SigmfMeta& ReplayDigitizer::meta() const {
  return impl_->meta();
}
const std::vector<std::string>& ReplayDigitizer::warnings() const {
  return impl_->warnings();
}

}  // namespace combforce
