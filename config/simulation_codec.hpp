// The section digitizer.simulation of a configuration.
//
// What a section does not say is taken from the configuration's own objects, so that the instrument need not
// be described twice: cantilever, comb and scan from those at the top, model from fit, and temperature_k and
// detector_nm_per_sqrt_hz (if it is one number) from noise. Keys and their defaults (a key without one must
// stand here or at the top; units and meanings: drivers/simulated/simulation.hpp):
//
//     sample_rate_hz, cantilever, comb, scan, model
//     drive     the object of proto/description.hpp
//     scene     {kind: flat, materials: [M]}
//               {kind: blend, materials: [M, M], step_nm 0, grain_nm 0, domain_nm 200, seed 1}
//               {kind: maps, height_map: GSF, parameter_maps: {parameter: GSF, …}}
//               M: {parameter: value, …}; parameters: all of the model but surface_position_nm
//     feedback  {enabled true, set_point 0.8, gain 0.5, start_z_nm 40}
//     faults    [{kind: lost_block | unknown_loss | clipped, sample, frames}, {kind: stall, sample,
//     duration_s},
//               {kind: detuned, sample, detuning_ppm}, …]
//     frames 1, temperature_k 0, detector_nm_per_sqrt_hz 0, volts_per_code 0, z_nm_per_code
//     0.01, free_seconds 0, seed 1, accuracy "live": or "accurate", paced true, block_frames 16384
#pragma once

#include <filesystem>

#include "drivers/simulated/simulation.hpp"
#include "proto/description.hpp"

namespace combforce {

// `top`: the objects at the top of the configuration; `base`: where relative paths of maps start from. Throws
// InputError at the key, also for settings that contradict each other.
SimulationSettings decode_simulation(const JsonView& view, const Description& top,
                                     const std::filesystem::path& base);

// Complete: decoding it takes nothing from the top.
Json encode(const SimulationSettings& simulation);

// `path` as written in a configuration; fails when it is empty.
std::string resolve_path(const JsonView& path, const std::filesystem::path& base);

}  // namespace combforce
