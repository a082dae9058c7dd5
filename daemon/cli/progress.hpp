// A line of progress on stderr that overwrites itself; silent unless stderr is a terminal.
#pragma once

#include <chrono>
#include <string_view>

namespace combforce {

// For one thread at a time. The destructor clears the line.
class Progress {
 public:
  Progress();
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // True at most ten times a second, and never without a terminal: ask before composing a text.
  bool due();
  void show(std::string_view text);
  void clear();  // before something else is printed

 private:
  bool terminal_;
  bool shown_ = false;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace combforce
