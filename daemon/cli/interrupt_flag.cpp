#include "daemon/cli/interrupt_flag.hpp"

#include <csignal>

namespace combforce {

namespace {

volatile std::sig_atomic_t flag = 0;

void raise_flag(int) {
  flag = 1;
}

}  // namespace

InterruptFlag::InterruptFlag() {
  flag = 0;
  struct sigaction action {};
  action.sa_handler = raise_flag;
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
}

InterruptFlag::~InterruptFlag() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

bool InterruptFlag::raised() {
  return flag != 0;
}

}  // namespace combforce
