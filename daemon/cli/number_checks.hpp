// Checks of options that are numbers. CLI11's own name the greatest double, 309 digits, as a bound.
#pragma once

#include <CLI/CLI.hpp>

namespace combforce {

CLI::Validator positive_number();      // > 0, finite
CLI::Validator non_negative_number();  // >= 0, finite

}  // namespace combforce
