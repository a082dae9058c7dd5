#include "drivers/replay/replay_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace combforce {

namespace {

std::vector<ReplayRun> plan_runs(const SigmfMeta& meta, std::uint64_t data_frames) {
  std::vector<ReplayRun> runs;
  std::uint64_t next_sample = 0;
  std::uint32_t epoch = 0;
  for (std::size_t i = 0; i < meta.captures.size(); ++i) {
    const SigmfCapture& capture = meta.captures[i];
    const std::uint64_t end =
        i + 1 < meta.captures.size() ? std::min(meta.captures[i + 1].sample_start, data_frames) : data_frames;
    if (end <= capture.sample_start) continue;
    const std::uint64_t frames = end - capture.sample_start;
    const bool new_epoch = runs.empty() || capture.epoch > epoch;
    if (new_epoch || capture.global_index > next_sample) {
      runs.push_back({.frames = frames,
                      .first_sample = capture.global_index,
                      .lost_before = new_epoch ? 0 : capture.global_index - next_sample,
                      .epoch = capture.epoch,
                      .epoch_reason = capture.epoch_reason,
                      .epoch_first_sample = capture.epoch_first_sample});
    } else {
      runs.back().frames += frames;
    }
    epoch = runs.back().epoch;
    next_sample = capture.global_index + frames;
  }
  return runs;
}

std::vector<StreamMark> plan_marks(const SigmfMeta& meta, std::uint64_t end_sample) {
  // Stable: at one sample steps come first, and a scan ends before the next line begins.
  std::vector<StreamMark> marks;
  for (const SigmfCapture& capture : meta.captures)
    for (const std::uint64_t sample : capture.steps) marks.push_back({StreamMark::Kind::step, sample, {}});
  for (const SigmfCapture& capture : meta.captures)
    for (const std::uint64_t sample : capture.scan_ends)
      marks.push_back({StreamMark::Kind::scan_ended, sample, {}});
  for (const SigmfLine& line : meta.lines)
    marks.push_back({StreamMark::Kind::line, line.mark.first_sample, line.mark});
  std::ranges::stable_sort(marks, {}, &StreamMark::sample);
  std::erase_if(marks, [&](const StreamMark& mark) { return mark.sample >= end_sample; });
  return marks;
}

void warn(std::vector<std::string>& warnings, std::uint64_t count, std::string_view one,
          std::string_view many) {
  if (count == 1) warnings.emplace_back(one);
  if (count > 1) warnings.push_back(fmt::format("{} {}", count, many));
}

std::vector<std::string> find_disagreements(const SigmfMeta& meta, const std::vector<ReplayRun>& runs,
                                            std::uint64_t data_frames) {
  std::vector<std::string> warnings;
  if (runs.empty())
    warnings.push_back(fmt::format("no samples to replay: the data holds {} frames", data_frames));
  const auto captures = std::ranges::count_if(
      meta.captures, [&](const SigmfCapture& capture) { return capture.sample_start > data_frames; });
  warn(warnings, static_cast<std::uint64_t>(captures), "a capture starts past the end of the data: ignored",
       "captures start past the end of the data: ignored");
  std::uint64_t absent = 0, cut = 0;
  const std::uint64_t end_sample = runs.empty() ? 0 : runs.back().first_sample + runs.back().frames;
  for (const SigmfLine& line : meta.lines) {
    if (line.mark.first_sample >= end_sample)
      ++absent;
    else if (line.sample_start + line.sample_count > data_frames)
      ++cut;
  }
  warn(warnings, absent, "a line begins past the end of the data: it has no pixels",
       "lines begin past the end of the data: they have no pixels");
  warn(warnings, cut, "a line reaches past the end of the data: its last pixels are incomplete or missing",
       "lines reach past the end of the data: their last pixels are incomplete or missing");
  return warnings;
}

}  // namespace

ReplayPlan plan_replay(const SigmfMeta& meta, std::uint64_t data_frames) {
  ReplayPlan plan;
  plan.runs = plan_runs(meta, data_frames);
  const std::uint64_t end_sample =
      plan.runs.empty() ? 0 : plan.runs.back().first_sample + plan.runs.back().frames;
  plan.marks = plan_marks(meta, end_sample);
  plan.warnings = find_disagreements(meta, plan.runs, data_frames);
  return plan;
}

}  // namespace combforce
