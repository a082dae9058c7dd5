// A pixel message read back: what a client makes maps of.
#pragma once

#include "daemon/cli/maps.hpp"
#include "proto/json.hpp"

namespace combforce {

// From the params of a `pixel` notification. Throws InputError on what is no pixel of this protocol.
// `size_nm` is not in a message: it is left to the caller.
MapPixel read_pixel(const Json& params);

}  // namespace combforce
