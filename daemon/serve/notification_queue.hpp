// The bounded hand-over of notifications from the threads that publish to the I/O thread.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <vector>

#include "daemon/serve/outbox.hpp"
#include "daemon/serve/topics.hpp"

namespace combforce {

// Serialised once, whoever gets it. A line is null when nobody wanted it as it was published.
struct Notification {
  Topic topic = Topic::event;
  std::uint64_t sample = 0;
  SharedLine line;
  SharedLine brief;  // pixels only: without tones

  std::size_t bytes() const { return (line ? line->size() : 0) + (brief ? brief->size() : 0); }
};

// What the I/O thread takes at once: `lost` came after everything in `notifications`.
struct NotificationBatch {
  std::vector<Notification> notifications;
  std::array<Skipped, topic_names.size()> lost{};
};

// Thread-safe; push() never waits for the reader. Once one notification does not fit, all are lost until the
// next take(), so that their order stays known.
class NotificationQueue {
 public:
  explicit NotificationQueue(std::uint64_t limit_bytes) : limit_(limit_bytes) {}

  // True: the queue was empty, and the reader must be woken.
  [[nodiscard]] bool push(Notification notification);
  NotificationBatch take();

 private:
  std::uint64_t limit_;
  std::mutex mutex_;
  NotificationBatch batch_;
  std::uint64_t bytes_ = 0;
  bool full_ = false;
};

}  // namespace combforce
