#include "daemon/cli/progress.hpp"

#include <unistd.h>

#include <cstdio>

namespace combforce {

Progress::Progress() : terminal_(::isatty(STDERR_FILENO) == 1), next_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  clear();
}

bool Progress::due() {
  return terminal_ && std::chrono::steady_clock::now() >= next_;
}

void Progress::show(std::string_view text) {
  if (!terminal_) return;
  next_ = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
  std::fprintf(stderr, "\r\033[K%.*s", static_cast<int>(text.size()), text.data());
  shown_ = true;
}

void Progress::clear() {
  if (!shown_) return;
  std::fputs("\r\033[K", stderr);
  shown_ = false;
}

}  // namespace combforce
