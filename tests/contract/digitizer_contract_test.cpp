// The digitizer contract (drivers/digitizer.hpp), against every digitizer there is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "tests/contract/subjects.hpp"
#include "tests/support/digitizer_run.hpp"
#include "tests/support/temporary_directory.hpp"

namespace combforce {
namespace {

using test::Subject;
using ::testing::HasSubstr;

constexpr std::size_t ample_slots = 256;

class DigitizerContract : public ::testing::TestWithParam<Subject> {
 protected:
  std::unique_ptr<Digitizer> make() { return GetParam().make(directory_ / ""); }

  // Runs until `frames` frames have come or the stream ends, then stops; what arrives after stop() counts
  // too. Statuses are taken all the while.
  void run(Digitizer& digitizer, std::uint64_t frames) {
    BlockSink sink(ample_slots, test::block_bytes(digitizer.info()), digitizer.info().when_full);
    std::atomic<bool> enough{false};
    std::thread consumer([&] {
      std::uint64_t taken = 0;
      for (bool last = false; !last;) {
        sink.wait_extraction();
        last = sink.closed();
        while (const SampleBlock* block = sink.extraction().front()) {
          headers_.push_back(block->header);
          taken += block->header.frames;
          if (taken >= frames) enough.store(true);
          sink.extraction().release();
          sink.released();
        }
      }
      enough.store(true);
    });
    statuses_.push_back(digitizer.status());
    digitizer.start(sink);
    while (!enough.load()) {
      statuses_.push_back(digitizer.status());
      std::this_thread::yield();
    }
    digitizer.stop();
    EXPECT_TRUE(sink.closed());
    statuses_.push_back(digitizer.status());
    consumer.join();
    dropped_ = sink.dropped_extraction();
  }

  test::TemporaryDirectory directory_;
  std::vector<BlockHeader> headers_;
  std::vector<StreamStatus> statuses_;
  std::uint64_t dropped_ = 0;
};

TEST_P(DigitizerContract, InfoIsComplete) {
  const auto digitizer = make();
  const StreamInfo& info = digitizer->info();
  EXPECT_GT(info.sample_rate_hz, 0.0);
  ASSERT_FALSE(info.channels.empty());
  EXPECT_EQ(info.channels[0].role, ChannelRole::deflection);
  EXPECT_GE(info.block_frames, 1u);
  EXPECT_FALSE(info.name.empty());
  EXPECT_EQ(digitizer->status().state, StreamState::idle);
}

TEST_P(DigitizerContract, BlocksKeepTheSampleIndexRule) {
  const auto digitizer = make();
  run(*digitizer, GetParam().frames);
  ASSERT_FALSE(headers_.empty());
  const StreamInfo& info = digitizer->info();
  for (std::size_t i = 0; i < headers_.size(); ++i) {
    const BlockHeader& header = headers_[i];
    EXPECT_GE(header.frames, 1u);
    EXPECT_LE(header.frames, info.block_frames);
    EXPECT_EQ(header.channels, info.channels.size());
    EXPECT_EQ(header.format, info.format);
    EXPECT_EQ(header.epoch_reason == EpochReason::start, header.epoch == 0);
    EXPECT_LE(header.epoch_first_sample, header.first_sample);
    if (i == 0) continue;
    const std::uint64_t end = headers_[i - 1].first_sample + headers_[i - 1].frames;
    if (header.epoch == headers_[i - 1].epoch) {
      EXPECT_EQ(header.first_sample, end + header.lost_before) << "block " << i;
      EXPECT_EQ(header.epoch_first_sample, headers_[i - 1].epoch_first_sample);
    } else {
      EXPECT_GT(header.epoch, headers_[i - 1].epoch);
      EXPECT_GE(header.first_sample, end) << "block " << i;
      EXPECT_GE(header.epoch_first_sample, end);
      EXPECT_EQ(header.lost_before, 0u);
    }
  }
}

TEST_P(DigitizerContract, EveryLossAndBreakIsCounted) {
  const auto digitizer = make();
  run(*digitizer, GetParam().frames);
  if (dropped_ > 0) GTEST_SKIP() << "the machine was too slow for the pace: the sink dropped " << dropped_;
  std::uint64_t lost = 0;
  std::uint32_t epochs = 1;
  for (std::size_t i = 0; i < headers_.size(); ++i) {
    lost += headers_[i].lost_before;
    if (i > 0 && headers_[i].epoch != headers_[i - 1].epoch) ++epochs;
  }
  EXPECT_EQ(lost, GetParam().lost_frames);
  EXPECT_EQ(epochs, GetParam().epochs);
  EXPECT_EQ(statuses_.back().lost_frames, lost);
  EXPECT_EQ(statuses_.back().epoch, headers_.back().epoch);
  EXPECT_EQ(statuses_.back().next_sample, headers_.back().first_sample + headers_.back().frames);
}

TEST_P(DigitizerContract, MarksLieWhereTheyBelong) {
  const auto digitizer = make();
  run(*digitizer, GetParam().frames);
  std::uint32_t lines = 0;
  std::uint64_t previous = 0, delivered_to = 0;
  for (std::size_t i = 0; i < headers_.size(); ++i) {
    const BlockHeader& header = headers_[i];
    const bool after_loss = header.lost_before > 0 || (i > 0 && header.epoch != headers_[i - 1].epoch);
    for (const StreamMark& mark : header.valid_marks()) {
      EXPECT_LT(mark.sample, header.first_sample + header.frames);
      // Earlier than the block only if its sample was lost just before.
      EXPECT_GE(mark.sample, after_loss ? delivered_to : header.first_sample);
      EXPECT_GE(mark.sample, previous);
      previous = mark.sample;
      if (mark.kind != StreamMark::Kind::line) continue;
      ++lines;
      EXPECT_EQ(mark.line.first_sample, mark.sample);
      EXPECT_GE(mark.line.line_samples, 1u);
    }
    delivered_to = header.first_sample + header.frames;
  }
  EXPECT_EQ(lines, GetParam().lines);
  EXPECT_TRUE(digitizer->info().marks_lines);
}

TEST_P(DigitizerContract, StatusOnlyGoesForward) {
  const auto digitizer = make();
  run(*digitizer, GetParam().frames);
  EXPECT_EQ(statuses_.front().state, StreamState::idle);
  EXPECT_EQ(statuses_.back().state, StreamState::ended);
  EXPECT_FALSE(statuses_.back().reason.empty());
  EXPECT_GT(statuses_.back().realtime_factor, 0.0);
  for (std::size_t i = 1; i < statuses_.size(); ++i) {
    EXPECT_GE(statuses_[i].state, statuses_[i - 1].state);
    EXPECT_GE(statuses_[i].next_sample, statuses_[i - 1].next_sample);
    EXPECT_GE(statuses_[i].epoch, statuses_[i - 1].epoch);
    EXPECT_GE(statuses_[i].lost_frames, statuses_[i - 1].lost_frames);
  }
}

TEST_P(DigitizerContract, RunsOnce) {
  const auto digitizer = make();
  run(*digitizer, 1);
  BlockSink second(2, test::block_bytes(digitizer->info()), digitizer->info().when_full);
  EXPECT_THROW(digitizer->start(second), std::logic_error);
  digitizer->stop();  // idempotent
  digitizer->stop();
  EXPECT_EQ(second.extraction().front(), nullptr);
}

TEST_P(DigitizerContract, StopsBeforeItsStart) {
  make()->stop();
}

// These end by ctest's timeout if the digitizer does not keep its word.
TEST_P(DigitizerContract, StopsThoughNobodyTakesBlocks) {
  const auto digitizer = make();
  BlockSink sink(1, test::block_bytes(digitizer->info()), digitizer->info().when_full);
  digitizer->start(sink);
  sink.wait_extraction();
  digitizer->stop();
  EXPECT_TRUE(sink.closed());
}

TEST_P(DigitizerContract, StopsAfterTheSinkWasCancelled) {
  const auto digitizer = make();
  BlockSink sink(1, test::block_bytes(digitizer->info()), digitizer->info().when_full);
  digitizer->start(sink);
  sink.cancel();
  digitizer->stop();
  EXPECT_TRUE(sink.closed());
}

TEST_P(DigitizerContract, DestructionStops) {
  BlockSink sink(1, test::block_bytes(make()->info()), make()->info().when_full);
  {
    const auto digitizer = make();
    digitizer->start(sink);
  }
  EXPECT_TRUE(sink.closed());
}

TEST_P(DigitizerContract, AbsentControlsThrowPresentOnesDoNot) {
  const auto digitizer = make();
  const StreamInfo& info = digitizer->info();
  if (info.has_scanner) {
    EXPECT_NO_THROW(digitizer->stop_scan());
  } else {
    EXPECT_THROW(digitizer->prepare_scan({}), std::logic_error);
    EXPECT_THROW(digitizer->start_scan({}, 1), std::logic_error);
    EXPECT_THROW(digitizer->stop_scan(), std::logic_error);
  }
  if (info.has_drive) {
    EXPECT_NO_THROW(digitizer->set_drive(digitizer->drive()));
  } else {
    EXPECT_THROW(digitizer->set_drive({}), std::logic_error);
    EXPECT_THROW(digitizer->drive(), std::logic_error);
  }
}

TEST_P(DigitizerContract, BadSettingsAreRefusedByName) {
  EXPECT_FALSE(GetParam().refusals.empty());
  for (const Subject::Refusal& refusal : GetParam().refusals) {
    try {
      refusal.construct(directory_ / "");
      ADD_FAILURE() << "constructed with a bad " << refusal.names.front();
    } catch (const std::exception& error) {
      for (const std::string& name : refusal.names) EXPECT_THAT(error.what(), HasSubstr(name));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Digitizers, DigitizerContract, ::testing::ValuesIn(test::contract_subjects()),
                         [](const auto& subject) { return subject.param.name; });

}  // namespace
}  // namespace combforce
