#include "daemon/cli/pixel_reader.hpp"

#include <limits>

#include "proto/pixel_message.hpp"

namespace combforce {

namespace {

const std::string source = "pixel";

void read_values(const JsonView& object, std::vector<NamedValue>& values) {
  if (object.json().is_null()) return;
  for (const auto& member : object.json().items()) {
    const JsonView value = object.get(member.key());
    values.push_back(
        {member.key(), value.json().is_null() ? std::numeric_limits<double>::quiet_NaN() : value.number()});
  }
}

FitStatus read_status(const JsonView& status) {
  for (std::uint8_t i = 0; i <= static_cast<std::uint8_t>(FitStatus::ambiguous); ++i) {
    if (status.json() == to_string(static_cast<FitStatus>(i))) return static_cast<FitStatus>(i);
  }
  status.fail("is no status of this protocol");
}

}  // namespace

MapPixel read_pixel(const Json& params) {
  const JsonView view(params, source);
  MapPixel pixel;
  pixel.line =
      static_cast<std::uint32_t>(view.get("line").integer(0, std::numeric_limits<std::uint32_t>::max()));
  pixel.column =
      static_cast<std::uint32_t>(view.get("column").integer(0, std::numeric_limits<std::uint32_t>::max()));
  pixel.direction =
      view.get("direction").one_of({"trace", "retrace"}) == 0 ? Direction::trace : Direction::retrace;
  read_values(view.get("channels"), pixel.values);
  const JsonView fit = view.get("fit");
  pixel.status = read_status(fit.get("status"));
  if (const auto parameters = fit.find("parameters")) read_values(*parameters, pixel.values);
  return pixel;
}

}  // namespace combforce
