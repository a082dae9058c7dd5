#include "daemon/record/recording_index.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace combforce {
namespace {

constexpr double rate_hz = 1000.0;
const UtcTime start_utc = std::chrono::system_clock::from_time_t(1'700'000'000);  // 2023-11-14T22:13:20Z

StreamInfo info() {
  StreamInfo info;
  info.sample_rate_hz = rate_hz;
  info.channels.resize(1);
  return info;
}

Description described(double temperature_k) {
  Description description;
  description.noise = Noise{temperature_k, {0.0}};
  return description;
}

class RecordingIndexTest : public ::testing::Test {
 protected:
  bool block(std::uint64_t first_sample, std::uint32_t frames, std::uint32_t epoch = 0,
             const std::vector<StreamMark>& marks = {}) {
    BlockHeader header;
    header.first_sample = first_sample;
    header.frames = frames;
    header.epoch = epoch;
    header.epoch_reason = epoch == 0 ? EpochReason::start : EpochReason::unknown_loss;
    header.epoch_first_sample = std::uint64_t{10} * epoch;
    for (const StreamMark& mark : marks) header.marks.at(header.mark_count++) = mark;
    const bool new_capture = index_.begin_block(header, start_utc);
    index_.end_block();
    return new_capture;
  }
  static StreamMark line(std::uint64_t first_sample, std::uint64_t samples, std::uint32_t number = 0) {
    return {StreamMark::Kind::line, first_sample, {0, number, Direction::trace, first_sample, samples}};
  }

  RecordingIndex index_{info(), described(300.0), Json()};
};

TEST_F(RecordingIndexTest, ContiguousBlocksAreOneCapture) {
  EXPECT_TRUE(block(500, 10));
  EXPECT_FALSE(block(510, 10));
  const SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 1u);
  EXPECT_EQ(meta.captures[0].sample_start, 0u);
  EXPECT_EQ(meta.captures[0].global_index, 500u);
  EXPECT_EQ(meta.captures[0].datetime, "2023-11-14T22:13:20.000000Z");
  EXPECT_EQ(index_.frames(), 20u);
  EXPECT_EQ(index_.first_sample(), 500u);
  EXPECT_EQ(index_.end_sample(), 520u);
}

TEST_F(RecordingIndexTest, GapsAndEpochsAreCaptures) {
  block(0, 10);
  EXPECT_TRUE(block(15, 10));
  EXPECT_TRUE(block(30, 10, 1));
  EXPECT_TRUE(block(43, 10, 1));
  const SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 4u);
  EXPECT_EQ(meta.captures[1].sample_start, 10u);
  EXPECT_EQ(meta.captures[1].global_index, 15u);
  EXPECT_EQ(meta.captures[2].epoch, 1u);
  EXPECT_EQ(meta.captures[2].epoch_reason, EpochReason::unknown_loss);
  EXPECT_EQ(meta.captures[2].epoch_first_sample, 10u);
  EXPECT_EQ(meta.captures[3].epoch, 1u);
  EXPECT_EQ(meta.captures[3].global_index, 43u);
  EXPECT_EQ(index_.gaps(), 2u);
  EXPECT_EQ(index_.lost_frames(), 5u + 3u);
}

TEST_F(RecordingIndexTest, BlockThatIsNotWrittenLeavesNoTrace) {
  block(0, 10);
  BlockHeader header;
  header.first_sample = 20;
  header.frames = 10;
  header.marks[0] = line(20, 5);
  header.mark_count = 1;
  index_.begin_block(header, start_utc);
  EXPECT_EQ(index_.meta().captures.size(), 2u);  // announced
  index_.abandon_block();
  EXPECT_EQ(index_.meta().captures.size(), 1u);
  EXPECT_EQ(index_.frames(), 10u);
  EXPECT_TRUE(index_.meta().lines.empty());
}

TEST_F(RecordingIndexTest, LinesStateWhatSurvivesOfThem) {
  block(100, 20, 0, {line(105, 10, 0), line(118, 10, 1)});
  block(125, 20, 0, {line(121, 3, 2), line(140, 30, 3)});  // 120..124 lost; the file has 100..119, 125..144
  index_.add_line({0, 4, Direction::trace, 90, 12});       // begun before the recording
  index_.add_line({0, 5, Direction::trace, 145, 5});       // still to come
  index_.add_line({0, 6, Direction::trace, 80, 20});       // over before the recording
  const SigmfMeta meta = index_.meta();
  std::vector<std::array<std::uint64_t, 3>> found;
  for (const SigmfLine& entry : meta.lines)
    found.push_back({entry.mark.line, entry.sample_start, entry.sample_count});
  const std::vector<std::array<std::uint64_t, 3>> expected{
      {4, 0, 2}, {0, 5, 10}, {1, 18, 5}, {2, 20, 0}, {3, 35, 5}};
  EXPECT_EQ(found, expected);
}

TEST_F(RecordingIndexTest, ChangeStartsACaptureWhereverTheWriterIs) {
  block(0, 100);
  index_.add_change(40, described(310.0));   // behind the writer
  index_.add_change(150, described(320.0));  // ahead of it
  SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 2u);
  EXPECT_EQ(meta.captures[1].sample_start, 40u);
  EXPECT_EQ(meta.captures[1].global_index, 40u);
  EXPECT_EQ(meta.captures[1].datetime, "2023-11-14T22:13:20.040000Z");
  EXPECT_EQ(meta.captures[1].changes, described(310.0));
  block(100, 100);
  index_.add_change(20, described(305.0));  // noted late
  meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 4u);
  EXPECT_EQ(meta.captures[1].changes, described(305.0));
  EXPECT_EQ(meta.captures[2].changes, described(310.0));
  EXPECT_EQ(meta.captures[3].sample_start, 150u);
  EXPECT_EQ(meta.description, described(300.0));
}

TEST_F(RecordingIndexTest, OnlyWhatDiffersIsCarried) {
  Description both = described(300.0);
  both.comb = Comb{10, {{1, true}}};
  block(0, 100);
  index_.add_change(10, described(300.0));
  index_.add_change(20, both);
  const SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 2u);
  EXPECT_EQ(meta.captures[1].sample_start, 20u);
  EXPECT_FALSE(meta.captures[1].changes.noise);
  EXPECT_EQ(meta.captures[1].changes.comb, both.comb);
}

TEST_F(RecordingIndexTest, ChangeBeforeTheFirstSampleIsGlobal) {
  index_.add_change(100, described(310.0));
  block(100, 10);
  index_.add_change(50, described(305.0));  // older: superseded at 100
  const SigmfMeta meta = index_.meta();
  EXPECT_EQ(meta.captures.size(), 1u);
  EXPECT_EQ(meta.description, described(310.0));
}

TEST_F(RecordingIndexTest, ChangeInAGapTakesEffectAfterIt) {
  block(0, 10);
  block(30, 10);
  index_.add_change(20, described(310.0));
  index_.add_change(25, described(320.0));
  const SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 2u);
  EXPECT_EQ(meta.captures[1].global_index, 30u);
  EXPECT_EQ(meta.captures[1].changes, described(320.0));
}

TEST_F(RecordingIndexTest, FreeResponseCanBeDropped) {
  Description with_free = described(300.0);
  with_free.free_response = FreeResponse{5, 1, {{1.0, 0.0}}, std::nullopt};
  Description with_other = with_free;
  with_other.free_response->first_sample = 70;
  block(0, 100);
  index_.add_change(10, with_free);
  index_.add_change(50, described(300.0));
  index_.add_change(80, with_other);
  const SigmfMeta meta = index_.meta();
  ASSERT_EQ(meta.captures.size(), 4u);
  EXPECT_FALSE(meta.captures[1].drops_free_response);
  EXPECT_TRUE(meta.captures[2].drops_free_response);
  EXPECT_EQ(meta.captures[3].changes.free_response, with_other.free_response);
  Description in_force = meta.description;
  for (std::size_t i = 0; i < 3; ++i) in_force = in_force_from(meta.captures[i], in_force);
  EXPECT_EQ(in_force, described(300.0));
}

TEST_F(RecordingIndexTest, StepsAndEndsOfScansGoToTheirCapture) {
  block(100, 10, 0, {{StreamMark::Kind::step, 104, {}}});
  block(120, 10, 0, {{StreamMark::Kind::step, 115, {}}, {StreamMark::Kind::scan_ended, 121, {}}});
  const SigmfMeta meta = index_.meta();
  EXPECT_EQ(meta.captures[0].steps, (std::vector<std::uint64_t>{104, 115}));
  EXPECT_EQ(meta.captures[1].scan_ends, (std::vector<std::uint64_t>{121}));
}

// Against an oracle that knows nothing of segments: the stream index of every frame in the file, searched
// from end to end. What is encoded must also pass the reader's checks of order and ranges.
TEST(RecordingIndexProperty, AgreesWithAListOfEveryFrame) {
  std::mt19937_64 random(7);
  const auto draw = [&](std::uint64_t most) { return random() % (most + 1); };
  for (int round = 0; round < 200; ++round) {
    RecordingIndex index(info(), described(300.0), Json());
    std::vector<std::uint64_t> stream_of_frame;
    std::vector<LineMark> lines;
    std::uint64_t next = draw(50);
    BlockHeader header;
    for (int block = 0; block < 30; ++block) {
      if (draw(3) == 0) next += draw(20);
      if (draw(9) == 0) {
        ++header.epoch;
        header.epoch_reason = EpochReason::clock_change;
      }
      header.first_sample = next;
      header.frames = static_cast<std::uint32_t>(1 + draw(9));
      index.begin_block(header, start_utc);
      index.end_block();
      for (std::uint32_t i = 0; i < header.frames; ++i) stream_of_frame.push_back(next++);
      if (draw(1) == 0) {
        lines.push_back(
            {0, static_cast<std::uint32_t>(block), Direction::trace, draw(next + 20), 1 + draw(40)});
        index.add_line(lines.back());
      }
      if (draw(4) == 0) index.add_change(draw(next + 20), described(static_cast<double>(round + block)));
    }
    const SigmfMeta meta = index.meta();
    for (std::uint64_t frame = 0; frame < stream_of_frame.size(); ++frame)
      ASSERT_EQ(stream_index(meta.captures, frame), stream_of_frame[frame]);
    std::size_t expected_lines = 0;
    for (const LineMark& line : lines) {
      const std::uint64_t end = line.first_sample + line.line_samples;
      if (line.first_sample > stream_of_frame.back() || end <= stream_of_frame.front()) continue;
      ++expected_lines;
      const auto survives = [&](std::uint64_t sample) { return sample >= line.first_sample && sample < end; };
      const auto found =
          std::ranges::find_if(meta.lines, [&](const SigmfLine& entry) { return entry.mark == line; });
      ASSERT_NE(found, meta.lines.end());
      EXPECT_EQ(found->sample_count,
                static_cast<std::uint64_t>(std::ranges::count_if(stream_of_frame, survives)));
      const auto first = std::ranges::find_if(
          stream_of_frame, [&](std::uint64_t sample) { return sample >= line.first_sample; });
      EXPECT_EQ(found->sample_start, static_cast<std::uint64_t>(first - stream_of_frame.begin()));
    }
    EXPECT_EQ(meta.lines.size(), expected_lines);
    EXPECT_NO_THROW(parse_sigmf_meta(parse_json(encode_sigmf(meta).dump(), "r"), "r"));
  }
}

}  // namespace
}  // namespace combforce
