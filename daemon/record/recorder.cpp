#include "daemon/record/recorder.hpp"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/record/recording_file.hpp"
#include "daemon/record/recording_index.hpp"

namespace combforce {

namespace {

using Durability = RecordingFile::Durability;

constexpr auto meta_period = std::chrono::seconds(1);

// One recording from start to close: the files, what the metadata will say, and the two threads.
class Recording {
 public:
  Recording(const StreamInfo& info, BlockSink& sink, const std::function<void(const Event&)>& event,
            const std::string& name, const Description& description, const Json& truth)
      : sample_rate_hz_(info.sample_rate_hz),
        sink_(sink),
        event_(event),
        file_(sigmf_paths(name)),
        index_(info, description, truth) {
    file_.replace_meta(index_.meta(), ++version_, Durability::process);
    drain_ring([](const SampleBlock&) {});  // what a recording before this one left
    sink_.start_recording();
    meta_keeper_ = std::thread([this] { keep_meta(); });
    writer_ = std::thread([this] { write(); });  // joins the other
  }

  ~Recording() { stop(); }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  void stop() {
    sink_.stop_recording();
    if (writer_.joinable()) writer_.join();
  }

  bool closed() const { return closed_.load(); }

  RecordingSummary summary() const {
    const std::lock_guard lock(mutex_);
    return summary_locked();
  }

  void note_change(std::uint64_t first_sample, const Description& description) {
    const std::lock_guard lock(mutex_);
    index_.add_change(first_sample, description);
    meta_stale_ = true;
  }

  void note_line(const LineMark& mark) {
    const std::lock_guard lock(mutex_);
    index_.add_line(mark);
    meta_stale_ = true;
  }

 private:
  template <typename Use>
  void drain_ring(Use use) {
    while (const SampleBlock* block = sink_.recorder().front()) {
      use(*block);
      sink_.recorder().release();
      sink_.released();
    }
  }

  void write() {
    for (bool last = false; !last;) {
      sink_.wait_recorder();
      last = sink_.closed() || sink_.cancelled() || !sink_.recording();
      drain_ring([this](const SampleBlock& block) {
        if (!failed()) write_block(block);
      });
    }
    close();
  }

  void write_block(const SampleBlock& block) {
    const BlockHeader& header = block.header;
    const std::chrono::duration<double> duration(header.frames / sample_rate_hz_);
    const UtcTime utc =
        std::chrono::system_clock::now() - std::chrono::duration_cast<UtcTime::duration>(duration);
    try {
      if (begin_block(header, utc)) replace_meta(Durability::process);
      file_.append(block.storage.data(), header.bytes());
      const std::lock_guard lock(mutex_);
      index_.end_block();
      meta_stale_ = true;
    } catch (const std::exception& error) {
      fail(error.what());
    }
  }

  // True: the metadata must say so before the block is written.
  bool begin_block(const BlockHeader& header, UtcTime utc) {
    std::unique_lock lock(mutex_);
    const std::uint64_t end = index_.end_sample(), gaps = index_.gaps();
    if (header.first_sample < end) {
      throw std::runtime_error(
          fmt::format("the stream index runs backwards, from {} to {}", end, header.first_sample));
    }
    const bool new_capture = index_.begin_block(header, utc);
    const bool gap = index_.gaps() > gaps;
    lock.unlock();
    const std::uint64_t lost = header.first_sample - end;
    if (gap) report({"record_gap", end, lost, fmt::format("{} frames are missing in the recording", lost)});
    return new_capture;
  }

  RecordingSummary summary_locked() const {
    return {file_.paths().meta,
            index_.first_sample(),
            index_.frames(),
            index_.gaps(),
            index_.lost_frames(),
            complete_,
            failure_};
  }

  void replace_meta(Durability durability, std::optional<std::string> sha512 = {}) {
    std::unique_lock lock(mutex_);
    const RecordingIndex snapshot = index_;
    const std::uint64_t version = ++version_;
    meta_stale_ = false;
    lock.unlock();
    if (durability == Durability::power) file_.sync();  // metadata never speaks of samples that are not there
    SigmfMeta meta = snapshot.meta();
    meta.sha512 = std::move(sha512);
    file_.replace_meta(meta, version, durability);
  }

  void keep_meta() {
    std::unique_lock lock(mutex_);
    while (!writer_done_.wait_for(lock, meta_period, [this] { return closing_; })) {
      if (!meta_stale_ || !failure_.empty()) continue;
      lock.unlock();
      try {
        replace_meta(Durability::power);
      } catch (const std::exception& error) {
        fail(error.what());
      }
      lock.lock();
    }
  }

  bool failed() const {
    const std::lock_guard lock(mutex_);
    return !failure_.empty();
  }

  void fail(const std::string& why) {
    {
      const std::lock_guard lock(mutex_);
      if (failure_.empty()) failure_ = why;
    }
    file_.release_reserve();
    sink_.stop_recording();
  }

  void close() {
    sink_.stop_recording();
    {
      const std::lock_guard lock(mutex_);
      index_.abandon_block();
      closing_ = true;
    }
    writer_done_.notify_all();
    meta_keeper_.join();
    try {
      replace_meta(Durability::power, file_.sha512());
    } catch (const std::exception& error) {
      fail(error.what());
    }
    const RecordingSummary closed = [this] {
      const std::lock_guard lock(mutex_);
      complete_ = failure_.empty();
      return summary_locked();
    }();
    if (!closed.complete) report({"record_failed", closed.first_sample, 0, closed.failure});
    closed_.store(true);
  }

  void report(const Event& event) const {
    if (event_) event_(event);
  }

  const double sample_rate_hz_;
  BlockSink& sink_;
  const std::function<void(const Event&)>& event_;
  RecordingFile file_;
  std::thread writer_, meta_keeper_;
  std::atomic<bool> closed_{false};
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable writer_done_;
  RecordingIndex index_;
  std::uint64_t version_ = 0;  // of the snapshots of index_
  bool meta_stale_ = false, closing_ = false, complete_ = false;
  std::string failure_;
};

}  // namespace

class Recorder::Impl {
 public:
  Impl(StreamInfo info, BlockSink& sink, std::function<void(const Event&)> event)
      : info_(std::move(info)), sink_(sink), event_(std::move(event)) {}

  void start(const std::string& name, const Description& description, const Json& truth) {
    if (running()) throw std::logic_error("a recording is running");
    const std::lock_guard lock(mutex_);
    if (recording_ != nullptr) last_ = recording_->summary();
    recording_.reset();
    recording_ = std::make_shared<Recording>(info_, sink_, event_, name, description, truth);
  }

  RecordingSummary stop() {
    const std::shared_ptr<Recording> recording = current();
    if (recording == nullptr) throw std::logic_error("no recording to stop");
    recording->stop();
    const std::lock_guard lock(mutex_);
    last_ = recording->summary();
    recording_.reset();
    return last_;
  }

  bool running() const {
    const std::shared_ptr<Recording> recording = current();
    return recording != nullptr && !recording->closed();
  }

  RecordingSummary summary() const {
    const std::lock_guard lock(mutex_);
    return recording_ != nullptr ? recording_->summary() : last_;
  }

  std::shared_ptr<Recording> current() const {
    const std::lock_guard lock(mutex_);
    return recording_;
  }

 private:
  const StreamInfo info_;
  BlockSink& sink_;
  const std::function<void(const Event&)> event_;
  mutable std::mutex mutex_;  // guards what follows
  std::shared_ptr<Recording> recording_;
  RecordingSummary last_;
};

Recorder::Recorder(const StreamInfo& info, BlockSink& sink, std::function<void(const Event&)> event)
    : impl_(std::make_unique<Impl>(info, sink, std::move(event))) {}
Recorder::~Recorder() = default;

void Recorder::start(const std::string& recording, const Description& description, const Json& truth) {
  impl_->start(recording, description, truth);
}
RecordingSummary Recorder::stop() {
  return impl_->stop();
}
bool Recorder::running() const {
  return impl_->running();
}
RecordingSummary Recorder::summary() const {
  return impl_->summary();
}

void Recorder::note_change(std::uint64_t first_sample, const Description& description) {
  if (const auto recording = impl_->current()) recording->note_change(first_sample, description);
}

void Recorder::note_line(const LineMark& mark) {
  if (const auto recording = impl_->current()) recording->note_line(mark);
}

}  // namespace combforce
