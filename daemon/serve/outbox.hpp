// What one client is still to be sent, bounded in bytes; what did not fit is counted, and the client is told.
//
// Notifications may fill three quarters of the limit, so that a client that is merely slow still gets its
// replies. Notifications beyond that are skipped; event {kind: "skipped", topic, count, first_sample,
// last_sample} precedes the next one that fits, or follows when everything else has been sent. Thread-bound
// (I/O thread).
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>

#include "daemon/serve/topics.hpp"

namespace combforce {

using SharedLine = std::shared_ptr<const std::string>;  // with its newline; shared by all clients

// Notifications of one topic that were not delivered.
struct Skipped {
  std::uint64_t count = 0;
  std::uint64_t first_sample = 0, last_sample = 0;

  void add(std::uint64_t more, std::uint64_t first, std::uint64_t last) {
    if (count == 0) first_sample = first;
    last_sample = last;
    count += more;
  }
};

class Outbox {
 public:
  explicit Outbox(std::uint64_t limit_bytes) : limit_(limit_bytes) {}

  // False: it does not fit, and the client must be disconnected.
  [[nodiscard]] bool push_reply(std::string line);
  void push_notification(Topic topic, std::uint64_t sample, const SharedLine& line);
  // Notifications that were lost before they came here.
  void skip(Topic topic, std::uint64_t count, std::uint64_t first_sample, std::uint64_t last_sample);

  // Lines to send, oldest first. They count as unsent until popped.
  const std::deque<SharedLine>& lines() const { return lines_; }
  bool empty() const { return lines_.empty(); }
  void pop(std::size_t count);

  std::uint64_t unsent_bytes() const { return unsent_; }

 private:
  void push(SharedLine line);
  void tell_skipped();

  std::uint64_t limit_;
  std::uint64_t unsent_ = 0;
  std::deque<SharedLine> lines_;
  std::array<Skipped, topic_names.size()> skipped_{};
  std::uint64_t skipped_topics_ = 0;  // how many of them are not zero
};

}  // namespace combforce
