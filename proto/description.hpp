// The `afm` description of a measurement: the objects shared by recordings (afm:… of global and captures),
// configurations and messages. One codec a type, used in all three places.
#pragma once

#include <optional>
#include <string>

#include "dsp/channel.hpp"
#include "dsp/comb.hpp"
#include "dsp/scan.hpp"
#include "fit/cantilever.hpp"
#include "fit/drive.hpp"
#include "fit/free_response.hpp"
#include "fit/noise.hpp"
#include "fit/pixel_fitter.hpp"
#include "proto/json.hpp"

namespace combforce {

// What is known of a measurement. Absent: not said.
struct Description {
  std::optional<Channels> channels;
  std::optional<Cantilever> cantilever;
  std::optional<Comb> comb;
  std::optional<FreeResponse> free_response;
  std::optional<ScanLayout> scan;
  std::optional<Noise> noise;
  std::optional<FitSettings> fit;
};

// `top` where it says something, else `base`.
Description overlay(Description base, const Description& top);

// Decoders check type, keys and the bounds of each field; encode(decode(x)) == x for valid x. Recordings keep unknown
// keys of a newer minor version: `unknown` says whether to refuse them.
enum class UnknownKeys : std::uint8_t { refuse, allow };

Channels decode_channels(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Cantilever decode_cantilever(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Comb decode_comb(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
FreeResponse decode_free_response(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
ScanLayout decode_scan(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Noise decode_noise(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
FitSettings decode_fit(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Drive decode_drive(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);

Json encode(const Channels& channels);
Json encode(const Cantilever& cantilever);
Json encode(const Comb& comb);
Json encode(const FreeResponse& free_response);
Json encode(const ScanLayout& scan);
Json encode(const Noise& noise);
Json encode(const FitSettings& fit);
Json encode(const Drive& drive);

// The objects of a description under `prefix` ("" in configurations, "afm:" in recordings) in an object; keys
// of the object that are not of the description are left alone.
Description decode_description(const JsonView& object, std::string_view prefix,
                               UnknownKeys unknown = UnknownKeys::refuse);
void encode_into(Json& object, const Description& description, std::string_view prefix);

}  // namespace combforce
