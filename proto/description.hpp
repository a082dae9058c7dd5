// The `afm` description of a measurement: the objects shared by recordings (afm:… of global and captures),
// configurations and messages. One codec a type, used in all three places.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dsp/channel.hpp"
#include "dsp/comb.hpp"
#include "dsp/scan.hpp"
#include "fit/cantilever.hpp"
#include "fit/drive.hpp"
#include "fit/excitation.hpp"
#include "fit/fit_conditions.hpp"
#include "fit/free_response.hpp"
#include "fit/noise.hpp"
#include "proto/json.hpp"

namespace combforce {

// What is known of a measurement. Absent: not said.
struct Description {
  std::optional<Channels> channels;
  std::optional<Cantilever> cantilever;
  std::optional<Excitation> excitation;
  std::optional<Comb> comb;
  std::optional<FreeResponse> free_response;
  std::optional<ScanLayout> scan;
  std::optional<Noise> noise;
  std::optional<FitSettings> fit;

  bool operator==(const Description&) const = default;
};

// `top` where it says something, else `base`.
Description overlay(Description base, const Description& top);

// Where two objects of a description contradict each other: free_response or noise that do not count as many
// tones as the comb has, pixels too short for settle_samples + windows * N. The pointer has no prefix:
// "/scan/pixel_samples".
struct Contradiction {
  std::string pointer, message;
};
std::optional<Contradiction> find_contradiction(const Description& description);

// For people: what is allowed, but hardly meant. A linear background without a lifted response, a model of
// more parameters than the tones can tell.
std::vector<std::string> find_doubts(const Description& description);

// Decoders check type, keys and the bounds of each field, and throw InputError with the pointer of the field;
// decode(encode(x)) == x for valid x. Recordings may hold unknown keys of a newer minor version: `unknown`
// says whether to refuse them. Keys and their defaults (a key without one is required):
//
//     channels       [{name, role, unit "V", scale 1, offset 0, nm_per_v absent, clip_codes absent: [lo,
//     hi]}]
//                    role: deflection (channel 0), z, reference, marker; unit: V, nm
//     cantilever     {modes: [{frequency_hz, quality_factor, stiffness_n_per_m, sensitivity_nm_per_v 1}],
//                    uncertainty absent: [{std_errors: {the keys of a mode}, correlation: [6]}], one a mode;
//                    null: not known}; correlation: strict upper triangle in the order of a mode's keys
//     excitation     {kind: tip or base, participation absent: [one a mode]} (fit/excitation.hpp)
//     comb           {window_samples, tones: [{bin, driven true}]}
//     free_response  {first_sample 0, windows 0, mean_nm: [[re, im], …], covariance absent: rows [[…], …],
//                    coherent true, lifted_nm absent: [[re, im], …], lifted_windows 0}, or mean_nm
//                    alone
//     scan           {lines, columns, pixel_samples, settle_samples 0, windows 1, bidirectional false,
//                    size_nm [0, 0]}
//     noise          {temperature_k, detector_nm_per_sqrt_hz: a number, or a list of one a tone}
//     fit            {model "dmt", refine 0, weighting "none": or "noise", profile_intervals false,
//                    calibration_errors false, background "none": or "linear", compare []: further models,
//                    bounds {}: {parameter: [lo, hi]},
//                    tip absent: {radius_nm absent, half_angle_deg absent, sample_poisson_ratio absent,
//                    tip_young_modulus_gpa absent, tip_poisson_ratio 0.27}} (fit/material.hpp)
//     drive          {scheme "equal_energy", total_amplitude_nm 50, phases_rad []}; scheme: equal_energy,
//                    equal_amplitude, or amplitudes, with amplitudes_nm in place of total_amplitude_nm
enum class UnknownKeys : std::uint8_t { refuse, allow };

// Bound of lines and of columns of a scan.
inline constexpr std::uint32_t most_pixels_a_side = 1U << 20;

Channels decode_channels(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Cantilever decode_cantilever(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Excitation decode_excitation(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Comb decode_comb(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
FreeResponse decode_free_response(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
ScanLayout decode_scan(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Noise decode_noise(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
FitSettings decode_fit(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);
Drive decode_drive(const JsonView& view, UnknownKeys unknown = UnknownKeys::refuse);

Json encode(const Channels& channels);
Json encode(const Cantilever& cantilever);
Json encode(const Excitation& excitation);
Json encode(const Comb& comb);
Json encode(const FreeResponse& free_response);
Json encode(const ScanLayout& scan);
Json encode(const Noise& noise);
Json encode(const FitSettings& fit);
Json encode(const Drive& drive);

// The objects of a description under `prefix` ("" in configurations, "afm:" in recordings) in an object; keys
// of the object that are not of the description are left alone. Decoding also refuses contradictions.
Description decode_description(const JsonView& object, std::string_view prefix,
                               UnknownKeys unknown = UnknownKeys::refuse);
void encode_into(Json& object, const Description& description, std::string_view prefix);

}  // namespace combforce
