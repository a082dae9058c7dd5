#include "daemon/pipeline/drift.hpp"

#include <fmt/format.h>

#include <cmath>

namespace combforce {
namespace {

constexpr std::uint64_t least_windows = 4;
// Of |sum last* next| to the sum of magnitudes: 1 for a tone without noise however it turns, 1/sqrt(windows)
// for noise. 0.9 is an amplitude of four times the noise.
constexpr double least_overlap = 0.9;
constexpr double deviations = 4.0;
constexpr double deviations_of_a_tone = 3.0;

double variance_of(const FreeResponse& response, std::size_t tone) {
  if (!response.covariance) return 0.0;
  const std::size_t order = 2 * response.mean_nm.size();
  const auto diagonal = [&](std::size_t i) { return (*response.covariance)[i * order + i]; };
  return diagonal(2 * tone) + diagonal(2 * tone + 1);
}

// The noise of a window is what it is in the free response.
double lifted_variance(const FreeResponse& response, std::size_t tone) {
  if (response.windows == 0 || response.lifted_windows == 0) return variance_of(response, tone);
  return variance_of(response, tone) * static_cast<double>(response.windows) /
         static_cast<double>(response.lifted_windows);
}

}  // namespace

TurnMeter::TurnMeter(const Comb& comb) {
  for (std::size_t i = 0; i < comb.tones.size(); ++i)
    if (comb.tones[i].driven) tones_.push_back({.bin = comb.tones[i].bin, .index = i});
}

void TurnMeter::add(std::span<const std::complex<double>> phasors) {
  for (Tone& tone : tones_) {
    const std::complex<double> next = phasors[tone.index];
    if (windows_ > 0) {
      const std::complex<double> product = std::conj(tone.last) * next;
      const double turn = std::arg(product);
      tone.turn_rad += turn;
      tone.square_rad += turn * turn;
      tone.overlap += product;
      tone.weight += std::abs(product);
    }
    tone.last = next;
  }
  ++windows_;
}

void TurnMeter::begin_again() {
  for (Tone& tone : tones_) tone = {.bin = tone.bin, .index = tone.index};
  windows_ = 0;
}

std::string TurnMeter::find_turn(double tolerance_rad) const {
  if (windows_ < least_windows) return {};
  const auto turns = static_cast<double>(windows_ - 1);
  const Tone* worst = nullptr;
  double greatest = 0.0;
  for (const Tone& tone : tones_) {
    if (!(std::abs(tone.overlap) > least_overlap * tone.weight)) continue;
    // Phase noise of the windows enters the turn once at either end, as it does every step.
    const double variance = (tone.square_rad - tone.turn_rad * tone.turn_rad / turns) / (turns - 1.0);
    const double beyond =
        std::abs(tone.turn_rad) - tolerance_rad - deviations * std::sqrt(std::max(0.0, variance));
    if (beyond <= greatest) continue;
    greatest = beyond;
    worst = &tone;
  }
  if (worst == nullptr) return {};
  return fmt::format(
      "the tone of bin {} turned by {:.3g} rad in {} windows, more than {:.3g}: drive and digitizer "
      "share no clock, or the motion had not settled",
      worst->bin, worst->turn_rad, windows_, tolerance_rad);
}

std::string find_change(const Comb& comb, const FreeResponse& before, const FreeResponse& after,
                        double tolerance) {
  std::string worst;
  double greatest = 0.0;
  for (std::size_t i = 0; i < comb.tones.size(); ++i) {
    if (!comb.tones[i].driven) continue;
    const auto compare = [&](const char* name, std::complex<double> old, std::complex<double> now,
                             double variance) {
      const double size = std::abs(old), change = std::abs(now - old);
      const double beyond = change - tolerance * size - deviations * std::sqrt(variance);
      if (!(beyond > greatest * size)) return;
      greatest = beyond / size;
      worst = fmt::format(
          "since sample {} the {} response of the tone of bin {} changed by {:.3g} of itself, more than "
          "{:.3g}: forces measured between refer to a motion that no longer was",
          before.first_sample, name, comb.tones[i].bin, change / size, tolerance);
    };
    compare("free", before.mean_nm[i], after.mean_nm[i], variance_of(before, i) + variance_of(after, i));
    if (before.lifted_nm && after.lifted_nm)
      compare("lifted", (*before.lifted_nm)[i], (*after.lifted_nm)[i],
              lifted_variance(before, i) + lifted_variance(after, i));
  }
  return worst;
}

std::string find_lost_tone(const Comb& comb, const FreeResponse& response) {
  std::string worst;
  double least = deviations_of_a_tone;
  for (std::size_t i = 0; i < comb.tones.size(); ++i) {
    const double size = std::abs(response.mean_nm[i]);
    const double noise = std::sqrt(variance_of(response, i));
    if (!comb.tones[i].driven || !(size < least * noise)) continue;
    least = size / noise;
    worst = fmt::format(
        "the free response of the tone of bin {} is noise: {:.3g} nm, less than {:g} times its standard "
        "deviation of {:.3g} nm; is the drive on?",
        comb.tones[i].bin, size, deviations_of_a_tone, noise);
  }
  return worst;
}

}  // namespace combforce
