#include "daemon/cli/exit_code.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>

#include "proto/json.hpp"

namespace combforce {

namespace {

int report(const std::string& program, const std::exception& error, int code) {
  std::fprintf(stderr, "%s: %s\n", program.c_str(), error.what());
  return code;
}

// The file says where: no need for the program's name before it.
int report(const InputError& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return exit_bad_input;
}

// Opened the wrong way round: reading or writing fails as it does on a closed one.
void occupy_standard_files() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(number, F_GETFD) < 0 && errno == EBADF)
      ::open("/dev/null", number == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

// Empty: all that was printed is out.
std::string stdout_failure() {
  const bool failed_before = std::ferror(stdout) != 0;
  if (std::fflush(stdout) != 0) return std::strerror(errno);
  return failed_before ? "not all could be written" : "";
}

}  // namespace

int run_program(const std::string& program, const std::function<int()>& body) {
  occupy_standard_files();
  std::signal(SIGXFSZ, SIG_IGN);
  const int code = run_command(program, body);
  const std::string failure = stdout_failure();
  if (failure.empty() || code != exit_done) return code;
  std::fprintf(stderr, "%s: stdout: %s\n", program.c_str(), failure.c_str());
  return exit_failed;
}

int run_command(const std::string& program, const std::function<int()>& command) {
  try {
    return command();
  } catch (const InputError& error) {
    return report(error);
  } catch (const std::invalid_argument& error) {
    return report(program, error, exit_bad_input);
  } catch (const std::exception& error) {
    return report(program, error, exit_failed);
  }
}

}  // namespace combforce
