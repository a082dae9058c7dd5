#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <numeric>

#include "drivers/replay/replay_digitizer.hpp"
#include "drivers/sha512.hpp"
#include "tests/support/digitizer_run.hpp"
#include "tests/support/temporary_directory.hpp"

namespace combforce {
namespace {

using test::codes_of;
using test::run_to_end;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// A recording written by hand: `data` as it stands, the metadata as text, so that nothing of the recorder or
// the metadata encoder takes part.
class ReplayTest : public ::testing::Test {
 protected:
  void write(const std::string& data, const std::string& captures = R"([{"core:sample_start": 0}])",
             const std::string& annotations = "[]", const std::string& datatype = "ri16_le", int channels = 1,
             const std::string& more = "") {
    test::write_file(directory_ / "r.sigmf-data", data);
    test::write_file(
        directory_ / "r.sigmf-meta",
        fmt::format(R"({{"global": {{"core:datatype": "{}", "core:version": "1.2.5", "core:sample_rate": 1000,
                       "core:num_channels": {}{}}}, "captures": {}, "annotations": {}}})",
                    datatype, channels, more, captures, annotations));
  }
  ReplayDigitizer open(std::uint32_t block_frames = 16, bool verify = true) {
    return ReplayDigitizer(directory_ / "r", {.verify = verify, .block_frames = block_frames});
  }

  test::TemporaryDirectory directory_;
};

// ri16_le codes first, first + 1, …
std::string ramp(std::size_t count, int first = 0) {
  std::string bytes;
  for (std::size_t i = 0; i < count; ++i) {
    const auto code = static_cast<std::uint16_t>(first + static_cast<int>(i));
    bytes.push_back(static_cast<char>(code & 0xff));
    bytes.push_back(static_cast<char>(code >> 8));
  }
  return bytes;
}

std::vector<double> numbers(std::size_t count, double first = 0.0) {
  std::vector<double> values(count);
  std::iota(values.begin(), values.end(), first);
  return values;
}

TEST_F(ReplayTest, DeliversTheFileFromTheFirstGlobalIndexOn) {
  write(ramp(100, -50), R"([{"core:sample_start": 0, "core:global_index": 7000}])");
  ReplayDigitizer digitizer = open();
  EXPECT_EQ(digitizer.info().sample_rate_hz, 1000.0);
  EXPECT_EQ(digitizer.info().when_full, WhenFull::wait);
  EXPECT_FALSE(digitizer.info().marks_lines);
  EXPECT_THAT(digitizer.warnings(), IsEmpty());
  EXPECT_EQ(digitizer.status().next_sample, 7000u);
  const auto blocks = run_to_end(digitizer);
  EXPECT_EQ(codes_of(blocks), numbers(100, -50.0));
  EXPECT_EQ(blocks.front().header.first_sample, 7000u);
  EXPECT_EQ(digitizer.status().state, StreamState::ended);
  EXPECT_EQ(digitizer.status().next_sample, 7100u);
}

struct Datatype {
  std::string name, bytes;
  std::vector<double> codes;
  SampleFormat format;
  double clip_lo;
};

class ReplayDatatypeTest : public ReplayTest, public ::testing::WithParamInterface<Datatype> {};

TEST_P(ReplayDatatypeTest, IsConverted) {
  const Datatype& type = GetParam();
  write(type.bytes, R"([{"core:sample_start": 0}])", "[]", type.name, 2);
  ReplayDigitizer digitizer = open(1);
  EXPECT_EQ(digitizer.info().format, type.format);
  EXPECT_EQ(digitizer.info().channels.size(), 2u);
  const auto clip = digitizer.info().channels[0].clip_codes;
  EXPECT_EQ(clip ? clip->lo : -1.0, type.clip_lo);
  const auto blocks = run_to_end(digitizer);
  EXPECT_EQ(blocks.size(), 2u);
  EXPECT_EQ(codes_of(blocks), type.codes);
}

using namespace std::string_literals;
INSTANTIATE_TEST_SUITE_P(
    AllReadable, ReplayDatatypeTest,
    ::testing::Values(
        Datatype{
            "ri16_le", "\x01\x00\xff\xff\x00\x80\xff\x7f"s, {1, -1, -32768, 32767}, SampleFormat::i16, -1},
        Datatype{
            "ri16_be", "\x00\x01\xff\xff\x80\x00\x7f\xff"s, {1, -1, -32768, 32767}, SampleFormat::i16, -1},
        Datatype{"ri8", "\x01\xff\x80\x7f"s, {1, -1, -128, 127}, SampleFormat::i16, -128},
        Datatype{"ru8", "\x01\xff\x80\x7f"s, {1, 255, 128, 127}, SampleFormat::i16, 0},
        Datatype{"rf32_le",
                 "\0\0\xc0\x3f\0\0\0\xc0\0\0\x80\x3e\0\0\0\0"s,
                 {1.5, -2, 0.25, 0},
                 SampleFormat::f32,
                 -1}),
    [](const auto& test) { return test.param.name; });

TEST_F(ReplayTest, JumpsOfTheGlobalIndexAreLosses) {
  write(ramp(30), R"([{"core:sample_start": 0, "core:global_index": 100},
                      {"core:sample_start": 10, "core:global_index": 110},
                      {"core:sample_start": 15, "core:global_index": 122},
                      {"core:sample_start": 25, "core:global_index": 200, "afm:epoch": 2, "afm:epoch_reason": "device_restart",
                       "afm:epoch_first_sample": 190}])");
  ReplayDigitizer digitizer = open();
  const auto blocks = run_to_end(digitizer);
  ASSERT_EQ(blocks.size(), 3u);  // the contiguous capture at 10 cuts no block
  EXPECT_EQ(blocks[0].header.frames, 15u);
  EXPECT_EQ(blocks[0].header.lost_before, 0u);
  EXPECT_EQ(blocks[1].header.first_sample, 122u);
  EXPECT_EQ(blocks[1].header.lost_before, 7u);
  EXPECT_EQ(blocks[1].header.epoch, 0u);
  EXPECT_EQ(blocks[2].header.first_sample, 200u);
  EXPECT_EQ(blocks[2].header.lost_before, 0u);
  EXPECT_EQ(blocks[2].header.epoch, 2u);
  EXPECT_EQ(blocks[2].header.epoch_reason, EpochReason::device_restart);
  EXPECT_EQ(blocks[1].header.epoch_first_sample, 0u);
  EXPECT_EQ(blocks[2].header.epoch_first_sample, 190u);
  EXPECT_EQ(codes_of(blocks), numbers(30));
  EXPECT_EQ(digitizer.status().lost_frames, 7u);
  EXPECT_EQ(digitizer.status().epoch, 2u);
}

TEST_F(ReplayTest, LinesAndStepsTravelWithTheirBlocks) {
  write(
      ramp(40), R"([{"core:sample_start": 0, "afm:steps": [17]},
                      {"core:sample_start": 20, "core:global_index": 30, "afm:steps": [47], "afm:scan_ends": [47]}])",
      R"([{"core:sample_start": 5, "core:sample_count": 10, "core:label": "line", "afm:line": 3, "afm:frame": 2,
             "afm:direction": "retrace", "afm:first_sample": 5, "afm:line_samples": 10},
            {"core:sample_start": 20, "core:sample_count": 5, "core:label": "line", "afm:line": 4,
             "afm:first_sample": 25, "afm:line_samples": 10}])");
  ReplayDigitizer digitizer = open(10);
  EXPECT_TRUE(digitizer.info().marks_lines);
  const auto blocks = run_to_end(digitizer);
  ASSERT_EQ(blocks.size(), 4u);
  const auto first = blocks[0].header.valid_marks();
  ASSERT_EQ(first.size(), 1u);
  EXPECT_EQ(first[0].line, (LineMark{2, 3, Direction::retrace, 5, 10}));
  EXPECT_EQ(first[0].sample, 5u);
  ASSERT_EQ(blocks[1].header.mark_count, 1u);
  EXPECT_EQ(blocks[1].header.marks[0].kind, StreamMark::Kind::step);
  EXPECT_EQ(blocks[1].header.marks[0].sample, 17u);
  ASSERT_EQ(blocks[2].header.mark_count, 1u);  // its first sample was lost: the first block after it
  EXPECT_EQ(blocks[2].header.first_sample, 30u);
  EXPECT_EQ(blocks[2].header.marks[0].sample, 25u);
  EXPECT_EQ(blocks[2].header.marks[0].line.line, 4u);
  ASSERT_EQ(blocks[3].header.mark_count, 2u);
  EXPECT_EQ(blocks[3].header.marks[0].kind, StreamMark::Kind::step);
  EXPECT_EQ(blocks[3].header.marks[1].kind, StreamMark::Kind::scan_ended);
}

TEST_F(ReplayTest, BlockEndsBeforeItWouldHoldTooManyMarks) {
  std::vector<int> steps(40);
  for (int i = 0; i < 40; ++i) steps[static_cast<std::size_t>(i)] = 2 * i;
  write(ramp(100), fmt::format(R"([{{"core:sample_start": 0, "afm:steps": [{}]}}])", fmt::join(steps, ",")));
  ReplayDigitizer digitizer = open(100);
  const auto blocks = run_to_end(digitizer);
  std::vector<std::uint64_t> seen;
  for (const SampleBlock& block : blocks) {
    for (const StreamMark& mark : block.header.valid_marks()) {
      EXPECT_GE(mark.sample, block.header.first_sample);
      EXPECT_LT(mark.sample, block.header.first_sample + block.header.frames);
      seen.push_back(mark.sample);
    }
  }
  ASSERT_EQ(seen.size(), 40u);
  for (std::uint64_t i = 0; i < 40; ++i) EXPECT_EQ(seen[i], 2 * i);
  EXPECT_EQ(codes_of(blocks), numbers(100));
}

// sha512 of "abc" (FIPS 180-2, appendix C.1) and of the empty string.
constexpr const char* sha_abc =
    "ddaf35a193617abacc417349ae20413112e6fa4e89a97ea20a9eeee64b55d39a"
    "2192992a274fc1a836ba3c23a3feebbd454d4423643ce80e2a9ac94fa54ca49f";
constexpr const char* sha_empty =
    "cf83e1357eefb8bdf1542850d66d8007d620e4050b5715dc83f4a921d36ce9ce"
    "47d0d13c5d85f2b0ff8318d2877eec2f63b931bd47417a81a538327af927da3e";

TEST(Sha512, KnownAnswers) {
  Sha512 hash;
  EXPECT_EQ(hash.hex(), sha_empty);
  hash.update("a", 1);
  EXPECT_NE(hash.hex(), sha_abc);  // asking does not disturb
  hash.update("bc", 2);
  EXPECT_EQ(hash.hex(), sha_abc);
}

TEST_F(ReplayTest, MatchingHashIsAccepted) {
  write("abc", R"([{"core:sample_start": 0}])", "[]", "ri8", 1,
        fmt::format(R"(, "core:sha512": "{}")", sha_abc));
  ReplayDigitizer digitizer = open();
  EXPECT_EQ(run_to_end(digitizer).size(), 1u);
  EXPECT_EQ(digitizer.status().state, StreamState::ended) << digitizer.status().reason;
}

TEST_F(ReplayTest, WithoutAHashOurOwnRecordingWasNotClosed) {
  const std::string ours = R"(, "core:recorder": "combforce")", others = R"(, "core:recorder": "someone's")";
  write(ramp(10), R"([{"core:sample_start": 0}])", "[]", "ri16_le", 1, ours);
  EXPECT_THAT(open().warnings(), ElementsAre(HasSubstr("was not closed")));
  write(ramp(10), R"([{"core:sample_start": 0}])", "[]", "ri16_le", 1, others);
  EXPECT_THAT(open().warnings(), IsEmpty());
}

TEST_F(ReplayTest, WrongHashFailsTheStreamAfterItsLastBlock) {
  write("abd", R"([{"core:sample_start": 0}])", "[]", "ri8", 1,
        fmt::format(R"(, "core:sha512": "{}")", sha_abc));
  ReplayDigitizer digitizer = open();
  EXPECT_THAT(codes_of(run_to_end(digitizer)), ElementsAre('a', 'b', 'd'));
  EXPECT_EQ(digitizer.status().state, StreamState::failed);
  EXPECT_THAT(digitizer.status().reason, HasSubstr("r.sigmf-data"));
  EXPECT_THAT(digitizer.status().reason, HasSubstr(sha_abc));
  ReplayDigitizer unverified = open(16, false);
  run_to_end(unverified);
  EXPECT_EQ(unverified.status().state, StreamState::ended);
}

TEST_F(ReplayTest, OddBytesAtTheEndAreLeftOutWithAWarning) {
  write(ramp(10) + "xyz", R"([{"core:sample_start": 0}])", "[]", "ri16_le", 2);
  ReplayDigitizer digitizer = open();
  EXPECT_THAT(digitizer.warnings(), ElementsAre(HasSubstr("last 3 bytes")));
  EXPECT_EQ(codes_of(run_to_end(digitizer)), numbers(10));
}

TEST_F(ReplayTest, DataShorterThanDescribedIsStatedAndReplayed) {
  write(ramp(30), R"([{"core:sample_start": 0}, {"core:sample_start": 50, "core:global_index": 90}])",
        R"([{"core:sample_start": 20, "core:sample_count": 20, "core:label": "line", "afm:line": 0,
             "afm:first_sample": 20, "afm:line_samples": 20},
            {"core:sample_start": 50, "core:sample_count": 5, "core:label": "line", "afm:line": 1,
             "afm:first_sample": 90, "afm:line_samples": 5}])");
  ReplayDigitizer digitizer = open();
  EXPECT_THAT(digitizer.warnings(),
              ElementsAre(HasSubstr("capture starts past the end"), HasSubstr("line begins past the end"),
                          HasSubstr("line reaches past the end")));
  const auto blocks = run_to_end(digitizer);
  EXPECT_EQ(codes_of(blocks), numbers(30));
  EXPECT_EQ(blocks[0].header.mark_count + blocks[1].header.mark_count, 1u);
}

TEST_F(ReplayTest, EmptyDataEndsAtOnceWithAWarning) {
  write("");
  ReplayDigitizer digitizer = open();
  EXPECT_THAT(digitizer.warnings(), ElementsAre(HasSubstr("no samples")));
  EXPECT_THAT(run_to_end(digitizer), IsEmpty());
  EXPECT_EQ(digitizer.status().state, StreamState::ended);
}

TEST_F(ReplayTest, FileThatShrinksWhileReadFailsTheStream) {
  write(ramp(100000));
  ReplayDigitizer digitizer = open();
  std::filesystem::resize_file(directory_ / "r.sigmf-data", 70001);
  const auto blocks = run_to_end(digitizer);
  EXPECT_EQ(digitizer.status().state, StreamState::failed);
  EXPECT_THAT(digitizer.status().reason, HasSubstr("r.sigmf-data"));
  const auto codes = codes_of(blocks);
  ASSERT_EQ(codes.size(), 34992u);  // 2187 whole blocks of 16 lie before byte 70001
  EXPECT_EQ(codes.back(), static_cast<double>(static_cast<std::int16_t>(34991)));
}

TEST_F(ReplayTest, MissingFilesAreNamed) {
  write(ramp(1));
  std::filesystem::remove(directory_ / "r.sigmf-data");
  try {
    open();
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.file(), directory_ / "r.sigmf-data");
    EXPECT_THAT(error.what(), HasSubstr("No such file"));
  }
  std::filesystem::create_directory(directory_ / "r.sigmf-data");
  EXPECT_THROW(open(), InputError);
  try {
    ReplayDigitizer digitizer(directory_ / "absent");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.file(), directory_ / "absent.sigmf-meta");
  }
}

TEST_F(ReplayTest, BadOptionsAreNamed) {
  write(ramp(1));
  try {
    open(0);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("block_frames: 0 is outside 1..1048576"));
  }
}

TEST_F(ReplayTest, WideFramesMakeBlocksOfFewerFrames) {
  write(std::string(std::size_t{65535} * 2, '\0'), R"([{"core:sample_start": 0}])", "[]", "ri16_le", 65535);
  ReplayDigitizer digitizer = open(16384);
  EXPECT_EQ(digitizer.info().block_frames, (1u << 24) / (65535u * 2));
  EXPECT_EQ(run_to_end(digitizer, 1).size(), 1u);
}

TEST_F(ReplayTest, RealtimeTakesAtLeastTheRecordedTime) {
  write(ramp(60));
  ReplayDigitizer digitizer(directory_ / "r", {.realtime = true, .block_frames = 10});
  EXPECT_EQ(digitizer.info().when_full, WhenFull::drop);
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(codes_of(run_to_end(digitizer)).size(), 60u);
  EXPECT_GE(std::chrono::steady_clock::now() - begun, std::chrono::milliseconds(60));
  EXPECT_LE(digitizer.status().realtime_factor, 1.0);
}

TEST_F(ReplayTest, StopEndsAPauseAndAWaitForRoom) {
  write(ramp(10000));
  ReplayDigitizer slow(directory_ / "r", {.realtime = true, .block_frames = 10000});
  BlockSink live(1, 20000, WhenFull::drop);
  slow.start(live);
  slow.stop();  // returns long before the 10 s that the first block lasts
  EXPECT_EQ(slow.status().state, StreamState::ended);
  EXPECT_EQ(slow.status().reason, "stopped");
  EXPECT_EQ(live.next_sample(), 0u);

  ReplayDigitizer blocked = open();
  BlockSink full(1, 32, WhenFull::wait);
  blocked.start(full);  // nobody takes blocks
  blocked.stop();
  EXPECT_TRUE(full.closed());
}

TEST(ReplayMeasured, CantileverStream) {
  const std::string recording = std::string(COMBFORCE_SHARED_DIR) + "/data/jam_cantilever_1p15MSps";
  if (!std::filesystem::exists(recording + ".sigmf-meta"))
    GTEST_SKIP() << "no measured recording at " << recording;
  ReplayDigitizer digitizer(recording);
  EXPECT_THAT(digitizer.warnings(), IsEmpty());
  EXPECT_EQ(digitizer.info().sample_rate_hz, 1.15e6);
  EXPECT_EQ(codes_of(run_to_end(digitizer)).size(), 762375u);
  EXPECT_EQ(digitizer.status().state, StreamState::ended) << digitizer.status().reason;  // sha512 included
}

}  // namespace
}  // namespace combforce
