// What the reader and the writer of SigMF metadata share: versions and names.
#pragma once

#include <array>
#include <string_view>

namespace combforce {

struct SigmfVersion {
  unsigned major, minor;
};
inline constexpr SigmfVersion core_version{1, 2};
inline constexpr SigmfVersion afm_version{0, 1};
inline constexpr const char* core_version_text = "1.2.5";
inline constexpr const char* afm_version_text = "0.1.0";

// Indexed by EpochReason.
inline constexpr std::array<std::string_view, 4> epoch_reason_names = {"start", "unknown_loss",
                                                                       "device_restart", "clock_change"};
inline constexpr std::array<std::string_view, 2> direction_names = {"trace", "retrace"};

}  // namespace combforce
