#include "daemon/cli/exit_code.hpp"

#include <cstdio>
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

}  // namespace

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
