#include "daemon/record/recording_index.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace combforce {

namespace {

std::string iso8601(UtcTime utc) {
  const auto micros = std::chrono::duration_cast<std::chrono::microseconds>(utc.time_since_epoch()).count();
  const std::time_t seconds = std::chrono::system_clock::to_time_t(utc);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06}Z", fmt::gmtime(seconds), micros % 1'000'000);
}

// What `to` says otherwise than `from`. Objects are never taken back but for the free response.
Description difference(const Description& from, const Description& to) {
  Description changed;
  const auto keep_if_changed = [&](auto member) {
    if (to.*member && to.*member != from.*member) changed.*member = to.*member;
  };
  keep_if_changed(&Description::channels);
  keep_if_changed(&Description::cantilever);
  keep_if_changed(&Description::excitation);
  keep_if_changed(&Description::comb);
  keep_if_changed(&Description::free_response);
  keep_if_changed(&Description::scan);
  keep_if_changed(&Description::noise);
  keep_if_changed(&Description::fit);
  return changed;
}

}  // namespace

RecordingIndex::RecordingIndex(const StreamInfo& info, Description description, Json truth) {
  head_.datatype.kind =
      info.format == SampleFormat::i16 ? SigmfDatatype::Kind::i16 : SigmfDatatype::Kind::f32;
  head_.sample_rate_hz = info.sample_rate_hz;
  head_.num_channels = static_cast<std::uint32_t>(info.channels.size());
  head_.description = std::move(description);
  head_.truth = std::move(truth);
  head_.rest = Json{{"core:recorder", "combforce"}};
}

std::uint64_t RecordingIndex::end_sample() const {
  if (segments_.empty()) return 0;
  return segments_.back().first_sample + (frames_ - segments_.back().file_first);
}

bool RecordingIndex::begin_block(const BlockHeader& header, UtcTime utc) {
  for (const StreamMark& mark : header.valid_marks()) {
    if (mark.kind == StreamMark::Kind::line)
      add_line(mark.line);
    else
      marks_.push_back(mark);
  }
  pending_frames_ = header.frames;
  const bool same_epoch = !segments_.empty() && header.epoch == segments_.back().epoch;
  const std::uint64_t lost = same_epoch ? header.first_sample - end_sample() : 0;
  if (same_epoch && lost == 0) return false;
  if (same_epoch) {
    ++gaps_;
    lost_frames_ += lost;
  }
  segments_.push_back(
      {frames_, header.first_sample, header.epoch, header.epoch_reason, header.epoch_first_sample, utc});
  return true;
}

void RecordingIndex::end_block() {
  frames_ += std::exchange(pending_frames_, 0);
}

void RecordingIndex::abandon_block() {
  pending_frames_ = 0;
  if (segments_.size() > 1 && segments_.back().file_first == frames_) segments_.pop_back();
}

void RecordingIndex::add_line(const LineMark& mark) {
  const auto after = std::ranges::upper_bound(lines_, mark.first_sample, {}, &LineMark::first_sample);
  lines_.insert(after, mark);
}

void RecordingIndex::add_change(std::uint64_t first_sample, const Description& description) {
  const auto after = std::ranges::upper_bound(changes_, first_sample, {}, &Change::first_sample);
  changes_.insert(after, {first_sample, description});
}

// Of the first frame in the file that is `sample` or later in the stream.
std::uint64_t RecordingIndex::file_position(std::uint64_t sample) const {
  const auto next = std::ranges::upper_bound(segments_, sample, {}, &Segment::first_sample);
  if (next == segments_.begin()) return 0;
  const Segment& segment = *std::prev(next);
  const std::uint64_t end = next == segments_.end() ? frames_ : next->file_first;
  return std::min(segment.file_first + (sample - segment.first_sample), end);
}

SigmfCapture RecordingIndex::capture_at(std::uint64_t file_frame) const {
  const auto next = std::ranges::upper_bound(segments_, file_frame, {}, &Segment::file_first);
  const Segment& segment = *std::prev(next);
  const std::uint64_t offset = file_frame - segment.file_first;
  const std::chrono::duration<double> seconds(static_cast<double>(offset) / head_.sample_rate_hz);
  SigmfCapture capture;
  capture.sample_start = file_frame;
  capture.global_index = segment.first_sample + offset;
  capture.datetime = iso8601(segment.utc + std::chrono::duration_cast<UtcTime::duration>(seconds));
  capture.epoch = segment.epoch;
  capture.epoch_reason = segment.epoch_reason;
  capture.epoch_first_sample = segment.epoch_first_sample;
  return capture;
}

SigmfMeta RecordingIndex::meta() const {
  SigmfMeta meta = head_;
  for (const Segment& segment : segments_) meta.captures.push_back(capture_at(segment.file_first));
  encode_changes(meta);
  encode_marks(meta);
  return meta;
}

void RecordingIndex::encode_changes(SigmfMeta& meta) const {
  const std::uint64_t end = end_sample();
  Description in_force = meta.description;
  for (const Change& change : changes_) {
    if (change.first_sample >= end) break;
    const Description changed = difference(in_force, change.description);
    const bool dropped = in_force.free_response && !change.description.free_response;
    if (changed == Description{} && !dropped) continue;
    in_force = change.description;
    if (change.first_sample <= first_sample()) {
      meta.description = in_force;
      continue;
    }
    const std::uint64_t position = file_position(change.first_sample);
    auto at = std::ranges::lower_bound(meta.captures, position, {}, &SigmfCapture::sample_start);
    if (at == meta.captures.end() || at->sample_start != position)
      at = meta.captures.insert(at, capture_at(position));
    if (dropped) at->changes.free_response.reset();
    at->drops_free_response = at->drops_free_response || dropped;
    at->changes = overlay(at->changes, changed);
  }
}

void RecordingIndex::encode_marks(SigmfMeta& meta) const {
  const std::uint64_t first = first_sample(), end = end_sample();
  for (const StreamMark& mark : marks_) {
    if (mark.sample >= end) continue;
    auto next = std::ranges::upper_bound(meta.captures, mark.sample, {}, &SigmfCapture::global_index);
    SigmfCapture& capture = next == meta.captures.begin() ? *next : *std::prev(next);
    (mark.kind == StreamMark::Kind::step ? capture.steps : capture.scan_ends).push_back(mark.sample);
  }
  for (const LineMark& mark : lines_) {
    if (mark.first_sample >= end || mark.first_sample + mark.line_samples <= first) continue;
    const std::uint64_t from = file_position(mark.first_sample);
    meta.lines.push_back({mark, from, file_position(mark.first_sample + mark.line_samples) - from, {}});
  }
}

}  // namespace combforce
