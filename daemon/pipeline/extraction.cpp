#include "daemon/pipeline/extraction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dsp/pixel_clock.hpp"

namespace combforce {
namespace {

// A commanded step may ring by this much of itself when the analysed windows begin.
constexpr double settled_residual = 0.01;
// A captured reference waits longer: every later force refers to it. exp(-14) = 1e-6.
constexpr double capture_ring_downs = 14.0;
// Whole pixels inside one gap of an unmarked stream that are published one by one.
constexpr std::uint64_t most_lost_pixels = 4096;

std::size_t most_tones(const AnalysisStage& first, const std::vector<ScheduledStage>& scheduled) {
  std::size_t tones = first.analysis->tip_per_volt.size();
  for (const ScheduledStage& later : scheduled)
    tones = std::max(tones, later.stage->analysis->tip_per_volt.size());
  return tones;
}

}  // namespace

Extraction::Extraction(const StreamInfo& info, std::unique_ptr<AnalysisStage> first,
                       std::vector<ScheduledStage> scheduled, OutputSlots& slots, FitPool& pool)
    : info_(info),
      marked_(info.marks_lines || !info.is_recording),
      slots_(slots),
      pool_(pool),
      free_windows_(most_tones(*first, scheduled), info.channels.size()),
      stages_(std::move(scheduled)),
      stage_(std::move(first)) {}

Extraction::~Extraction() = default;

void Extraction::process(const SampleBlock& block) {
  const BlockHeader& header = block.header;
  if (!started_) {
    started_ = true;
    cursor_ = header.first_sample;
    unmarked_first_ = cursor_;
    epoch_.store(header.epoch, std::memory_order_relaxed);
    epoch_first_ = header.epoch_first_sample;
    if (!marked_) begin_pixel();
  } else if (header.epoch != epoch_.load(std::memory_order_relaxed)) {
    begin_epoch(header);
  } else if (header.first_sample > cursor_) {
    skip_lost(header.first_sample);
  }
  const std::uint64_t end = header.first_sample + header.frames;
  if (!in_pixel()) take_over(cursor_);
  for (const StreamMark& mark : header.valid_marks()) {
    consume(block, std::clamp(mark.sample, cursor_, end));
    apply(mark);
  }
  while (client_marks_.read_available() > 0 && client_marks_.front().first_sample < end) {
    LineMark mark;
    client_marks_.pop(mark);
    consume(block, std::clamp(mark.first_sample, cursor_, end));
    begin_line(mark, PixelFlag::incomplete);
  }
  consume(block, end);
  next_sample_.store(cursor_, std::memory_order_relaxed);
}

void Extraction::finish(std::uint64_t stream_end) {
  if (marked_) {
    cut_line();
  } else if (in_pixel() && flags_.has(PixelFlag::gap)) {
    flags_.set(PixelFlag::incomplete);
    emit_pixel();
  }
  end_frame(false);
  if (free_windows_.wanted()) end_capture("the stream ended");
  OutputSlot& slot = next_slot(OutputSlot::Kind::end, cursor_);
  slot.count = started_ && stream_end > cursor_ ? stream_end - cursor_ : 0;
  slots_.commit_complete();
}

bool Extraction::out_of_time() const {
  return Clock::now().time_since_epoch().count() > drain_until_.load(std::memory_order_relaxed);
}

bool Extraction::may_wait_for_fits() const {
  constexpr Clock::rep not_draining = Clock::time_point::max().time_since_epoch().count();
  if (drain_until_.load(std::memory_order_relaxed) == not_draining) return info_.when_full == WhenFull::wait;
  return !out_of_time();
}

void Extraction::begin_epoch(const BlockHeader& header) {
  if (in_pixel() && cursor_ > span_.first_sample) {
    flags_.set(PixelFlag::gap);
    flags_.set(PixelFlag::incomplete);
    emit_pixel();
  }
  if (line_) end_line(false);
  end_capture("the clock of the stream broke");
  OutputSlot& slot = next_slot(OutputSlot::Kind::epoch, header.first_sample);
  slot.epoch_reason = header.epoch_reason;
  slots_.commit_complete();
  epoch_.store(header.epoch, std::memory_order_relaxed);
  cursor_ = header.first_sample;
  epoch_first_ = header.epoch_first_sample;
  last_step_ = never;
  if (marked_) return;
  unmarked_first_ = cursor_;
  unmarked_column_ += pixel_index_;
  pixel_index_ = 0;
  begin_pixel();
}

void Extraction::skip_lost(std::uint64_t until) {
  OutputSlot& slot = next_slot(OutputSlot::Kind::gap, cursor_);
  slot.count = until - cursor_;
  slots_.commit_complete();
  end_capture("samples were lost");
  miss(until, PixelFlag::gap);
}

void Extraction::miss(std::uint64_t until, PixelFlag why) {
  std::uint64_t published = 0;
  while (in_pixel() && span_.end_sample <= until) {
    flags_.set(why);
    emit_pixel();
    if (marked_ || ++published < most_lost_pixels) continue;
    const std::uint64_t length = span_.end_sample - span_.first_sample;
    const std::uint64_t left_out = (until - span_.first_sample) / length;
    unmarked_first_ += left_out * length;
    unmarked_column_ += static_cast<std::uint32_t>(left_out);
    begin_pixel();
  }
  if (in_pixel() && span_.first_sample < until) flags_.set(why);
  cursor_ = until;
}

void Extraction::consume(const SampleBlock& block, std::uint64_t until) {
  while (cursor_ < until) {
    if (in_pixel())
      consume_pixel(block, until);
    else
      consume_free(block, until);
  }
}

void Extraction::consume_pixel(const SampleBlock& block, std::uint64_t until) {
  if (cursor_ < span_.analysis_first) {
    cursor_ = std::min(until, span_.analysis_first);
  } else if (flags_.has(PixelFlag::gap) || flags_.has(PixelFlag::incomplete)) {
    cursor_ = std::min(until, span_.end_sample);
  } else {
    if (!analysing_) {
      stage_->extractor.begin(span_.analysis_first, stage_->analysis->layout.windows);
      analysing_ = true;
    }
    cursor_ += stage_->add(block, cursor_, std::min(until, span_.end_sample));
  }
  if (cursor_ >= span_.end_sample) emit_pixel();
}

void Extraction::consume_free(const SampleBlock& block, std::uint64_t until) {
  if (!free_windows_.wanted()) {
    cursor_ = until;
    return;
  }
  if (free_windows_.cancelled()) {
    end_capture("it was cancelled");
    return;
  }
  cursor_ = free_windows_.consume(*stage_, block, cursor_, until, settled_from());
  if (!free_windows_.complete()) return;
  end_capture(nullptr);
  // Behind a source that can wait, what the capture changes is in force before the stream goes on: runs
  // repeat.
  if (info_.when_full == WhenFull::wait) slots_.wait_retired();
}

std::uint64_t Extraction::settled_from() const {
  if (last_step_ == never) return 0;
  return last_step_ +
         static_cast<std::uint64_t>(std::ceil(capture_ring_downs * stage_->analysis->ring_down_samples));
}

void Extraction::apply(const StreamMark& mark) {
  switch (mark.kind) {
    case StreamMark::Kind::line:
      begin_line(mark.line, PixelFlag::gap);
      break;
    case StreamMark::Kind::step:
      last_step_ = mark.sample;
      free_windows_.begin_again();
      break;
    case StreamMark::Kind::scan_ended:
      cut_line();
      end_frame(false);
      last_step_ = mark.sample;
      next_slot(OutputSlot::Kind::scan_ended, mark.sample);
      slots_.commit_complete();
      break;
  }
}

void Extraction::begin_line(const LineMark& mark, PixelFlag if_late) {
  if (!marked_) return;
  cut_line();
  end_capture("a scan line began");
  if (mark.frame != frame_) end_frame(false);
  frame_ = mark.frame;
  take_over(mark.first_sample);
  line_ = mark;
  last_step_ = mark.first_sample;
  pixel_index_ = 0;
  begin_pixel();
  if (cursor_ > mark.first_sample) miss(cursor_, if_late);
}

void Extraction::cut_line() {
  if (!line_) return;
  if (cursor_ > span_.first_sample) {
    flags_.set(PixelFlag::incomplete);
    emit_pixel();
  }
  if (line_) end_line(false);
}

void Extraction::end_line(bool whole) {
  OutputSlot& slot = next_slot(OutputSlot::Kind::line_done, line_->first_sample);
  slot.line = *line_;
  slots_.commit_complete();
  const ScanLayout& layout = stage_->analysis->layout;
  const bool last =
      line_->line + 1 == layout.lines && (!layout.bidirectional || line_->direction == Direction::retrace);
  line_.reset();
  if (last) end_frame(whole);
}

void Extraction::end_frame(bool whole) {
  if (frame_pixels_ == 0) return;
  frame_pixels_ = 0;
  OutputSlot& slot = next_slot(OutputSlot::Kind::frame_done, cursor_);
  slot.frame = frame_;
  slot.whole_frame = whole;
  slots_.commit_complete();
}

void Extraction::begin_pixel() {
  flags_.clear();
  analysing_ = false;
  place_pixel();
  take_over(span_.first_sample);
  place_pixel();
  const ScanLayout& layout = stage_->analysis->layout;
  const std::uint64_t analysed = layout.windows * stage_->extractor.comb().window_samples;
  if (span_.analysis_first < span_.first_sample + layout.settle_samples ||
      span_.end_sample - span_.analysis_first < analysed)
    flags_.set(PixelFlag::sync);
}

void Extraction::place_pixel() {
  const ScanLayout& layout = stage_->analysis->layout;
  const std::uint64_t window = stage_->extractor.comb().window_samples;
  if (line_) {
    span_ = pixel_of_line(*line_, layout, window, pixel_index_);
    return;
  }
  span_ = pixel_unmarked(unmarked_first_, layout, window, pixel_index_);
  span_.column += unmarked_column_;
}

void Extraction::emit_pixel() {
  OutputSlot& slot = next_slot(OutputSlot::Kind::pixel, span_.first_sample);
  const Analysis& analysis = *stage_->analysis;
  const std::size_t parameters = analysis.model == nullptr ? 0 : analysis.model->parameters.size();
  const std::optional<FreeResponse>& reference = analysis.description.free_response;
  if (valid(reference) && !reference->coherent) flags_.set(PixelFlag::incoherent);
  measure(slot);
  pixels_.fetch_add(1, std::memory_order_relaxed);
  ++frame_pixels_;
  if (slot.pixel.flags.any()) {
    slot.fit = unfitted(FitStatus::flagged, parameters);
    slots_.commit_complete();
  } else if (stage_->fitters.empty() || !valid(reference)) {
    slot.fit = unfitted(FitStatus::no_free_response, parameters);
    slots_.commit_complete();
  } else {
    dispatch(slot, parameters);
  }
  ++pixel_index_;
  if (line_ && pixel_index_ == analysis.layout.columns)
    end_line(true);
  else
    begin_pixel();
}

void Extraction::measure(OutputSlot& slot) {
  const Analysis& analysis = *stage_->analysis;
  const Channels& channels = *analysis.description.channels;
  const std::size_t tones = analysis.tip_per_volt.size();
  slot.stage = stage_.get();
  slot.pixel.span = span_;
  slot.pixel.phasors.resize(tones);
  slot.pixel.channel_means.resize(channels.size());
  const double tau = analysis.ring_down_samples;
  slot.settling_residual = tau > 0.0 ? settling_residual(span_, span_.first_sample, tau) : 0.0;
  if (tau > 0.0 && last_step_ != never && settling_residual(span_, last_step_, tau) > settled_residual)
    flags_.set(PixelFlag::settling);
  if (analysing_ && stage_->extractor.missing() == 0) {
    if (stage_->extractor.clipped() > 0) flags_.set(PixelFlag::clipped);
    stage_->extractor.finish(slot.pixel.phasors, slot.pixel.channel_means);
    for (std::size_t i = 0; i < channels.size(); ++i)
      slot.pixel.channel_means[i] = channels[i].scale * slot.pixel.channel_means[i] + channels[i].offset;
    for (std::size_t i = 0; i < tones; ++i) {
      slot.pixel.phasors[i] *= channels.front().scale;
      slot.tip_nm[i] = analysis.tip_per_volt[i] * slot.pixel.phasors[i];
    }
  } else {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    std::ranges::fill(slot.pixel.phasors, std::complex<double>(nan, nan));
    std::fill_n(slot.tip_nm.begin(), tones, std::complex<double>(nan, nan));
    std::ranges::fill(slot.pixel.channel_means, nan);
  }
  slot.pixel.flags = flags_;
}

void Extraction::dispatch(OutputSlot& slot, std::size_t parameters) {
  const std::uint32_t index = slots_.commit_pending();
  while (!pool_.offer(index)) {
    if (may_wait_for_fits()) {
      pool_.wait_room();
      continue;
    }
    slot.fit = unfitted(FitStatus::not_fitted, parameters);
    not_fitted_.fetch_add(1, std::memory_order_relaxed);
    slots_.complete(index);
    return;
  }
}

void Extraction::take_over(std::uint64_t boundary) {
  // The raster of a line does not change within it.
  const auto fits_line = [this](const AnalysisStage& stage) {
    return !line_ || pixel_index_ == 0 || stage.analysis->layout == stage_->analysis->layout;
  };
  while (std::unique_ptr<AnalysisStage> stage = stages_.next(boundary, fits_line))
    install(std::move(stage), boundary);
}

void Extraction::install(std::unique_ptr<AnalysisStage> stage, std::uint64_t boundary) {
  if (stage->extractor.comb() != stage_->extractor.comb()) end_capture("the comb changed");
  OutputSlot& slot = next_slot(OutputSlot::Kind::change, boundary);
  slot.reference_held = valid(stage_->analysis->description.free_response);
  slot.stage = stage.get();
  slot.superseded = stage_.release();
  slots_.commit_complete();
  stage_ = std::move(stage);
  free_windows_.restart();
}

void Extraction::end_capture(const char* failure) {
  std::unique_ptr<FreeCapture> capture = free_windows_.end(failure);
  if (capture == nullptr) return;
  next_slot(OutputSlot::Kind::free_capture, cursor_).capture = capture.release();
  slots_.commit_complete();
}

OutputSlot& Extraction::next_slot(OutputSlot::Kind kind, std::uint64_t first_sample) {
  OutputSlot* slot = slots_.acquire();
  if (slot == nullptr) {
    slots_.wait_room();
    slot = slots_.acquire();
  }
  slot->kind = kind;
  slot->first_sample = first_sample;
  return *slot;
}

}  // namespace combforce
