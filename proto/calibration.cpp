#include "proto/calibration.hpp"

namespace combforce {
namespace {

Calibration decode(const JsonView& root) {
  root.only({"cantilever", "noise", "origin"});
  Calibration calibration;
  calibration.cantilever = decode_cantilever(root.get("cantilever"));
  calibration.noise = decode_noise(root.get("noise"));
  if (const auto origin = root.find("origin")) {
    if (!origin->json().is_object()) origin->fail("must be an object");
    calibration.origin = origin->json();
  }
  return calibration;
}

}  // namespace

Calibration parse_calibration(std::string_view text, const std::string& file) {
  const Json root = parse_json(text, file);
  return decode(JsonView(root, file));
}

Calibration load_calibration(const std::string& path) {
  const Json root = parse_json_file(path);
  return decode(JsonView(root, path));
}

Json encode(const Calibration& calibration) {
  Json root{{"cantilever", encode(calibration.cantilever)}, {"noise", encode(calibration.noise)}};
  if (calibration.origin.is_object()) root["origin"] = calibration.origin;
  return root;
}

}  // namespace combforce
