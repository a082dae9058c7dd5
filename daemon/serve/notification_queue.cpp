#include "daemon/serve/notification_queue.hpp"

#include <utility>

namespace combforce {

bool NotificationQueue::push(Notification notification) {
  const std::lock_guard lock(mutex_);
  const bool was_empty = batch_.notifications.empty() && !full_;
  bytes_ += notification.bytes();
  full_ = full_ || bytes_ > limit_;
  if (full_) {
    batch_.lost[index(notification.topic)].add(1, notification.sample, notification.sample);
  } else {
    batch_.notifications.push_back(std::move(notification));
  }
  return was_empty;
}

NotificationBatch NotificationQueue::take() {
  const std::lock_guard lock(mutex_);
  bytes_ = 0;
  full_ = false;
  return std::exchange(batch_, {});
}

}  // namespace combforce
