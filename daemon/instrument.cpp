#include "daemon/instrument.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "daemon/pipeline/drift.hpp"
#include "daemon/record/truth_writer.hpp"
#include "daemon/recorded_description.hpp"
#include "drivers/replay/replay_digitizer.hpp"
#include "drivers/simulated/simulated_digitizer.hpp"
#include "proto/sigmf.hpp"

namespace combforce {
namespace {

constexpr std::size_t most_ring_bytes = std::size_t{1} << 30;  // each of the two
// Whoever stops the daemon waits for this; what is left then can be replayed if it was recorded. Enough for a
// pixel in each block of a full default ring at 0.3 s a fit on two workers.
constexpr std::chrono::seconds most_drain{10};

using WallClock = std::chrono::system_clock;

std::string iso8601(WallClock::time_point time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  const auto micros = std::chrono::duration_cast<std::chrono::microseconds>(time - seconds).count();
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06}Z", fmt::gmtime(WallClock::to_time_t(seconds)), micros);
}

// The parts of a description that a simulated instrument knows of itself.
Description description_of(const SimulationSettings& simulation) {
  Description description;
  description.cantilever = simulation.cantilever;
  description.comb = simulation.comb;
  description.scan = simulation.layout;
  if (simulation.temperature_k > 0.0 || simulation.detector_nm_per_sqrt_hz > 0.0)
    description.noise = Noise{simulation.temperature_k, {simulation.detector_nm_per_sqrt_hz}};
  return description;
}

}  // namespace

class Instrument::Impl {
 public:
  Impl(const Configuration& configuration, PipelineOutputs outputs)
      : record_(configuration.record), outputs_(std::move(outputs)) {
    std::vector<ScheduledChange> changes;
    Description description = open(configuration, changes);
    const StreamInfo& info = digitizer_->info();
    const std::size_t block_bytes = info.block_frames * sample_bytes(info.format) * info.channels.size();
    if (configuration.pipeline.ring_blocks > most_ring_bytes / block_bytes)
      throw std::invalid_argument(fmt::format("pipeline.ring_blocks: {}, must be <= {}: a block has {} bytes",
                                              configuration.pipeline.ring_blocks,
                                              most_ring_bytes / block_bytes, block_bytes));
    sink_.emplace(configuration.pipeline.ring_blocks, block_bytes, info.when_full);
    recorder_.emplace(info, *sink_, outputs_.event);
    PipelineOutputs through = outputs_;
    if (outputs_.event) through.event = [this](const Event& event) { outputs_.event(with_reason(event)); };
    through.change = [this](std::uint64_t first_sample, const Analysis& analysis) {
      note_change(first_sample, analysis);
    };
    configured_scan_ = description.scan;
    pipeline_.emplace(info, *sink_, configuration.pipeline, std::move(description), std::move(changes),
                      std::move(through));
    in_force_ = pipeline_->analysis()->description;
    warn_of_doubts(0, in_force_);
  }

  ~Impl() { stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void start() {
    pipeline_->start();
    digitizer_->start(*sink_);
  }

  void wait() {
    pipeline_->wait();
    digitizer_->stop();
  }

  void stop() {
    digitizer_->stop();
    pipeline_->stop(most_drain);
    if (recorder_->running()) stop_recording();
  }

  const StreamInfo& info() const { return digitizer_->info(); }

  InstrumentStatus status() const {
    InstrumentStatus status;
    status.sample = sink_->next_sample();
    status.utc = iso8601(WallClock::now());
    // The newest block ended somewhere within the last block's time, if blocks come as they should.
    status.uncertainty_s = info().block_frames / info().sample_rate_hz;
    status.stream = digitizer_->status();
    status.pipeline = pipeline_->status();
    status.recording = recorder_->running();
    status.record = recorder_->summary();
    status.dropped_extraction = sink_->dropped_extraction();
    status.dropped_recorder = sink_->dropped_recorder();
    return status;
  }

  Description description() const { return pipeline_->analysis()->description; }
  std::optional<ScanLayout> configured_scan() const { return configured_scan_; }

  void start_scan(std::optional<ScanLayout> layout, std::uint32_t frames) {
    if (digitizer_->status().scanning) throw std::logic_error("a scan is running");
    const std::scoped_lock lock(changing_);
    Description next = description();
    next.scan = layout ? layout : configured_scan_;
    if (!next.scan)
      throw std::invalid_argument("scan: missing: neither the request nor the configuration has one");
    // The first line must already meet the new raster, and a scan that is refused must leave the old one.
    const ScanLayout raster = make_analysis(info(), next)->layout;
    if (info().has_scanner) digitizer_->prepare_scan(raster);
    pipeline_->change(next);
    if (info().has_scanner) digitizer_->start_scan(raster, frames);
  }

  void stop_scan() {
    if (info().has_scanner) digitizer_->stop_scan();
  }

  void mark_line(const LineMark& mark) {
    if (info().marks_lines) throw std::logic_error("this digitizer marks its lines itself");
    if (mark.line_samples == 0) throw std::invalid_argument("line_samples: 0 is below 1");
    if (!pipeline_->mark_line(mark)) throw std::logic_error("too many lines wait for their samples already");
    recorder_->note_line(mark);
  }

  std::string start_recording(const std::string& name) {
    const std::string plain =
        name.empty() ? fmt::format("{:%Y%m%dT%H%M%SZ}", fmt::gmtime(WallClock::to_time_t(WallClock::now())))
                     : name;
    if (plain.find('/') != std::string::npos || plain.front() == '.')
      throw std::invalid_argument(
          fmt::format("name: \"{}\" must be a plain file name without '/' or leading '.'", plain));
    if (recorder_->running()) throw std::logic_error("a recording is running");
    const std::filesystem::path directory = record_.directory;
    const std::string truth_name =
        std::filesystem::path(sigmf_paths(plain).meta).stem().string() + ".truth.ndjson";
    Json truth;
    if (simulated_ != nullptr) {
      truth_.emplace(directory / truth_name, *simulated_);
      truth = Json{{"file", truth_name}};
    }
    try {
      const std::scoped_lock lock(mutex_);
      recorder_->start(directory / plain, in_force_, truth);
    } catch (...) {  // what was refused leaves no file
      if (truth_) std::filesystem::remove(directory / truth_name);
      truth_.reset();
      throw;
    }
    return recorder_->summary().meta_path;
  }

  RecordingSummary stop_recording() {
    RecordingSummary summary = recorder_->stop();
    truth_.reset();
    return summary;
  }

  void capture_free(std::uint32_t windows, Height height, FreeDone done) {
    if (digitizer_->status().scanning)
      throw std::logic_error("a scan is running: the free response is captured away from the surface");
    if (info().is_recording && !info().marks_lines)
      throw std::logic_error("a recording without lines has no free stretch to capture");
    if (height == Height::lifted && !description().free_response)
      throw std::logic_error("lifted: no free response far from the surface was captured before");
    pipeline_->capture_free(windows, [this, height, done = std::move(done)](std::optional<FreeResponse> free,
                                                                            std::string why) {
      if (height == Height::lifted) {
        take_lifted(free, why);
        done(std::move(free), std::move(why));
        return;
      }
      if (free && !take_free(*free)) {
        free.reset();
        why = "the drive changed";
      }
      if (free) {
        warn_of_lost_tone(*free);
        if (!why.empty() && outputs_.event)
          outputs_.event({.kind = "incoherent", .first_sample = free->first_sample, .count = 0, .text = why});
      }
      done(std::move(free), std::move(why));
    });
  }

  void cancel_free() { pipeline_->cancel_free(); }

  Drive drive() const { return digitizer_->drive(); }

  void set_drive(const Drive& drive) {
    const std::scoped_lock lock(changing_);
    Description next = description();
    next.free_response.reset();  // it was the response to the old drive
    digitizer_->set_drive(drive);
    drive_from_ = digitizer_->status().next_sample;
    pipeline_->change(std::move(next));
  }

  void set_fit(const FitSettings& fit) {
    const std::scoped_lock lock(changing_);
    Description next = description();
    next.fit = fit;
    pipeline_->change(std::move(next));
  }

  void set_spectrum_rate(double hz) { pipeline_->set_spectrum_rate(hz); }

 private:
  Description open(const Configuration& configuration, std::vector<ScheduledChange>& changes) {
    if (configuration.digitizer.kind == DigitizerSettings::Kind::simulated) {
      auto simulated = std::make_unique<SimulatedDigitizer>(configuration.digitizer.simulation);
      simulated_ = simulated.get();
      digitizer_ = std::move(simulated);
      Description description =
          overlay(description_of(configuration.digitizer.simulation), configuration.description);
      if (!description.channels) description.channels = digitizer_->info().channels;
      return description;
    }
    const ReplaySettings& replay = configuration.digitizer.replay;
    auto digitizer = std::make_unique<ReplayDigitizer>(
        replay.recording, ReplayOptions{.realtime = replay.realtime, .verify = replay.verify});
    const SigmfMeta& meta = digitizer->meta();
    for (const std::string& warning : digitizer->warnings()) warn(0, warning);
    changes = changes_of(meta, configuration.description);
    Description description =
        under_configuration(meta.description, configuration.description, meta.sample_rate_hz);
    digitizer_ = std::move(digitizer);
    return description;
  }

  // False: it is, or may be, the response to a drive that is no more.
  bool take_free(const FreeResponse& free) {
    const std::scoped_lock lock(changing_);
    if (free.first_sample < drive_from_) return false;
    Description next = description();
    if (next.free_response && next.free_response->lifted_nm)
      warn(free.first_sample, "the lifted response was of the free response before: capture it again");
    next.free_response = free;
    pipeline_->change(std::move(next));
    return true;
  }

  // Turns the captured response into the free response that it belongs to; or into none, and why.
  void take_lifted(std::optional<FreeResponse>& free, std::string& why) {
    const std::scoped_lock lock(changing_);
    Description next = description();
    if (free && (free->first_sample < drive_from_ || !next.free_response)) why = "the drive changed";
    if (!free || !why.empty()) {
      free.reset();
      return;
    }
    next.free_response->lifted_nm = std::move(free->mean_nm);
    next.free_response->lifted_windows = free->windows;
    free = next.free_response;
    try {
      pipeline_->change(std::move(next));
    } catch (const std::invalid_argument& error) {  // of another drive
      free.reset();
      why = error.what();
    }
  }

  void warn_of_lost_tone(const FreeResponse& free) const {
    const std::string why = find_lost_tone(*description().comb, free);
    if (!why.empty()) warn(free.first_sample, why);
  }

  void warn_of_doubts(std::uint64_t first_sample, const Description& description) const {
    for (const std::string& doubt : find_doubts(description)) warn(first_sample, doubt);
  }

  void warn(std::uint64_t first_sample, std::string text) const {
    if (outputs_.event)
      outputs_.event({.kind = "warning", .first_sample = first_sample, .count = 0, .text = std::move(text)});
  }

  // Of a stream that ended because it failed.
  Event with_reason(Event event) const {
    const StreamStatus stream = digitizer_->status();
    if (event.kind == "stream_ended" && stream.state == StreamState::failed) event.text = stream.reason;
    return event;
  }

  void note_change(std::uint64_t first_sample, const Analysis& analysis) {
    {
      const std::scoped_lock lock(mutex_);
      in_force_ = analysis.description;
      if (recorder_->running()) recorder_->note_change(first_sample, analysis.description);
    }
    if (outputs_.change) outputs_.change(first_sample, analysis);
    warn_of_doubts(first_sample, analysis.description);
  }

  const RecordSettings record_;
  PipelineOutputs outputs_;
  std::unique_ptr<Digitizer> digitizer_;
  SimulatedDigitizer* simulated_ = nullptr;  // digitizer_ when it is one
  std::optional<ScanLayout> configured_scan_;
  std::optional<BlockSink> sink_;
  std::optional<Recorder> recorder_;
  std::optional<TruthWriter> truth_;
  // From reading the description to its change: the control thread's, and the output thread's as a capture
  // ends.
  std::mutex changing_;
  std::uint64_t drive_from_ = 0;  // no sample before it shows the drive that is set
  std::mutex mutex_;              // of in_force_, and so that no change slips past a recording that starts
  Description in_force_;          // of the pixel last put out
  std::optional<Pipeline> pipeline_;
};

Instrument::Instrument(const Configuration& configuration, PipelineOutputs outputs)
    : impl_(std::make_unique<Impl>(configuration, std::move(outputs))) {}
Instrument::~Instrument() = default;
void Instrument::start() {
  impl_->start();
}
void Instrument::wait() {
  impl_->wait();
}
void Instrument::stop() {
  impl_->stop();
}
const StreamInfo& Instrument::info() const {
  return impl_->info();
}
InstrumentStatus Instrument::status() const {
  return impl_->status();
}
Description Instrument::description() const {
  return impl_->description();
}
std::optional<ScanLayout> Instrument::configured_scan() const {
  return impl_->configured_scan();
}
void Instrument::start_scan(std::optional<ScanLayout> layout, std::uint32_t frames) {
  impl_->start_scan(layout, frames);
}
void Instrument::stop_scan() {
  impl_->stop_scan();
}
void Instrument::mark_line(const LineMark& mark) {
  impl_->mark_line(mark);
}
std::string Instrument::start_recording(const std::string& name) {
  return impl_->start_recording(name);
}
RecordingSummary Instrument::stop_recording() {
  return impl_->stop_recording();
}
void Instrument::capture_free(std::uint32_t windows, Height height, FreeDone done) {
  impl_->capture_free(windows, height, std::move(done));
}
void Instrument::cancel_free() {
  impl_->cancel_free();
}
Drive Instrument::drive() const {
  return impl_->drive();
}
void Instrument::set_drive(const Drive& drive) {
  impl_->set_drive(drive);
}
void Instrument::set_fit(const FitSettings& fit) {
  impl_->set_fit(fit);
}
void Instrument::set_spectrum_rate(double hz) {
  impl_->set_spectrum_rate(hz);
}

}  // namespace combforce
