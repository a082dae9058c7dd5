#include "daemon/record/recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <thread>

#include "recorded_source.hpp"
#include "tests/support/temporary_directory.hpp"

namespace combforce {
namespace {

using test::RecordedSource;
using test::replay_and_check;
using test::source_frames;
using test::source_info;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::uint64_t frame_bytes = 4;

StreamMark line_at(std::uint64_t first_sample, std::uint64_t samples, std::uint32_t number) {
  return {StreamMark::Kind::line, first_sample, {0, number, Direction::trace, first_sample, samples}};
}

class RecorderTest : public ::testing::Test {
 protected:
  std::vector<Event> events() {
    const std::lock_guard lock(mutex_);
    return events_;
  }

  test::TemporaryDirectory directory_;
  const std::string rec_ = directory_ / "rec";
  std::mutex mutex_;
  std::vector<Event> events_;
  BlockSink sink_{8, source_frames* frame_bytes, WhenFull::wait};
  Recorder recorder_{source_info(), sink_, [this](const Event& event) {
                       const std::lock_guard lock(mutex_);
                       events_.push_back(event);
                     }};
  RecordedSource source_{sink_, 1000};
};

TEST_F(RecorderTest, ReplaysWhatWasRecorded) {
  Description description;
  description.channels = source_info().channels;
  for (int i = 0; i < 5; ++i) source_.push();  // before the recording
  recorder_.start(rec_, description, Json{{"file", "rec.truth.ndjson"}});
  EXPECT_TRUE(recorder_.running());
  const std::uint64_t first = source_.next();
  const StreamMark line = line_at(first + 10, 500, 3);
  source_.push({line});
  for (int i = 0; i < 50; ++i) source_.push();
  source_.lose(17);
  const std::uint64_t after_gap = source_.next();
  source_.push({{StreamMark::Kind::step, after_gap + 1, {}}});
  source_.push({{StreamMark::Kind::scan_ended, source_.next() + 5, {}}});
  source_.break_clock();
  const std::uint64_t epoch_begin = source_.next();
  source_.push();
  const RecordingSummary summary = recorder_.stop();
  EXPECT_FALSE(recorder_.running());
  EXPECT_EQ(summary.meta_path, rec_ + ".sigmf-meta");
  EXPECT_EQ(summary.first_sample, first);
  EXPECT_EQ(summary.frames, 54u * source_frames);
  EXPECT_EQ(summary.gaps, 1u);
  EXPECT_EQ(summary.lost_frames, 17u);
  EXPECT_TRUE(summary.complete) << summary.failure;
  EXPECT_EQ(recorder_.summary().frames, summary.frames);
  ASSERT_EQ(events().size(), 1u);
  EXPECT_EQ(events()[0].kind, "record_gap");
  EXPECT_EQ(events()[0].first_sample, after_gap - 17);
  EXPECT_EQ(events()[0].count, 17u);

  const auto blocks = replay_and_check(rec_);
  std::uint64_t frames = 0;
  std::vector<StreamMark> marks;
  for (const SampleBlock& block : blocks) {
    frames += block.header.frames;
    for (const StreamMark& mark : block.header.valid_marks()) marks.push_back(mark);
  }
  EXPECT_EQ(frames, summary.frames);
  EXPECT_EQ(blocks.front().header.first_sample, first);
  EXPECT_EQ(blocks[1].header.lost_before, 17u);
  EXPECT_EQ(blocks.back().header.epoch, 1u);
  EXPECT_EQ(blocks.back().header.epoch_reason, EpochReason::device_restart);
  EXPECT_EQ(blocks.back().header.first_sample, epoch_begin);
  ASSERT_EQ(marks.size(), 3u);
  EXPECT_EQ(marks[0].line, line.line);
  EXPECT_EQ(marks[1].kind, StreamMark::Kind::step);
  EXPECT_EQ(marks[1].sample, after_gap + 1);
  EXPECT_EQ(marks[2].kind, StreamMark::Kind::scan_ended);

  const SigmfMeta meta = read_sigmf_meta(rec_ + ".sigmf-meta");
  EXPECT_THAT(meta.warnings, IsEmpty());
  EXPECT_TRUE(meta.sha512);
  EXPECT_EQ(meta.description, description);
  EXPECT_EQ(meta.truth, (Json{{"file", "rec.truth.ndjson"}}));
  EXPECT_EQ(meta.lines[0].sample_start, 10u);
  EXPECT_EQ(meta.lines[0].sample_count, 500u);
  EXPECT_FALSE(std::filesystem::exists(rec_ + ".sigmf-meta.tmp"));
  EXPECT_FALSE(std::filesystem::exists(rec_ + ".sigmf-meta.new"));
}

TEST_F(RecorderTest, ChangesAndClientsLinesReachTheMetadata) {
  Description description;
  description.noise = Noise{300.0, {0.0}};
  recorder_.start(rec_, description, Json());
  const std::uint64_t first = source_.next();
  for (int i = 0; i < 10; ++i) source_.push();
  description.noise->temperature_k = 310.0;
  recorder_.note_change(first + 100, description);
  recorder_.note_line({1, 2, Direction::retrace, first + 50, 20});
  recorder_.stop();
  const SigmfMeta meta = read_sigmf_meta(rec_ + ".sigmf-meta");
  ASSERT_EQ(meta.captures.size(), 2u);
  EXPECT_EQ(meta.captures[1].sample_start, 100u);
  EXPECT_EQ(meta.captures[1].changes.noise->temperature_k, 310.0);
  ASSERT_EQ(meta.lines.size(), 1u);
  EXPECT_EQ(meta.lines[0].mark, (LineMark{1, 2, Direction::retrace, first + 50, 20}));
  recorder_.note_change(0, description);  // without a recording: ignored
  recorder_.note_line({});
}

// Within about a second, and without anything further from the stream.
TEST_F(RecorderTest, MarksReachTheDiskWhileRecording) {
  recorder_.start(rec_, {}, Json());
  source_.push();
  source_.push({line_at(source_.next(), 10, 0)});
  while (read_sigmf_meta(rec_ + ".sigmf-meta").lines.empty())
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(recorder_.running());
  EXPECT_FALSE(read_sigmf_meta(rec_ + ".sigmf-meta").sha512);
}

TEST_F(RecorderTest, ExistingFilesAreRefusedAndKept) {
  for (const std::string suffix : {".sigmf-data", ".sigmf-meta"}) {
    test::write_file(rec_ + suffix, "precious");
    try {
      recorder_.start(rec_, {}, Json());
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr(rec_ + suffix + ": exists"));
    }
    EXPECT_FALSE(recorder_.running());
    EXPECT_FALSE(sink_.recording());
    EXPECT_EQ(test::read_file(rec_ + suffix), "precious");
    std::filesystem::remove(rec_ + suffix);
  }
  EXPECT_THROW(recorder_.start(directory_ / "absent/rec", {}, Json()), std::runtime_error);
}

TEST_F(RecorderTest, OneRecordingAtATime) {
  EXPECT_THROW(recorder_.stop(), std::logic_error);
  recorder_.start(rec_, {}, Json());
  EXPECT_THROW(recorder_.start(directory_ / "other", {}, Json()), std::logic_error);
  source_.push();
  recorder_.stop();
  EXPECT_THROW(recorder_.stop(), std::logic_error);
  source_.push();
  recorder_.start(directory_ / "second", {}, Json());
  source_.push();
  EXPECT_EQ(recorder_.stop().first_sample, 1000u + 2 * source_frames);
  EXPECT_EQ(replay_and_check(directory_ / "second").size(), 1u);
}

TEST_F(RecorderTest, EndOfTheStreamClosesTheRecording) {
  recorder_.start(rec_, {}, Json());
  source_.push();
  sink_.close();
  while (recorder_.running()) std::this_thread::yield();
  EXPECT_TRUE(read_sigmf_meta(rec_ + ".sigmf-meta").sha512);
  const RecordingSummary summary = recorder_.stop();
  EXPECT_TRUE(summary.complete);
  EXPECT_EQ(summary.frames, source_frames);
}

TEST_F(RecorderTest, NothingRecordedIsAnEmptyRecording) {
  recorder_.start(rec_, {}, Json());
  EXPECT_TRUE(recorder_.stop().complete);
  EXPECT_THAT(replay_and_check(rec_), IsEmpty());
}

// For the duration of a test no file may grow beyond `bytes`: write() fails with EFBIG, as it does with
// ENOSPC on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST_F(RecorderTest, WriteErrorEndsTheRecordingNotTheStream) {
  constexpr std::uint64_t block = source_frames * frame_bytes;
  const FileSizeLimit limit(100 * block + 10);  // fails within the 101st block
  recorder_.start(rec_, {}, Json());
  std::uint64_t delivered = 0;
  for (int i = 0; i < 500; ++i) delivered += source_.push({line_at(source_.next(), 10, 0)}) ? 1 : 0;
  EXPECT_EQ(delivered, 500u);
  while (recorder_.running()) std::this_thread::yield();
  ASSERT_EQ(events().size(), 1u);
  EXPECT_EQ(events()[0].kind, "record_failed");
  EXPECT_THAT(events()[0].text, HasSubstr("rec.sigmf-data: cannot write: File too large"));
  const RecordingSummary summary = recorder_.stop();
  EXPECT_FALSE(summary.complete);
  EXPECT_EQ(summary.failure, events()[0].text);
  EXPECT_EQ(summary.frames, 100u * source_frames);
  EXPECT_EQ(std::filesystem::file_size(rec_ + ".sigmf-data"), 100 * block);
  const auto blocks = replay_and_check(rec_);  // the hash fits what is there
  EXPECT_EQ(test::codes_of(blocks).size(), 2u * 100 * source_frames);
  EXPECT_TRUE(source_.push());
}

TEST_F(RecorderTest, MetadataThatCannotBeWrittenEndsTheRecording) {
  recorder_.start(rec_, {}, Json());
  source_.push();
  while (recorder_.summary().frames == 0) std::this_thread::yield();
  std::filesystem::remove_all(std::filesystem::path(rec_).parent_path());
  source_.lose(1);  // a gap is stated before the samples after it are written
  source_.push();
  while (recorder_.running()) std::this_thread::yield();
  const RecordingSummary summary = recorder_.stop();
  EXPECT_THAT(summary.failure, HasSubstr("rec.sigmf-meta"));
  EXPECT_EQ(summary.frames, source_frames);
  EXPECT_EQ(events().back().kind, "record_failed");
  EXPECT_TRUE(source_.push());
}

TEST_F(RecorderTest, StreamThatRunsBackwardsEndsTheRecording) {
  recorder_.start(rec_, {}, Json());
  source_.push();
  RecordedSource other(sink_, 5);
  other.push();
  while (recorder_.running()) std::this_thread::yield();
  EXPECT_THAT(recorder_.stop().failure, HasSubstr("runs backwards, from 1064 to 5"));
  EXPECT_EQ(replay_and_check(rec_).size(), 1u);
}

// A live source that nobody waits for: what the recorder's ring drops must be in the recording as gaps.
TEST(RecorderLive, DropsAreGaps) {
  test::TemporaryDirectory directory;
  BlockSink sink(2, source_frames * frame_bytes, WhenFull::drop);
  Recorder recorder(source_info(WhenFull::drop), sink, {});
  RecordedSource source(sink);
  recorder.start(directory / "rec", {}, Json());
  const std::uint64_t blocks = 20000;
  for (std::uint64_t i = 0; i < blocks; ++i) source.push();
  const RecordingSummary summary = recorder.stop();
  EXPECT_TRUE(summary.complete) << summary.failure;
  EXPECT_EQ(summary.frames + sink.dropped_recorder(), blocks * source_frames);
  EXPECT_LE(summary.lost_frames,
            sink.dropped_recorder());  // drops after the last block written are in no gap
  replay_and_check(directory / "rec");
}

// python3-jsonschema with the standard's own schema, and hashlib: nothing of this project judges.
TEST_F(RecorderTest, PassesTheSchemaAndTheChecksItMisses) {
  const std::string schema = std::string(COMBFORCE_SHARED_DIR) + "/sigmf/sigmf-schema.json";
  if (!std::filesystem::exists(schema)) GTEST_SKIP() << "no schema at " << schema;
  if (std::system("/usr/bin/python3 -c 'import jsonschema' 2>/dev/null") != 0)
    GTEST_SKIP() << "python3-jsonschema is not installed";
  Description description;
  description.channels = source_info().channels;
  recorder_.start(rec_, description, Json());
  for (std::uint32_t i = 0; i < 100; ++i) {
    if (i % 10 == 9) source_.lose(i);
    if (i == 55) source_.break_clock();
    source_.push({line_at(source_.next(), 100, i)});
  }
  description.noise = Noise{300.0, {0.0}};
  recorder_.note_change(2000, description);
  recorder_.stop();
  const std::string command = "/usr/bin/python3 '" COMBFORCE_SOURCE_DIR
                              "/tests/support/check_recording.py' '" +
                              rec_ + "' '" + schema + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  const std::string data = test::read_file(rec_ + ".sigmf-data");
  test::write_file(rec_ + ".sigmf-data", data.substr(4));
  EXPECT_NE(std::system((command + " 2>/dev/null").c_str()), 0);  // the checks do judge
}

}  // namespace
}  // namespace combforce
