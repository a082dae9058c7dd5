#include "daemon/serve/notification_queue.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

namespace combforce {
namespace {

Notification of(Topic topic, std::uint64_t sample, std::size_t bytes) {
  return {topic, sample, std::make_shared<const std::string>(bytes, 'x'), nullptr};
}

TEST(NotificationQueue, AsksToBeReadOnceABatch) {
  NotificationQueue queue(1000);
  EXPECT_TRUE(queue.push(of(Topic::pixel, 1, 10)));
  EXPECT_FALSE(queue.push(of(Topic::pixel, 2, 10)));
  EXPECT_EQ(queue.take().notifications.size(), 2U);
  EXPECT_TRUE(queue.push(of(Topic::pixel, 3, 10)));
}

TEST(NotificationQueue, LosesEverythingAfterTheFirstThatDoesNotFitAndCounts) {
  NotificationQueue queue(100);
  EXPECT_TRUE(queue.push(of(Topic::pixel, 1, 60)));
  EXPECT_FALSE(queue.push(of(Topic::pixel, 2, 60)));
  EXPECT_FALSE(queue.push(of(Topic::line, 3, 1)));  // would fit, but not in order
  EXPECT_FALSE(queue.push(of(Topic::pixel, 4, 1)));
  const NotificationBatch batch = queue.take();
  ASSERT_EQ(batch.notifications.size(), 1U);
  EXPECT_EQ(batch.notifications[0].sample, 1U);
  const Skipped& pixels = batch.lost[index(Topic::pixel)];
  EXPECT_EQ(pixels.count, 2U);
  EXPECT_EQ(pixels.first_sample, 2U);
  EXPECT_EQ(pixels.last_sample, 4U);
  EXPECT_EQ(batch.lost[index(Topic::line)].count, 1U);
  EXPECT_TRUE(queue.push(of(Topic::pixel, 5, 60)));
}

TEST(NotificationQueue, AsksToBeReadEvenWhenTheFirstIsLost) {
  NotificationQueue queue(100);
  EXPECT_TRUE(queue.push(of(Topic::pixel, 1, 200)));
  EXPECT_FALSE(queue.push(of(Topic::pixel, 2, 200)));
  EXPECT_EQ(queue.take().lost[index(Topic::pixel)].count, 2U);
}

TEST(NotificationQueue, DeliversOrCountsEachExactlyOnceAcrossThreads) {
  constexpr std::uint64_t pushed = 20000;
  NotificationQueue queue(5000);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (std::uint64_t sample = 1; sample <= pushed; ++sample) {
      [[maybe_unused]] const bool wake = queue.push(of(Topic::pixel, sample, 100));
    }
    done.store(true);
  });
  std::uint64_t next = 1;
  for (bool last = false; !last;) {
    last = done.load();
    const NotificationBatch batch = queue.take();
    for (const Notification& notification : batch.notifications) ASSERT_EQ(notification.sample, next++);
    const Skipped& lost = batch.lost[index(Topic::pixel)];
    if (lost.count == 0) continue;
    ASSERT_EQ(lost.first_sample, next);
    next += lost.count;
    ASSERT_EQ(lost.last_sample + 1, next);
  }
  writer.join();
  EXPECT_EQ(next, pushed + 1);
}

}  // namespace
}  // namespace combforce
