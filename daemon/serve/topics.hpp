// What a client may subscribe to.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace combforce {

enum class Topic : std::uint8_t { pixel, line, frame, spectrum, status, event };

inline constexpr std::array<std::string_view, 6> topic_names{"pixel",    "line",   "frame",
                                                             "spectrum", "status", "event"};

constexpr std::size_t index(Topic topic) {
  return static_cast<std::size_t>(topic);
}
constexpr std::string_view to_string(Topic topic) {
  return topic_names[index(topic)];
}

// What one client has subscribed to.
struct Subscriptions {
  std::array<bool, topic_names.size()> topics{};
  bool tones = true;         // pixels with their tones
  std::uint64_t every = 1;   // every n-th pixel
  double spectrum_hz = 1.0;  // spectra a second, at most

  bool has(Topic topic) const { return topics[index(topic)]; }
  bool any() const { return topics != decltype(topics){}; }
};

}  // namespace combforce
