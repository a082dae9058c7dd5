// An Instrument without a stream: this program defines the class's members itself, and notes what is asked of
// it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/instrument.hpp"

namespace combforce {

struct FakeInstrument {
  StreamInfo info;
  Description description;
  InstrumentStatus status;
  Drive drive;
  std::optional<ScanLayout> configured_scan, scan_layout;
  std::uint32_t scan_frames = 0;
  std::vector<LineMark> lines;
  std::vector<std::string> recordings;
  std::uint32_t free_windows = 0;
  Instrument::Height free_height = Instrument::Height::far;
  int free_cancelled = 0;
  std::function<void(std::optional<FreeResponse>, std::string)> free_done;
  std::optional<FitSettings> fit;
  std::function<void()> on_stop;
  bool scanning = false;
  double spectrum_hz = 0.0;
  std::string refuse;  // not empty: controls throw this
};

// What the Instruments constructed from now on do and say. Thread-bound, but for being read by the server's
// thread.
FakeInstrument& fake_instrument();

}  // namespace combforce
