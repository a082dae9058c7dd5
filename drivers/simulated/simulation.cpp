#include "drivers/simulated/simulation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "drivers/digitizer.hpp"
#include "drivers/simulated/cell.hpp"
#include "fit/force_model.hpp"

namespace combforce {

using Complex = std::complex<double>;

namespace {

constexpr double most_motion_nm = 1e5;
constexpr double most_windows = std::numeric_limits<std::uint32_t>::max();  // of a capture of free motion
constexpr double most_detuning_ppm = 1e4;
constexpr std::uint64_t most_samples = std::uint64_t{1} << 53;  // what messages can carry

template <typename Value>
void require(bool holds, const std::string& field, Value value, const std::string& bound) {
  if (!holds) throw std::invalid_argument(fmt::format("simulation.{}: {}, must be {}", field, value, bound));
}

std::vector<double> driven_frequencies(const SimulationSettings& settings) {
  std::vector<double> frequencies;
  for (const Tone& tone : settings.comb.tones) {
    if (tone.driven) frequencies.push_back(tone_hz(settings, tone));
  }
  return frequencies;
}

void validate_faults(const std::vector<FaultSettings>& faults) {
  std::uint64_t free_from = 0;
  for (std::size_t i = 0; i < faults.size(); ++i) {
    const FaultSettings& fault = faults[i];
    const std::string field = fmt::format("faults[{}]", i);
    require(fault.sample <= most_samples && fault.frames <= most_samples, field, fault.sample,
            "below 2^53 in sample and frames");
    require(fault.sample >= free_from, field + ".sample", fault.sample,
            fmt::format(">= {}, the end of the fault before", free_from));
    if (fault.kind == FaultSettings::Kind::stall) {
      require(fault.duration_s > 0.0 && fault.duration_s <= 3600.0, field + ".duration_s", fault.duration_s,
              "> 0 and <= 3600");
      free_from = fault.sample;
    } else if (fault.kind == FaultSettings::Kind::detuned) {
      require(std::abs(fault.detuning_ppm) <= most_detuning_ppm, field + ".detuning_ppm", fault.detuning_ppm,
              fmt::format("-{0}..{0}", most_detuning_ppm));
      free_from = fault.sample;
    } else {
      require(fault.frames >= 1, field + ".frames", fault.frames, ">= 1");
      free_from = fault.sample + fault.frames;
    }
  }
}

}  // namespace

double tone_hz(const SimulationSettings& settings, const Tone& tone) {
  return settings.sample_rate_hz * static_cast<double>(tone.bin) /
         static_cast<double>(settings.comb.window_samples);
}

void validate(const SimulationSettings& settings) {
  require(settings.sample_rate_hz > 0.0 && std::isfinite(settings.sample_rate_hz), "sample_rate_hz",
          settings.sample_rate_hz, "> 0");
  validate(settings.cantilever);
  validate(settings.comb);
  for (const Mode& mode : settings.cantilever.modes) mode_dynamics(mode);
  double greatest_nm = 0.0;
  for (const Complex& tone : exact_free_response(settings)) greatest_nm += std::abs(tone);
  require(greatest_nm <= most_motion_nm, "drive", fmt::format("{} nm of free motion", greatest_nm),
          fmt::format("<= {} nm", most_motion_nm));
  const std::string_view why = why_partial_fit_only(find_model(settings.model));
  require(why.empty(), "model", settings.model, fmt::format("a simulated one: of this, {}", why));
  const FeedbackSettings& feedback = settings.feedback;
  if (feedback.enabled) {
    require(settings.comb.tones[0].driven, "comb.tones[0].driven", false,
            "true: the feedback acts on its amplitude");
    require(feedback.set_point > 0.0 && feedback.set_point < 1.0, "feedback.set_point", feedback.set_point,
            "> 0 and < 1");
    require(feedback.gain > 0.0 && feedback.gain <= 2.0, "feedback.gain", feedback.gain, "> 0 and <= 2");
  }
  require(std::isfinite(feedback.start_z_nm), "feedback.start_z_nm", feedback.start_z_nm, "finite");
  const auto not_negative = [](const char* field, double value) {
    require(value >= 0.0 && std::isfinite(value), field, value, ">= 0");
  };
  not_negative("temperature_k", settings.temperature_k);
  not_negative("detector_nm_per_sqrt_hz", settings.detector_nm_per_sqrt_hz);
  not_negative("volts_per_code", settings.volts_per_code);
  not_negative("z_nm_per_code", settings.z_nm_per_code);
  const double most_free_s =
      most_windows * static_cast<double>(settings.comb.window_samples) / settings.sample_rate_hz;
  require(settings.free_seconds >= 0.0 && settings.free_seconds <= most_free_s, "free_seconds",
          settings.free_seconds, fmt::format(">= 0 and <= {}, 2^32 - 1 windows of the comb", most_free_s));
  require(settings.block_frames >= 1 && settings.block_frames <= most_block_frames, "block_frames",
          settings.block_frames, fmt::format("1..{}", most_block_frames));
  validate_faults(settings.faults);
}

std::vector<Complex> drive_forces(const SimulationSettings& settings) {
  return drive_forces(settings.drive, settings.cantilever, driven_frequencies(settings));
}

std::vector<Complex> exact_free_response(const SimulationSettings& settings) {
  const std::vector<Complex> forces = drive_forces(settings);
  std::vector<Complex> response;
  std::size_t driven = 0;
  for (const Tone& tone : settings.comb.tones) {
    response.push_back(tone.driven
                           ? tip_response(settings.cantilever, tone_hz(settings, tone)) * forces[driven++]
                           : Complex(0.0));
  }
  return response;
}

Channels simulated_channels(const SimulationSettings& settings) {
  Channel deflection{"deflection", ChannelRole::deflection, "V", settings.volts_per_code, 0.0, {}};
  if (!(deflection.scale > 0.0)) {
    const std::vector<Complex> forces = drive_forces(settings);
    const std::vector<double> frequencies = driven_frequencies(settings);
    double greatest_v = 0.0;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      greatest_v += std::abs(detector_response(settings.cantilever, frequencies[i]) * forces[i]);
    }
    deflection.scale = greatest_v > 0.0 ? 2.0 * greatest_v / std::numeric_limits<std::int16_t>::max() : 1.0;
  }
  Channels channels{deflection};
  if (settings.z_nm_per_code > 0.0) {
    channels.push_back({"z", ChannelRole::z, "nm", settings.z_nm_per_code, 0.0, {}});
  }
  return channels;
}

}  // namespace combforce
