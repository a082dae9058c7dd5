#include "daemon/serve/outbox.hpp"

#include <fmt/format.h>

#include <utility>

namespace combforce {

namespace {

// No line of tell_skipped() is longer: its fixed text, a topic and three numbers of at most 20 digits.
constexpr std::uint64_t skipped_line_bytes = 256;

}  // namespace

bool Outbox::push_reply(std::string line) {
  if (unsent_ + line.size() > limit_) return false;
  push(std::make_shared<const std::string>(std::move(line)));
  return true;
}

void Outbox::push_notification(Topic topic, std::uint64_t sample, const SharedLine& line) {
  const std::uint64_t needed = skipped_topics_ * skipped_line_bytes + line->size();
  if (unsent_ + needed > limit_ - limit_ / 4) {
    skip(topic, 1, sample, sample);
    return;
  }
  tell_skipped();
  push(line);
}

void Outbox::skip(Topic topic, std::uint64_t count, std::uint64_t first_sample, std::uint64_t last_sample) {
  if (count == 0) return;
  Skipped& skipped = skipped_[index(topic)];
  if (skipped.count == 0) ++skipped_topics_;
  skipped.add(count, first_sample, last_sample);
  if (lines_.empty()) tell_skipped();
}

void Outbox::pop(std::size_t count) {
  for (; count > 0; --count) {
    unsent_ -= lines_.front()->size();
    lines_.pop_front();
  }
  if (lines_.empty()) tell_skipped();
}

void Outbox::push(SharedLine line) {
  unsent_ += line->size();
  lines_.push_back(std::move(line));
}

void Outbox::tell_skipped() {
  if (skipped_topics_ == 0) return;
  for (std::size_t topic = 0; topic < skipped_.size(); ++topic) {
    const Skipped skipped = std::exchange(skipped_[topic], {});
    if (skipped.count == 0) continue;
    push(std::make_shared<const std::string>(fmt::format(
        R"({{"jsonrpc":"2.0","method":"event","params":{{"kind":"skipped","topic":"{}","count":{},)"
        R"("first_sample":{},"last_sample":{}}}}})"
        "\n",
        topic_names[topic], skipped.count, skipped.first_sample, skipped.last_sample)));
  }
  skipped_topics_ = 0;
}

}  // namespace combforce
