#include "daemon/cli/number_checks.hpp"

#include <cmath>
#include <string>

namespace combforce {

namespace {

CLI::Validator number_check(bool zero_too, const std::string& bound, const std::string& name) {
  const auto check = [zero_too, bound](const std::string& text) {
    double value = 0.0;
    const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) &&
                      (value > 0.0 || (zero_too && value == 0.0));
    return good ? std::string() : text + ", must be " + bound;
  };
  return {check, name};
}

}  // namespace

CLI::Validator positive_number() {
  return number_check(false, "a number above 0", "POSITIVE");
}

CLI::Validator non_negative_number() {
  return number_check(true, "a number, at least 0", "NONNEGATIVE");
}

}  // namespace combforce
