#include "daemon/recorded_description.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "daemon/pipeline/analysis.hpp"

namespace combforce {
namespace {

using Complex = std::complex<double>;

double frequency_hz(const Comb& comb, const Tone& tone, double sample_rate_hz) {
  return sample_rate_hz * static_cast<double>(tone.bin) / static_cast<double>(comb.window_samples);
}

// By what motion at a frequency that was described by `from` is to be multiplied to be as `to` has it. Who
// knows of no volts told lengths.
Complex turn(const Description& from, const Description& to, double frequency_hz) {
  if (!from.cantilever && !from.channels) return 1.0;
  const auto scale = [](const Description& of) { return of.channels ? of.channels->front().scale : 1.0; };
  return scale(to) / scale(from) * (nm_per_volt(to, frequency_hz) / nm_per_volt(from, frequency_hz));
}

// A recorded tone, and by what its motion is to be multiplied.
struct Carried {
  std::size_t from;
  Complex turn;
};

// One a tone of the comb; empty where the recording lacks one.
std::optional<std::vector<Carried>> carried_tones(const Description& recorded, const Description& under,
                                                  double sample_rate_hz) {
  std::vector<Carried> tones;
  for (const Tone& tone : under.comb->tones) {
    const auto same_frequency = [&](const Tone& other) {
      return other.bin * under.comb->window_samples == tone.bin * recorded.comb->window_samples;
    };
    const auto found = std::ranges::find_if(recorded.comb->tones, same_frequency);
    if (found == recorded.comb->tones.end()) return {};
    tones.push_back({static_cast<std::size_t>(found - recorded.comb->tones.begin()),
                     turn(recorded, under, frequency_hz(*under.comb, tone, sample_rate_hz))});
  }
  return tones;
}

std::vector<Complex> carry(const std::vector<Complex>& motion_nm, std::span<const Carried> tones) {
  std::vector<Complex> carried;
  for (const auto& [from, turn] : tones) carried.push_back(turn * motion_nm[from]);
  return carried;
}

// Rows and columns (re, im) of every tone: each block of two tones is turned from both sides.
std::vector<double> carry_covariance(const std::vector<double>& covariance, std::size_t recorded_tones,
                                     std::span<const Carried> tones) {
  std::vector<double> carried(4 * tones.size() * tones.size());
  const auto turned = [](Complex turn, std::size_t row, std::size_t column) {
    if (row == column) return turn.real();
    return row == 0 ? -turn.imag() : turn.imag();
  };
  for (std::size_t i = 0; i < 2 * tones.size(); ++i)
    for (std::size_t j = 0; j < 2 * tones.size(); ++j)
      for (std::size_t k = 0; k < 2; ++k)
        for (std::size_t l = 0; l < 2; ++l)
          carried[i * 2 * tones.size() + j] +=
              turned(tones[i / 2].turn, i % 2, k) * turned(tones[j / 2].turn, j % 2, l) *
              covariance[(2 * tones[i / 2].from + k) * 2 * recorded_tones + 2 * tones[j / 2].from + l];
  return carried;
}

void carry(FreeResponse& response, std::span<const Carried> tones, const Comb& recorded, const Comb& under) {
  if (response.covariance)
    response.covariance = carry_covariance(*response.covariance, response.mean_nm.size(), tones);
  if (response.lifted_nm) response.lifted_nm = carry(*response.lifted_nm, tones);
  response.mean_nm = carry(response.mean_nm, tones);
  for (std::uint64_t* windows : {&response.windows, &response.lifted_windows})
    if (*windows > 0)  // else it is not known
      *windows = std::max<std::uint64_t>(1, *windows * recorded.window_samples / under.window_samples);
}

// That of a tone which was not recorded is its nearest neighbour's.
std::vector<double> carried_densities(const Description& recorded, const Description& under,
                                      double sample_rate_hz) {
  const std::vector<double>& densities = recorded.noise->detector_nm_per_sqrt_hz;
  std::vector<double> carried;
  for (const Tone& tone : under.comb->tones) {
    const double at_hz = frequency_hz(*under.comb, tone, sample_rate_hz);
    const auto distance_hz = [&](const Tone& other) {
      return std::abs(frequency_hz(*recorded.comb, other, sample_rate_hz) - at_hz);
    };
    const auto nearest = std::ranges::min_element(recorded.comb->tones, {}, distance_hz);
    const auto from = static_cast<std::size_t>(nearest - recorded.comb->tones.begin());
    carried.push_back(std::abs(turn(recorded, under, at_hz)) * densities[densities.size() == 1 ? 0 : from]);
  }
  return carried;
}

// Whether volts, or tones, of the two are not the same.
bool differs(const Description& recorded, const Description& under) {
  return recorded.comb != under.comb || recorded.cantilever != under.cantilever ||
         recorded.channels != under.channels;
}

}  // namespace

Description under_configuration(const Description& recorded, const Description& configured,
                                double sample_rate_hz) {
  Description under = overlay(recorded, configured);
  if (!recorded.comb || !differs(recorded, under)) return under;
  if (recorded.free_response && !configured.free_response) {
    if (const auto tones = carried_tones(recorded, under, sample_rate_hz))
      carry(*under.free_response, *tones, *recorded.comb, *under.comb);
    else
      under.free_response.reset();
  }
  if (recorded.noise && !configured.noise)
    under.noise->detector_nm_per_sqrt_hz = carried_densities(recorded, under, sample_rate_hz);
  return under;
}

std::vector<ScheduledChange> changes_of(const SigmfMeta& meta, const Description& configured) {
  std::vector<ScheduledChange> changes;
  Description in_force = meta.description;
  for (const SigmfCapture& capture : meta.captures) {
    const Description next = in_force_from(capture, in_force);
    if (next != in_force)
      changes.push_back({capture.global_index, under_configuration(next, configured, meta.sample_rate_hz)});
    in_force = next;
  }
  return changes;
}

}  // namespace combforce
