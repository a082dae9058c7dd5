#include "tests/support/synthetic_stream.hpp"

#include <algorithm>
#include <thread>

namespace combforce::test {

void SyntheticStream::push_into(BlockSink& sink, const std::function<std::uint32_t()>& block_frames) const {
  const std::uint64_t end = first_sample + samples;
  std::uint64_t at = first_sample, lost_before = 0;
  std::size_t next_mark = 0, next_lost = 0, next_epoch = 0;
  BlockHeader header;
  std::vector<std::int16_t> data;
  while (at < end) {
    if (next_lost < lost.size() && lost[next_lost].first == at) {
      lost_before += lost[next_lost].end - at;
      at = lost[next_lost++].end;
      continue;
    }
    if (next_epoch < new_epochs.size() && new_epochs[next_epoch] <= at) {
      ++next_epoch;
      ++header.epoch;
      header.epoch_reason = EpochReason::unknown_loss;
      header.epoch_first_sample = at;
      lost_before = 0;
    }
    std::uint64_t until = std::min(end, at + block_frames());
    if (next_lost < lost.size()) until = std::min(until, lost[next_lost].first);
    if (next_epoch < new_epochs.size()) until = std::min(until, new_epochs[next_epoch]);
    header.first_sample = at;
    header.frames = static_cast<std::uint32_t>(until - at);
    header.lost_before = std::exchange(lost_before, 0);
    header.mark_count = 0;
    while (next_mark < marks.size() && marks[next_mark].sample < until &&
           header.mark_count < BlockHeader::max_marks)
      header.marks[header.mark_count++] = marks[next_mark++];
    data.resize(header.frames);
    for (std::uint64_t n = at; n < until; ++n) data[n - at] = value(n);
    sink.push(header, data.data());
    at = until;
  }
  sink.close();
}

StreamInfo one_channel(double sample_rate_hz, std::uint32_t block_frames) {
  StreamInfo info;
  info.sample_rate_hz = sample_rate_hz;
  info.channels.resize(1);
  info.channels[0].name = "deflection";
  info.block_frames = block_frames;
  info.when_full = WhenFull::wait;
  info.marks_lines = true;
  info.is_recording = true;
  info.name = "synthetic";
  return info;
}

PipelineOutputs Recorded::outputs() {
  return {.pixel =
              [this](const RetiredPixel& pixel) {
                pixels.push_back(pixel.pixel);
                tip_nm.emplace_back(pixel.tip_nm.begin(), pixel.tip_nm.end());
                fits.push_back(pixel.fit);
                order.emplace_back("pixel");
                const Description& description = pixel.analysis.description;
                append_pixel_line(lines,
                                  {pixel.pixel, *description.comb, *description.channels, pixel.tip_nm,
                                   pixel.analysis.model, pixel.fit},
                                  PixelFields::all);
              },
          .line =
              [this](const LineDone& line) {
                order.emplace_back("line");
                line_ends.push_back(line);
              },
          .frame =
              [this](const FrameDone& frame) {
                order.emplace_back("frame");
                frame_ends.push_back(frame);
              },
          .event =
              [this](const Event& event) {
                order.push_back(event.kind);
                events.push_back(event);
              },
          .spectrum = {},
          .change = [this](std::uint64_t, const Analysis&) { order.emplace_back("change"); }};
}

Recorded run(const SyntheticStream& stream, const StreamInfo& info, const Description& description,
             const std::function<std::uint32_t()>& block_frames, unsigned threads,
             std::vector<ScheduledChange> changes) {
  Recorded recorded;
  BlockSink sink(8, info.block_frames * sizeof(std::int16_t), info.when_full);
  PipelineSettings settings;
  settings.threads = threads;
  Pipeline pipeline(info, sink, settings, description, std::move(changes), recorded.outputs());
  pipeline.start();
  stream.push_into(sink, block_frames);
  pipeline.wait();
  return recorded;
}

}  // namespace combforce::test
