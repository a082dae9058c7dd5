// The methods of an instrument: what the daemon's clients may call.
#pragma once

#include <functional>

#include "daemon/instrument.hpp"
#include "daemon/serve/rpc.hpp"

namespace combforce {

// Adds what `instrument` can do to `table`: scan.start and scan.stop with a scanner, scan.line where the
// stream does not mark its lines, drive.get and drive.set with a drive; the rest always. `post` runs a
// function on the I/O thread: answers that come from other threads take that way. The instrument must outlive
// the table.
void add_methods(RpcTable& table, Instrument& instrument, std::function<void(std::function<void()>)> post);

}  // namespace combforce
