// What a channel of the stream carries and how its codes become volts (recording contract, afm:channels).
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "dsp/sample_block.hpp"

namespace combforce {

enum class ChannelRole : std::uint8_t { deflection, z, reference, marker };

struct Channel {
  struct ClipCodes {
    double lo, hi;  // a code <= lo or >= hi is clipped
    bool operator==(const ClipCodes&) const = default;
  };
  std::string name;
  ChannelRole role = ChannelRole::deflection;
  std::string unit = "V";  // of scale * code + offset: "V", or "nm" for a z channel
  double scale = 1.0;
  double offset = 0.0;
  std::optional<ClipCodes> clip_codes;  // absent: i16 streams clip at -32768 and 32767, f32 never
  // Of the deflection; used without a cantilever, which has its own.
  std::optional<double> nm_per_v = std::nullopt;

  bool operator==(const Channel&) const = default;
};

// Codes of a channel at or beyond which a sample is clipped; -inf, +inf where none is.
inline Channel::ClipCodes clip_codes_of(const Channel& channel, SampleFormat format) {
  if (channel.clip_codes) return *channel.clip_codes;
  if (format == SampleFormat::i16) return {-32768.0, 32767.0};
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return {-infinity, infinity};
}

using Channels = std::vector<Channel>;  // in the order of interleaving

}  // namespace combforce
