#include "daemon/cli/exit_code.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "proto/json.hpp"

namespace combforce {
namespace {

int run_throwing(const std::function<void()>& act, std::string& said) {
  testing::internal::CaptureStderr();
  const int code = run_command("combforce", [&act] {
    act();
    return 7;
  });
  said = testing::internal::GetCapturedStderr();
  return code;
}

TEST(RunCommand, TurnsErrorsIntoTheContractsCodes) {
  std::string said;
  EXPECT_EQ(run_throwing([] {}, said), 7);
  EXPECT_EQ(said, "");
  EXPECT_EQ(run_throwing([] { throw InputError("a.json", "/x/1", "is 3, must be below 2"); }, said),
            exit_bad_input);
  EXPECT_EQ(said, "a.json: /x/1: is 3, must be below 2\n");
  EXPECT_EQ(run_throwing([] { throw std::invalid_argument("gain: 3 is above 2"); }, said), exit_bad_input);
  EXPECT_EQ(said, "combforce: gain: 3 is above 2\n");
  EXPECT_EQ(run_throwing([] { throw std::runtime_error("the disk is full"); }, said), exit_failed);
  EXPECT_EQ(said, "combforce: the disk is full\n");
  EXPECT_EQ(run_throwing([] { throw std::bad_alloc(); }, said), exit_failed);
}

}  // namespace
}  // namespace combforce
