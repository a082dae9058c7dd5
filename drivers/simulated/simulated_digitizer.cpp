#include "drivers/simulated/simulated_digitizer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "dsp/pixel_clock.hpp"

namespace combforce {

namespace {

using Clock = std::chrono::steady_clock;

// Between two looks at whether to stop.
constexpr std::uint32_t stretch_frames = 1024;
// Marks of a lost stretch that the next block takes; the block's own need room, too.
constexpr std::size_t carried_marks = 12;

struct ScanRequest {
  ScanLayout layout;
  std::uint32_t frames = 0;
  SceneMaps scene;
};

}  // namespace

class SimulatedDigitizer::Impl {
 public:
  explicit Impl(const SimulationSettings& settings)
      : settings_(settings), source_(settings), drive_(settings.drive) {
    info_.sample_rate_hz = settings.sample_rate_hz;
    info_.channels = simulated_channels(settings);
    info_.block_frames = settings.block_frames;
    info_.when_full = settings.paced ? WhenFull::drop : WhenFull::wait;
    info_.marks_lines = info_.has_scanner = info_.has_drive = true;
    info_.name = "simulated";
    source_.truth = [this](const PixelTruth& truth) { report(truth); };
  }
  ~Impl() { stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  const StreamInfo& info() const { return info_; }
  const ModelInfo& model() const { return source_.model(); }

  void start(BlockSink& sink) {
    const std::scoped_lock lock(mutex_);
    if (status_.state != StreamState::idle) throw std::logic_error("simulated digitizer: started before");
    status_.state = StreamState::running;
    sink_ = &sink;
    thread_ = std::thread([this] { run(); });
  }

  void stop() {
    {
      const std::scoped_lock lock(mutex_);
      stopping_ = true;
      changed_.notify_all();
      if (status_.state == StreamState::idle) status_.state = StreamState::ended;
      // The sink need not live longer than the stream.
      if (status_.state == StreamState::running) sink_->stop_waiting();
    }
    if (thread_.joinable()) thread_.join();
  }

  StreamStatus status() const {
    const std::scoped_lock lock(mutex_);
    return status_;
  }

  void prepare_scan(const ScanLayout& layout) {
    validate(layout, settings_.comb.window_samples);
    prepared_ = ScanRequest{layout, 0, make_scene(settings_.scene, model(), layout)};
  }

  void start_scan(const ScanLayout& layout, std::uint32_t frames) {
    if (!prepared_ || prepared_->layout != layout) prepare_scan(layout);
    ScanRequest request = *std::exchange(prepared_, std::nullopt);
    request.frames = frames;
    const std::scoped_lock lock(mutex_);
    if (status_.scanning) throw std::logic_error("simulated digitizer: a scan is running");
    status_.scanning = true;
    scan_from_ =
        status_.state == StreamState::idle
            ? static_cast<std::uint64_t>(std::llround(settings_.free_seconds * settings_.sample_rate_hz))
            : 0;
    stop_scan_ = false;
    scan_ = std::move(request);
  }

  void stop_scan() {
    const std::scoped_lock lock(mutex_);
    if (scan_) {
      scan_.reset();
      status_.scanning = false;
    } else {
      stop_scan_ = status_.scanning;
    }
  }

  void set_drive(const Drive& drive) {
    SimulationSettings changed = settings_;
    changed.drive = drive;
    validate(changed);
    const std::scoped_lock lock(mutex_);
    drive_ = drive;
    drive_changed_ = true;
  }

  Drive drive() const {
    const std::scoped_lock lock(mutex_);
    return drive_;
  }

  void set_truth_sink(std::function<void(const PixelTruth&)> sink) {
    const std::scoped_lock lock(truth_mutex_);
    truth_ = std::move(sink);
  }

 private:
  void run() {
    started_ = Clock::now();
    bool scanned = false;
    bool over = false;
    while (!over && !stopping()) {
      over = settings_.ends_with_scan && scanned && !source_.scanning();
      take_commands();
      begin_faults();
      produce_block();
      scanned = scanned || source_.scanning();
    }
    {
      const std::scoped_lock lock(mutex_);
      status_.state = StreamState::ended;
      status_.reason = over ? "the scan is over" : "stopped";
      status_.scanning = false;
    }
    sink_->close();
  }

  bool stopping() const {
    const std::scoped_lock lock(mutex_);
    return stopping_;
  }

  void take_commands() {
    const std::scoped_lock lock(mutex_);
    if (std::exchange(drive_changed_, false)) source_.set_drive(drive_);
    if (std::exchange(stop_scan_, false)) source_.stop_scan();
    if (scan_ && source_.next_sample() >= scan_from_) {
      ScanRequest request = *std::exchange(scan_, std::nullopt);
      source_.start_scan(request.layout, request.frames, std::move(request.scene));
    }
  }

  // Steps over faults that are over and acts on those that begin here.
  void begin_faults() {
    using Kind = FaultSettings::Kind;
    lost_until_ = 0;
    for (; next_fault_ < settings_.faults.size(); ++next_fault_) {
      const FaultSettings& fault = settings_.faults[next_fault_];
      if (fault.sample > source_.next_sample()) return;
      if (fault.kind == Kind::stall) {
        sleep_until(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(fault.duration_s)));
      } else if (fault.kind == Kind::detuned) {
        source_.detune(1e-6 * fault.detuning_ppm);
      } else if (fault.kind != Kind::clipped && fault.sample + fault.frames > source_.next_sample()) {
        lost_until_ = fault.sample + fault.frames;
        return;
      }
    }
  }

  // Faults, and a scan that was asked for, begin with a block.
  std::uint64_t block_end() const {
    std::uint64_t end = source_.next_sample() + settings_.block_frames;
    {
      const std::scoped_lock lock(mutex_);
      if (scan_ && scan_from_ > source_.next_sample()) end = std::min(end, scan_from_);
    }
    if (lost_until_ > 0) return std::min(end, lost_until_);
    for (std::size_t i = next_fault_; i < settings_.faults.size(); ++i) {
      if (settings_.faults[i].kind == FaultSettings::Kind::clipped) continue;
      end = std::min(end, settings_.faults[i].sample);
      break;
    }
    return end;
  }

  void produce_block() {
    const bool lost = lost_until_ > 0;
    BlockHeader header;
    header.first_sample = source_.next_sample();
    header.channels = static_cast<std::uint16_t>(info_.channels.size());
    std::uint64_t end = block_end();
    if (!lost) {
      const std::size_t carried = std::min(marks_.size(), carried_marks);
      std::copy_n(marks_.begin(), carried, header.marks.begin());
      header.mark_count = static_cast<std::uint32_t>(carried);
      marks_.erase(marks_.begin(), marks_.begin() + static_cast<std::ptrdiff_t>(carried));
      if (!marks_.empty()) end = header.first_sample + 1;  // the rest comes with the blocks after it
    }
    codes_.clear();
    while (source_.next_sample() < end) {
      if (stopping()) return;
      const std::uint64_t before = source_.next_sample();
      const auto frames = static_cast<std::uint32_t>(std::min<std::uint64_t>(stretch_frames, end - before));
      source_.append(frames, header, codes_);
      if (source_.next_sample() == before) break;  // no room for another mark
    }
    if (lost) {
      lose(header);
    } else if (!deliver(header)) {
      return;
    }
    note_progress(header, lost);
  }

  void lose(const BlockHeader& header) {
    const auto marks = header.valid_marks();
    if (settings_.faults[next_fault_].kind == FaultSettings::Kind::lost_block) {
      marks_.insert(marks_.end(), marks.begin(), marks.end());
      lost_before_ += header.frames;
      known_lost_ += header.frames;
      return;
    }
    // Where a line began is lost, too; that a scan ended or a step was made is not.
    for (StreamMark mark : marks) {
      mark.sample = lost_until_;
      if (mark.kind != StreamMark::Kind::line) marks_.push_back(mark);
    }
    unknown_lost_ += header.frames;
    if (source_.next_sample() == lost_until_) {
      ++epoch_;
      epoch_first_sample_ = lost_until_ - unknown_lost_;
      lost_before_ = 0;
    }
  }

  // False: stopped before the block was out.
  bool deliver(BlockHeader& header) {
    header.epoch = epoch_;
    header.epoch_reason = epoch_ == 0 ? EpochReason::start : EpochReason::unknown_loss;
    header.epoch_first_sample = epoch_first_sample_;
    header.lost_before = std::exchange(lost_before_, 0);
    header.first_sample -= unknown_lost_;
    for (std::uint32_t i = 0; i < header.mark_count; ++i) {
      header.marks[i].sample -= unknown_lost_;
      if (header.marks[i].kind == StreamMark::Kind::line) header.marks[i].line.first_sample -= unknown_lost_;
    }
    if (settings_.paced) {
      const double due_s = static_cast<double>(source_.next_sample()) / settings_.sample_rate_hz;
      sleep_until(started_ +
                  std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(due_s)));
      if (stopping()) return false;
    }
    return sink_->push(header, codes_.data()) || settings_.paced;
  }

  void note_progress(const BlockHeader& header, bool lost) {
    const double elapsed_s = std::chrono::duration<double>(Clock::now() - started_).count();
    const std::scoped_lock lock(mutex_);
    status_.scanning = scan_.has_value() || source_.scanning();
    status_.epoch = epoch_;
    status_.realtime_factor =
        static_cast<double>(source_.next_sample()) / settings_.sample_rate_hz / std::max(elapsed_s, 1e-9);
    status_.lost_frames = known_lost_;
    if (!lost) status_.next_sample = header.first_sample + header.frames;
  }

  void report(PixelTruth truth) {
    truth.first_sample -= std::min(unknown_lost_, truth.first_sample);
    const std::scoped_lock lock(truth_mutex_);
    if (truth_) truth_(truth);
  }

  void sleep_until(Clock::time_point time) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, time, [this] { return stopping_; });
  }

  const SimulationSettings settings_;
  StreamInfo info_;

  std::optional<ScanRequest> prepared_;  // the control thread's

  // The digitizer's thread alone, once it runs.
  SampleSource source_;
  BlockSink* sink_ = nullptr;
  Clock::time_point started_;
  std::vector<std::int16_t> codes_;
  std::vector<StreamMark> marks_;  // of lost stretches, by true sample
  std::size_t next_fault_ = 0;
  std::uint64_t lost_until_ = 0;  // 0: nothing is being lost
  std::uint64_t lost_before_ = 0;
  std::uint64_t known_lost_ = 0;
  std::uint64_t unknown_lost_ = 0;  // true sample - stream index
  std::uint32_t epoch_ = 0;
  std::uint64_t epoch_first_sample_ = 0;

  mutable std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  bool stopping_ = false;
  StreamStatus status_;
  std::optional<ScanRequest> scan_;  // asked for, not begun
  std::uint64_t scan_from_ = 0;
  bool stop_scan_ = false;
  Drive drive_;
  bool drive_changed_ = false;

  std::mutex truth_mutex_;
  std::function<void(const PixelTruth&)> truth_;

  std::thread thread_;
};

SimulatedDigitizer::SimulatedDigitizer(const SimulationSettings& settings)
    : impl_(std::make_unique<Impl>(settings)) {}

SimulatedDigitizer::~SimulatedDigitizer() = default;

const StreamInfo& SimulatedDigitizer::info() const {
  return impl_->info();
}

void SimulatedDigitizer::start(BlockSink& sink) {
  impl_->start(sink);
}

void SimulatedDigitizer::stop() {
  impl_->stop();
}

StreamStatus SimulatedDigitizer::status() const {
  return impl_->status();
}

void SimulatedDigitizer::prepare_scan(const ScanLayout& layout) {
  impl_->prepare_scan(layout);
}

void SimulatedDigitizer::start_scan(const ScanLayout& layout, std::uint32_t frames) {
  impl_->start_scan(layout, frames);
}

void SimulatedDigitizer::stop_scan() {
  impl_->stop_scan();
}

void SimulatedDigitizer::set_drive(const Drive& drive) {
  impl_->set_drive(drive);
}

Drive SimulatedDigitizer::drive() const {
  return impl_->drive();
}

const ModelInfo& SimulatedDigitizer::model() const {
  return impl_->model();
}

void SimulatedDigitizer::set_truth_sink(std::function<void(const PixelTruth&)> sink) {
  impl_->set_truth_sink(std::move(sink));
}

}  // namespace combforce
