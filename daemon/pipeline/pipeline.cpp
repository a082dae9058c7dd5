#include "daemon/pipeline/pipeline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "daemon/pipeline/extraction.hpp"
#include "daemon/pipeline/fit_pool.hpp"
#include "daemon/pipeline/free_capture.hpp"
#include "daemon/pipeline/output_slots.hpp"

namespace combforce {
namespace {

using Clock = std::chrono::steady_clock;

unsigned worker_count(const PipelineSettings& settings) {
  return settings.threads > 0 ? settings.threads : std::max(1U, std::thread::hardware_concurrency());
}

std::string_view name_of(EpochReason reason) {
  switch (reason) {
    case EpochReason::start:
      return "start";
    case EpochReason::unknown_loss:
      return "loss of unknown length";
    case EpochReason::device_restart:
      return "the device restarted";
    case EpochReason::clock_change:
      return "the clock changed";
  }
  return "";
}

void count(PixelCounts& counts, const OutputSlot& slot) {
  ++counts.pixels;
  ++counts.by_status[static_cast<std::size_t>(slot.fit.status)];
  counts.settling_residual = std::max(counts.settling_residual, slot.settling_residual);
}

}  // namespace

Pipeline::Pipeline(const StreamInfo& info, BlockSink& sink, const PipelineSettings& settings,
                   Description description, std::vector<ScheduledChange> changes, PipelineOutputs outputs)
    : info_(info),
      sink_(sink),
      settings_(settings),
      workers_(worker_count(settings)),
      fitters_(settings.fit ? workers_ : 0),
      outputs_(std::move(outputs)),
      analysis_(make_analysis(info, std::move(description))) {
  std::size_t tones = analysis_->tip_per_volt.size();
  std::vector<ScheduledStage> scheduled;
  for (ScheduledChange& change : changes) {
    auto later = make_analysis(info, std::move(change.description));
    tones = std::max(tones, later->tip_per_volt.size());
    scheduled.push_back({change.first_sample, std::make_unique<AnalysisStage>(info, later, fitters_)});
  }
  const std::size_t least = std::size_t{2} * workers_ * FitPool::queue_depth;
  slots_ = std::make_unique<OutputSlots>(std::max<std::size_t>(settings.pixel_slots, least), tones,
                                         info.channels.size());
  pool_ = std::make_unique<FitPool>(workers_, *slots_);
  extraction_ = std::make_unique<Extraction>(info, std::make_unique<AnalysisStage>(info, analysis_, fitters_),
                                             std::move(scheduled), *slots_, *pool_);
  if (outputs_.spectrum)
    spectra_ = std::make_unique<SpectrumMonitor>(
        info, settings.spectrum_segment, [this] { return analysis(); }, outputs_.spectrum);
}

Pipeline::~Pipeline() {
  stop();
}

void Pipeline::start() {
  started_ = Clock::now();
  output_thread_ = std::thread([this] { run_output(); });
  extraction_thread_ = std::thread([this] { run_extraction(); });
}

void Pipeline::wait() {
  if (extraction_thread_.joinable()) extraction_thread_.join();
  if (output_thread_.joinable()) output_thread_.join();
}

void Pipeline::stop(std::chrono::milliseconds drain) {
  if (!sink_.closed()) sink_.cancel();
  extraction_->drain(Clock::now() + drain);
  wait();
  sink_.cancel();
}

void Pipeline::change(Description description) {
  auto analysis = make_analysis(info_, std::move(description));
  auto stage = std::make_unique<AnalysisStage>(info_, analysis, fitters_);
  const std::scoped_lock lock(mutex_);
  analysis_ = std::move(analysis);
  extraction_->change(std::move(stage));
}

std::shared_ptr<const Analysis> Pipeline::analysis() const {
  const std::scoped_lock lock(mutex_);
  return analysis_;
}

bool Pipeline::mark_line(const LineMark& mark) {
  return extraction_->mark_line(mark);
}

void Pipeline::capture_free(std::uint32_t windows, FreeCapture::Done done) {
  if (windows == 0) throw std::invalid_argument("windows: 0 is below 1");
  const Comb comb = *analysis()->description.comb;
  auto capture = std::make_unique<FreeCapture>(windows, comb, settings_.drift_tolerance, std::move(done));
  auto cancellation = capture->cancellation();
  const std::scoped_lock lock(mutex_);
  if (!extraction_->capture(std::move(capture)))
    throw std::logic_error("a capture of the free response is under way");
  cancel_capture_ = std::move(cancellation);
}

void Pipeline::cancel_free() {
  const std::scoped_lock lock(mutex_);
  if (cancel_capture_ != nullptr) cancel_capture_->store(true, std::memory_order_relaxed);
}

void Pipeline::set_spectrum_rate(double hz) {
  if (spectra_ != nullptr) spectra_->set_rate(hz);
}

PipelineStatus Pipeline::status() const {
  const std::chrono::duration<double> elapsed = Clock::now() - started_;
  const std::chrono::duration<double> busy{Clock::duration(busy_.load(std::memory_order_relaxed))};
  return {.pixels_extracted = extraction_->pixels(),
          .pixels_retired = retired_.load(std::memory_order_relaxed),
          .not_fitted = extraction_->not_fitted(),
          .next_sample = extraction_->next_sample(),
          .epoch = extraction_->epoch(),
          .extraction_busy = elapsed.count() > 0.0 ? busy / elapsed : 0.0,
          .threads = workers_};
}

void Pipeline::run_extraction() {
  SampleRing& ring = sink_.extraction();
  for (;;) {
    const SampleBlock* block = ring.front();
    if (sink_.cancelled() || extraction_->out_of_time()) break;
    if (block == nullptr) {
      if (sink_.closed() && ring.front() == nullptr) break;
      sink_.wait_extraction();
      continue;
    }
    const auto began = Clock::now();
    extraction_->process(*block);
    if (spectra_ != nullptr) spectra_->tap().add(*block);
    busy_.fetch_add((Clock::now() - began).count(), std::memory_order_relaxed);
    ring.release();
    sink_.released();
  }
  extraction_->finish(sink_.next_sample());
}

void Pipeline::run_output() {
  for (bool more = true; more;) {
    slots_->wait_front();
    const OutputSlot& slot = *slots_->front();
    more = slot.kind != OutputSlot::Kind::end;
    put_out(slot);
    slots_->retire();
  }
}

void Pipeline::put_out(const OutputSlot& slot) {
  switch (slot.kind) {
    case OutputSlot::Kind::pixel:
      count(line_counts_, slot);
      count(frame_counts_, slot);
      if (outputs_.pixel)
        outputs_.pixel({slot.pixel, slot.tones(), slot.fit, *slot.stage->analysis, slot.settling_residual});
      retired_.fetch_add(1, std::memory_order_relaxed);
      break;
    case OutputSlot::Kind::line_done:
      if (outputs_.line) outputs_.line({slot.line, line_counts_});
      line_counts_ = {};
      break;
    case OutputSlot::Kind::frame_done:
      if (outputs_.frame) outputs_.frame({slot.frame, frame_counts_, slot.whole_frame});
      frame_counts_ = {};
      break;
    case OutputSlot::Kind::change:
      put_change(slot);
      delete slot.superseded;
      break;
    case OutputSlot::Kind::free_capture:
      slot.capture->finish();
      delete slot.capture;
      break;
    case OutputSlot::Kind::gap:
      put_event("gap", slot, "samples were lost");
      break;
    case OutputSlot::Kind::epoch:
      put_event("epoch", slot, "the phase reference is void: " + std::string(name_of(slot.epoch_reason)));
      break;
    case OutputSlot::Kind::scan_ended:
      put_event("scan_ended", slot, "");
      break;
    case OutputSlot::Kind::end:
      put_event("stream_ended", slot,
                slot.count == 0 ? "" : fmt::format("{} samples before it are not analysed", slot.count));
      break;
  }
}

void Pipeline::put_event(const char* kind, const OutputSlot& slot, std::string text) const {
  if (!outputs_.event) return;
  const bool counts = slot.kind == OutputSlot::Kind::gap || slot.kind == OutputSlot::Kind::end;
  const std::uint64_t lost = counts ? slot.count : 0;
  outputs_.event({.kind = kind, .first_sample = slot.first_sample, .count = lost, .text = std::move(text)});
}

void Pipeline::put_change(const OutputSlot& slot) const {
  const Analysis& now = *slot.stage->analysis;
  if (outputs_.change) outputs_.change(slot.first_sample, now);
  const Description& before = slot.superseded->analysis->description;
  const Description& after = now.description;
  const bool comparable = slot.reference_held && before.free_response->coherent && after.free_response &&
                          after.free_response->coherent && before.comb == after.comb &&
                          before.cantilever == after.cantilever && before.channels == after.channels;
  if (!comparable || !outputs_.event) return;
  const std::string change =
      find_change(*after.comb, *before.free_response, *after.free_response, settings_.drift_tolerance);
  if (!change.empty())
    outputs_.event({.kind = "incoherent",
                    .first_sample = after.free_response->first_sample,
                    .count = 0,
                    .text = change});
}

}  // namespace combforce
