// kill -9 in the midst of a recording, and what is left.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "daemon/record/recorder.hpp"
#include "recorded_source.hpp"
#include "tests/support/temporary_directory.hpp"

namespace combforce {
namespace {

using test::RecordedSource;
using test::replay_and_check;
using test::source_frames;
using test::source_info;

// Records until killed, a gap every 50 blocks, and writes to `report` how many frames are surely in the file.
[[noreturn]] void record_for_ever(const std::string& recording, int report) {
  BlockSink sink(8, std::size_t{4} * source_frames, WhenFull::wait);
  Recorder recorder(source_info(), sink, {});
  RecordedSource source(sink, 300);
  recorder.start(recording, {}, Json());
  for (std::uint64_t i = 1;; ++i) {
    if (i % 50 == 0) source.lose(13);
    source.push();
    if (i % 10 != 0) continue;
    const std::uint64_t frames = recorder.summary().frames;
    if (::write(report, &frames, sizeof(frames)) != sizeof(frames)) ::_exit(1);
  }
}

class RecorderCrash : public ::testing::TestWithParam<int> {};

TEST_P(RecorderCrash, LeavesARecordingThatReplays) {
  const test::TemporaryDirectory directory;
  const std::string recording = directory / "rec";
  int report[2];
  ASSERT_EQ(::pipe(report), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::close(report[0]);
    record_for_ever(recording, report[1]);
  }
  ::close(report[1]);
  std::uint64_t surely_written = 0;
  for (int i = 0; i < GetParam(); ++i)
    ASSERT_EQ(::read(report[0], &surely_written, sizeof(surely_written)),
              static_cast<ssize_t>(sizeof(surely_written)));
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status)) << "the child ended by itself with status " << WEXITSTATUS(status);
  ::close(report[0]);

  EXPECT_FALSE(read_sigmf_meta(recording + ".sigmf-meta").sha512);
  const auto blocks = replay_and_check(recording);
  EXPECT_GE(test::codes_of(blocks).size(), 2 * surely_written);
  std::uint64_t lost = 0;
  for (const SampleBlock& block : blocks) {
    EXPECT_TRUE(block.header.lost_before == 0 || block.header.lost_before == 13);
    lost += block.header.lost_before;
  }
  EXPECT_GE(lost / 13, surely_written / source_frames / 50);
}

// Reports read before the kill: from the first blocks on to hundreds of gaps.
INSTANTIATE_TEST_SUITE_P(AtSomeTime, RecorderCrash, ::testing::Values(1, 5, 6, 40, 123, 600));

}  // namespace
}  // namespace combforce
