#include "daemon/serve/outbox.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "proto/json.hpp"

namespace combforce {
namespace {

SharedLine line_of(std::size_t bytes, char letter = 'x') {
  return std::make_shared<const std::string>(std::string(bytes - 1, letter) + "\n");
}

// What lies in the outbox: "x" for a line of x, "pixel 3 10-30" for a skipped event.
std::vector<std::string> contents(const Outbox& outbox) {
  std::vector<std::string> result;
  for (const SharedLine& line : outbox.lines()) {
    if (line->front() != '{') {
      result.push_back(line->substr(0, 1));
      continue;
    }
    const Json message = parse_json(*line, "");
    EXPECT_EQ(message.at("jsonrpc"), "2.0");
    EXPECT_EQ(message.at("method"), "event");
    const Json& params = message.at("params");
    EXPECT_EQ(params.at("kind"), "skipped");
    result.push_back(params.at("topic").get<std::string>() + " " + params.at("count").dump() + " " +
                     params.at("first_sample").dump() + "-" + params.at("last_sample").dump());
  }
  return result;
}

using testing::ElementsAre;

TEST(Outbox, SkipsBeyondThreeQuartersAndSaysSoBeforeTheNextThatFits) {
  Outbox outbox(4000);
  for (std::uint64_t sample = 1; sample <= 3; ++sample)
    outbox.push_notification(Topic::pixel, sample, line_of(1000));
  EXPECT_EQ(outbox.unsent_bytes(), 3000U);
  for (std::uint64_t sample = 4; sample <= 6; ++sample)
    outbox.push_notification(Topic::pixel, sample, line_of(1000));
  outbox.push_notification(Topic::line, 5, line_of(100));
  EXPECT_EQ(outbox.unsent_bytes(), 3000U);
  outbox.pop(2);
  outbox.push_notification(Topic::pixel, 7, line_of(1000, 'y'));
  EXPECT_THAT(contents(outbox), ElementsAre("x", "pixel 3 4-6", "line 1 5-5", "y"));
}

TEST(Outbox, TellsWhatWasSkippedWhenEverythingElseIsSent) {
  Outbox outbox(4000);
  for (std::uint64_t sample = 1; sample <= 4; ++sample)
    outbox.push_notification(Topic::pixel, sample, line_of(1000));
  outbox.pop(3);
  EXPECT_THAT(contents(outbox), ElementsAre("pixel 1 4-4"));
  outbox.pop(1);
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.unsent_bytes(), 0U);
}

TEST(Outbox, TellsAtOnceOfANotificationThatNeverFits) {
  Outbox outbox(4000);
  outbox.push_notification(Topic::frame, 9, line_of(5000));
  EXPECT_THAT(contents(outbox), ElementsAre("frame 1 9-9"));
}

TEST(Outbox, KeepsRoomForRepliesAndRefusesTheOneThatDoesNotFit) {
  Outbox outbox(4000);
  for (std::uint64_t sample = 1; sample <= 9; ++sample)
    outbox.push_notification(Topic::pixel, sample, line_of(1000));
  EXPECT_TRUE(outbox.push_reply(std::string(1000, 'r')));
  EXPECT_FALSE(outbox.push_reply("r"));
}

TEST(Outbox, CountsWhatWasLostBeforeItCame) {
  Outbox outbox(4000);
  outbox.push_notification(Topic::pixel, 1, line_of(3000));
  outbox.push_notification(Topic::pixel, 2, line_of(3000));
  outbox.skip(Topic::pixel, 10, 3, 30);
  outbox.skip(Topic::pixel, 0, 40, 40);
  outbox.pop(1);
  EXPECT_THAT(contents(outbox), ElementsAre("pixel 11 2-30"));
}

// The bound of a skipped event's length in outbox.cpp holds for the longest there is.
TEST(Outbox, NeverHoldsMoreThanItsLimit) {
  const std::uint64_t limit = 4000;
  Outbox outbox(limit);
  const std::uint64_t late = ~std::uint64_t{0};
  for (int round = 0; round < 1000; ++round) {
    for (std::size_t topic = 0; topic < topic_names.size(); ++topic) {
      outbox.push_notification(static_cast<Topic>(topic), late,
                               line_of(10 + static_cast<std::size_t>(round % 900)));
      ASSERT_LE(outbox.unsent_bytes(), limit);
    }
    if (round % 7 == 0 && !outbox.empty()) outbox.pop(1);
  }
}

}  // namespace
}  // namespace combforce
