// What the simulated instrument is made of. Plain settings; config/ reads them from JSON.
#pragma once

#include <complex>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dsp/channel.hpp"
#include "dsp/comb.hpp"
#include "dsp/scan.hpp"
#include "fit/cantilever.hpp"
#include "fit/drive.hpp"

namespace combforce {

// A material: parameters of the force model but for surface_position_nm (which scene and feedback give).
struct Material {
  std::vector<double> parameters;  // in the model's order, without the first

  bool operator==(const Material&) const = default;
};

struct SceneSettings {
  enum class Kind : std::uint8_t {
    flat,   // one material, height 0
    blend,  // two-phase polymer blend: rounded domains of materials[1] in materials[0], a height step between
            // them, and grains on top
    maps    // every parameter and the height from GSF files
  };
  Kind kind = Kind::flat;
  std::vector<Material> materials;          // flat: 1, blend: 2, maps: 0
  double step_nm = 0.0;                     // blend: materials[1] stands higher by this
  double grain_nm = 0.0;                    // blend: height of the grains
  double domain_nm = 200.0;                 // blend: typical size of the domains, > 0
  std::uint64_t seed = 1;                   // blend: which pattern
  std::string height_map;                   // maps: GSF file, metres
  std::vector<std::string> parameter_maps;  // maps: one GSF file a material parameter, in the model's units

  bool operator==(const SceneSettings&) const = default;
};

// One integral update a pixel on the amplitude of the first tone: z += gain * (set_point * |A_free| - |A|), z
// the height of the cantilever's base above the scene's zero (nm); a surface of height h stands at tip
// coordinate h - z.
struct FeedbackSettings {
  bool enabled = true;
  double set_point = 0.8;    // of the first tone's free amplitude, 0..1
  double gain = 0.5;         // nm of z per nm of amplitude error, 0..2
  double start_z_nm = 40.0;  // z at which a scan begins (surface at -start_z_nm for height 0)

  bool operator==(const FeedbackSettings&) const = default;
};

struct FaultSettings {
  enum class Kind : std::uint8_t {
    lost_block,    // `frames` frames from `sample` on are not delivered: known loss
    unknown_loss,  // the same, of unknown length: a new epoch
    clipped,       // `frames` deflection samples read full scale
    stall,         // delivery pauses for duration_s before `sample`; nothing is lost by it
    detuned        // from `sample` on the drive runs on a clock of its own, fast by detuning_ppm
  };
  Kind kind = Kind::lost_block;
  std::uint64_t sample = 0;
  std::uint64_t frames = 0;
  double duration_s = 0.0;
  double detuning_ppm = 0.0;

  bool operator==(const FaultSettings&) const = default;
};

enum class IntegratorAccuracy : std::uint8_t {
  live,     // tones within 5 pm of the converged solution
  accurate  // within 0.05 pm
};

struct SimulationSettings {
  double sample_rate_hz = 0.0;
  Cantilever cantilever;
  Comb comb;  // driven tones carry the drive
  Drive drive;
  std::string model = "dmt";
  SceneSettings scene;
  FeedbackSettings feedback;
  ScanLayout layout;                     // used by `simulate`; the daemon's scan.start brings its own
  std::uint32_t frames = 1;              // likewise
  double temperature_k = 0.0;            // Langevin force on every mode
  double detector_nm_per_sqrt_hz = 0.0;  // white, one-sided, at the first mode's sensitivity
  // Deflection channel: volts per code. nm at the detector / sensitivity = volts. 0: chosen so that twice the
  // free motion's greatest deflection is full scale.
  double volts_per_code = 0.0;
  double z_nm_per_code = 0.01;  // z channel; 0: no z channel
  double free_seconds = 0.0;    // `simulate`: free motion recorded before the scan
  std::uint64_t seed = 1;       // noise
  IntegratorAccuracy accuracy = IntegratorAccuracy::live;
  bool paced = true;            // at the sample rate; otherwise as fast as the sink takes blocks
  bool ends_with_scan = false;  // the stream ends with the block after its scan; set by `simulate`
  std::uint32_t block_frames = 16384;
  std::vector<FaultSettings> faults;  // ordered by sample

  bool operator==(const SimulationSettings&) const = default;
};

// Throws std::invalid_argument naming field, value and bound. Scene and layout: check_scene().
void validate(const SimulationSettings& settings);

double tone_hz(const SimulationSettings& settings, const Tone& tone);

// Peak phasors of the drive forces at the tip, nN, one a driven tone of the comb.
std::vector<std::complex<double>> drive_forces(const SimulationSettings& settings);

// Tip deflection far from the surface, nm, one a tone of the comb (0 where it is not driven): the free
// response that a capture without noise and quantisation gives.
std::vector<std::complex<double>> exact_free_response(const SimulationSettings& settings);

// Channel 0 the deflection, channel 1 z where it is on.
Channels simulated_channels(const SimulationSettings& settings);

}  // namespace combforce
