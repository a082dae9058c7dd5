// Exit codes of both programs (command line contract), and the one place where errors become one.
#pragma once

#include <functional>
#include <string>

namespace combforce {

enum ExitCode : int {
  exit_done = 0,
  exit_failed = 1,
  exit_usage = 2,     // also CLI11's own
  exit_bad_input = 3  // file, field, why
};

// Runs `command` and returns its exit code. InputError ends as bad input with "FILE: POINTER: MESSAGE" on
// stderr; std::invalid_argument likewise, anything else as failed, with "PROGRAM: what()".
int run_command(const std::string& program, const std::function<int()>& command);

// All of main(): run_command(), and a run whose stdout could not take all that was printed is a failed one. A
// file size limit is an error like a full disk, no signal; a standard file that is closed is none that a file
// opened later could be mistaken for.
int run_program(const std::string& program, const std::function<int()>& body);

}  // namespace combforce
