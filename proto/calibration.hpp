// The calibration file: a calibrated cantilever with its errors and where it comes from. Configurations
// include it by `"calibration": "FILE"`.
//
//     {"cantilever": …, "noise": …,       the objects of proto/description.hpp, uncertainty included
//      "origin": {…}}                     how it was found, for people: any keys; may be absent
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "fit/thermal_calibration.hpp"
#include "proto/description.hpp"
#include "proto/json.hpp"

namespace combforce {

struct Calibration {
  Cantilever cantilever;
  Noise noise;
  Json origin;  // an object, or null
};

// Throw InputError with file, pointer, value and bound.
Calibration load_calibration(const std::string& path);
Calibration parse_calibration(std::string_view text, const std::string& file);

Json encode(const Calibration& calibration);

}  // namespace combforce
