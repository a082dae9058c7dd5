// Cuts a byte stream into lines: one message a line, LF or CRLF.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace combforce {

// Holds at most `limit` bytes of an unfinished line. Thread-bound.
class LineFramer {
 public:
  explicit LineFramer(std::size_t limit) : limit_(limit) {}

  // Calls on_line(std::string_view) for each line that `bytes` completes, without its end; the view is valid
  // during the call. False: a line is longer than the limit; nothing more may be fed then.
  template <class OnLine>
  bool feed(std::string_view bytes, const OnLine& on_line) {
    while (!bytes.empty()) {
      const std::size_t end = bytes.find('\n');
      const std::string_view part = bytes.substr(0, end);
      if (rest_.size() + part.size() > limit_) return false;
      if (end == std::string_view::npos) {
        rest_.append(part);
        return true;
      }
      if (rest_.empty()) {
        on_line(without_cr(part));
      } else {
        rest_.append(part);
        on_line(without_cr(rest_));
        rest_.clear();
      }
      bytes.remove_prefix(end + 1);
    }
    return true;
  }

 private:
  static std::string_view without_cr(std::string_view line) {
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  }

  std::size_t limit_;
  std::string rest_;
};

}  // namespace combforce
