#include "drivers/simulated/steady_state.hpp"

#include <fmt/format.h>

#include <numbers>
#include <stdexcept>

#include "dsp/comb.hpp"

namespace combforce {

using Complex = std::complex<double>;

namespace {

// Peak phasors of several signals at the same bins, referenced to a multiple of N.
class Phasors {
 public:
  Phasors(std::size_t signals, std::span<const std::uint64_t> bins, std::uint64_t window)
      : bins_(bins),
        index_(bins.size(), 0),
        sums_(signals, std::vector<Complex>(bins.size())),
        turns_(window) {
    for (std::uint64_t k = 0; k < window; ++k) turns_[k] = std::polar(1.0, -phase_radians(k, window));
  }

  void add(std::size_t signal, double value) {
    for (std::size_t b = 0; b < bins_.size(); ++b) sums_[signal][b] += value * turns_[index_[b]];
  }

  void next_sample() {
    for (std::size_t b = 0; b < bins_.size(); ++b) index_[b] = (index_[b] + bins_[b]) % turns_.size();
    ++samples_;
  }

  std::vector<Complex> of(std::size_t signal) const {
    std::vector<Complex> phasors = sums_[signal];
    for (Complex& phasor : phasors) phasor *= 2.0 / static_cast<double>(samples_);
    return phasors;
  }

 private:
  std::span<const std::uint64_t> bins_;
  std::vector<std::uint64_t> index_;
  std::vector<std::vector<Complex>> sums_;
  std::vector<Complex> turns_;
  std::uint64_t samples_ = 0;
};

void require_setting(bool holds, const char* field, std::uint64_t value, const char* bound) {
  if (!holds)
    throw std::invalid_argument(fmt::format("steady state.{}: {}, must be {}", field, value, bound));
}

}  // namespace

SteadyState simulate_steady_state(const SteadyStateSettings& settings) {
  const std::uint64_t window = settings.oscillator.window_samples;
  const std::size_t modes = settings.oscillator.cantilever.modes.size();
  require_setting(settings.windows >= 1, "windows", settings.windows, ">= 1");
  for (const std::uint64_t bin : settings.bins) require_setting(2 * bin < window, "bins", bin, "< N/2");

  Oscillator oscillator(settings.oscillator);
  oscillator.engage(find_model(settings.model), settings.parameters);
  std::vector<double> volts(window);
  for (std::uint32_t i = 0; i < settings.settle_windows; ++i) oscillator.advance(volts);

  SteadyState result;
  result.first_sample = oscillator.next_sample();
  result.mode_motion_nm.resize(settings.keep_motion ? modes : 0);
  Phasors phasors(modes, settings.bins, window);
  for (std::uint64_t i = 0; i < settings.windows * window; ++i) {
    double tip = 0.0;
    for (std::size_t m = 0; m < modes; ++m) {
      const double mode = oscillator.mode_nm(m);
      tip += mode;
      phasors.add(m, mode);
      if (settings.keep_motion) result.mode_motion_nm[m].push_back(mode);
    }
    if (settings.keep_motion) result.tip_motion_nm.push_back(tip);
    phasors.next_sample();
    oscillator.advance(std::span(volts).first(1));
  }
  result.tip_nm.resize(settings.bins.size());
  for (std::size_t m = 0; m < modes; ++m) {
    result.mode_nm.push_back(phasors.of(m));
    for (std::size_t b = 0; b < settings.bins.size(); ++b) result.tip_nm[b] += result.mode_nm[m][b];
  }
  result.cells = oscillator.cells();
  return result;
}

}  // namespace combforce
