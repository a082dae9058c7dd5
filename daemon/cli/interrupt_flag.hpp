// Ctrl-C as a flag, for commands that have something to finish.
#pragma once

namespace combforce {

// While it lives SIGINT and SIGTERM only raise a flag, and system calls return with EINTR. One at a time.
class InterruptFlag {
 public:
  InterruptFlag();
  ~InterruptFlag();
  InterruptFlag(const InterruptFlag&) = delete;
  InterruptFlag& operator=(const InterruptFlag&) = delete;

  static bool raised();
};

}  // namespace combforce
