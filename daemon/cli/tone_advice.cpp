#include "daemon/cli/tone_advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <mutex>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>

#include "daemon/cli/parallel.hpp"
#include "daemon/cli/tone_information.hpp"
#include "drivers/simulated/steady_state.hpp"
#include "dsp/fourier.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {
namespace {

using Phasors = std::vector<std::complex<double>>;

// The motion is sampled for the analysis at least so much faster than the fastest mode moves: what aliases
// into the tones is then far below the noise.
constexpr double oversampling = 8.0;
constexpr double settled_nm = 5e-6;           // tones move by less from one window to the next
constexpr double settled_relaxations = 12.0;  // of the slowest mode
constexpr double most_windows = 1000.0, most_finer = 1000.0;
constexpr std::uint32_t further_windows = 30;  // waited for slower motion
constexpr double came_back = 0.01;             // relative, and nm of the surface position
constexpr double hardly_known = 30.0;          // standard errors of the comb: adds 0.1 % to what it tells

SteadyStateSettings motion_of(const TypicalPixel& pixel) {
  const FitConditions& conditions = pixel.conditions;
  double fastest_hz = 0.0, relaxation_s = 0.0;
  for (const Mode& mode : conditions.cantilever.modes) {
    fastest_hz = std::max(fastest_hz, mode.frequency_hz);
    relaxation_s = std::max(relaxation_s, mode.quality_factor / (std::numbers::pi * mode.frequency_hz));
  }
  // Even: spectra are of even numbers of samples.
  const double finer =
      2.0 * std::ceil(std::max(1.0, 0.5 * oversampling * fastest_hz / conditions.sample_rate_hz));
  if (!(finer <= most_finer))
    throw std::invalid_argument(fmt::format("sample rate: {} Hz, must be at least {} Hz for a mode at {} Hz",
                                            conditions.sample_rate_hz, oversampling / most_finer * fastest_hz,
                                            fastest_hz));
  const double windows = std::ceil(settled_relaxations * relaxation_s * bin_hz(conditions));
  if (!(windows <= most_windows))
    throw std::invalid_argument(fmt::format(
        "cantilever: rings for {} windows of the comb, must be at most {}", windows, most_windows));
  SteadyStateSettings settings;
  settings.oscillator.sample_rate_hz = finer * conditions.sample_rate_hz;
  settings.oscillator.window_samples = static_cast<std::uint64_t>(finer) * conditions.comb.window_samples;
  settings.oscillator.cantilever = conditions.cantilever;
  for (const Tone& tone : conditions.comb.tones)
    if (tone.driven) settings.oscillator.drive_bins.push_back(tone.bin);
  settings.oscillator.drive_forces_nn = pixel.drive_forces_nn;
  settings.oscillator.accuracy = IntegratorAccuracy::accurate;
  settings.model = conditions.settings.model;
  settings.parameters = pixel.parameters;
  for (const Tone& tone : conditions.comb.tones) settings.bins.push_back(tone.bin);
  settings.settle_windows = static_cast<std::uint32_t>(windows);
  return settings;
}

// Of the tip, over a window.
std::vector<double> settled_motion(const TypicalPixel& pixel) {
  SteadyStateSettings settings = motion_of(pixel);
  const std::uint32_t least = settings.settle_windows;
  for (const std::uint32_t windows : {least, least + further_windows}) {
    settings.settle_windows = windows;
    settings.keep_motion = false;
    const Phasors before = simulate_steady_state(settings).tip_nm;
    settings.settle_windows = windows + 1;
    settings.keep_motion = true;
    SteadyState after = simulate_steady_state(settings);
    double moved = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i)
      moved = std::max(moved, std::abs(after.tip_nm[i] - before[i]));
    if (moved < settled_nm) return std::move(after.tip_motion_nm);
  }
  throw std::invalid_argument("parameters: the motion over this surface does not settle; choose others");
}

// How well fits of the comb with further tones tell the parameters.
class Judge {
 public:
  // `motion`: phasors of all bins. Both outlive it.
  Judge(const TypicalPixel& pixel, const Phasors& motion) : pixel_(pixel), motion_(motion) {}

  FitResult fit(std::span<const std::uint64_t> added) const {
    FitConditions conditions = pixel_.conditions;
    FreeResponse free;
    Phasors tones;
    std::size_t driven = 0;
    for (const std::uint64_t bin : added) {
      conditions.comb.tones.push_back({bin, false});
      if (conditions.noise->detector_nm_per_sqrt_hz.size() > 1)
        conditions.noise->detector_nm_per_sqrt_hz.push_back(detector_density_near(pixel_.conditions, bin));
    }
    for (const Tone& tone : conditions.comb.tones) {
      const double hz = bin_hz(conditions) * static_cast<double>(tone.bin);
      free.mean_nm.push_back(
          tone.driven ? tip_response(conditions.cantilever, hz) * pixel_.drive_forces_nn[driven++] : 0.0);
      tones.push_back(motion_[tone.bin]);
    }
    conditions.free_response = free;
    PixelFitter fitter(conditions);
    FitResult result;
    fitter.fit_from(tones, pixel_.parameters, result);
    return result;
  }

 private:
  const TypicalPixel& pixel_;
  const Phasors& motion_;
};

std::vector<double> errors_of(const FitResult& fit) {
  return {fit.std_errors.begin(), fit.std_errors.begin() + fit.parameters_count};
}

bool comes_back(const FitResult& fit, const std::vector<double>& truth) {
  for (std::size_t k = 0; k < truth.size(); ++k)
    if (!(std::abs(fit.parameters[k] - truth[k]) <= came_back * (k == 0 ? 1.0 : std::abs(truth[k]))))
      return false;
  return fit.status == FitStatus::converged || fit.status == FitStatus::ill_conditioned ||
         fit.status == FitStatus::ambiguous;
}

void check(const TypicalPixel& pixel) {
  const FitConditions& conditions = pixel.conditions;
  if (std::ranges::all_of(pixel.drive_forces_nn, [](std::complex<double> force) { return force == 0.0; }))
    throw std::invalid_argument("drive: no tone of the comb is driven");
  const std::vector<double>& detector = conditions.noise->detector_nm_per_sqrt_hz;
  if (conditions.noise->temperature_k == 0.0 && std::ranges::find(detector, 0.0) != detector.end())
    throw std::invalid_argument(
        "noise: temperature_k and detector noise are 0, so nothing limits the parameters");
  if (2 * conditions.comb.tones.size() < pixel.parameters.size())
    throw std::invalid_argument(fmt::format("comb: {} tones measure {} numbers, must be at least {} for {}",
                                            conditions.comb.tones.size(), 2 * conditions.comb.tones.size(),
                                            pixel.parameters.size(), conditions.settings.model));
}

// The choice of tones to first order in the noise.
class Choice {
 public:
  // `errors`: of the comb.
  Choice(const ToneInformation& information, const std::vector<double>& errors)
      : information_(information), errors_(errors) {}

  // Best first; without these.
  std::vector<std::uint64_t> best(std::size_t count, const std::vector<std::uint64_t>& barred) const {
    std::vector<std::uint64_t> chosen = barred;  // is not chosen again
    const auto added = [&] { return std::span(chosen).subspan(barred.size()); };
    count = std::min(count, information_.candidates().size() - barred.size());
    double least = 0.0;
    while (added().size() < count) {
      const Found found = best_beside(chosen, knowledge_of(added()));
      if (!std::isfinite(found.score))
        throw std::invalid_argument("parameters: the motion over this surface is at the edge of stability");
      chosen.push_back(found.bin);
      least = found.score;
    }
    for (bool better = true; better;) {
      better = false;
      for (std::uint64_t& bin : added()) {
        std::vector<std::uint64_t> rest;
        std::ranges::copy_if(added(), std::back_inserter(rest),
                             [&](std::uint64_t other) { return other != bin; });
        const Found found = best_beside(chosen, knowledge_of(rest));
        if (!(found.score < exchanged * least)) continue;
        bin = found.bin;
        least = found.score;
        better = true;
      }
    }
    return ordered({added().begin(), added().end()});
  }

 private:
  struct Found {
    std::uint64_t bin = 0;
    double score = std::numeric_limits<double>::infinity();
  };
  static constexpr double exchanged = 0.9999;  // of the score: an end to exchanges

  ToneInformation::Knowledge knowledge_of(std::span<const std::uint64_t> added) const {
    ToneInformation::Knowledge knowledge = information_.of_comb();
    for (const std::uint64_t bin : added) information_.measure(bin, knowledge);
    return knowledge;
  }

  double score(std::uint64_t bin, const ToneInformation::Knowledge& knowledge) const {
    const Eigen::VectorXd variances = information_.variances_with(bin, knowledge);
    double sum = 0.0;
    for (std::size_t k = 0; k < errors_.size(); ++k)
      sum += variances(static_cast<Eigen::Index>(k)) / (errors_[k] * errors_[k]);
    return sum;
  }

  Found best_of(std::span<const std::uint64_t> bins, const ToneInformation::Knowledge& knowledge) const {
    Found best;
    for (const std::uint64_t bin : bins)
      if (const double sum = score(bin, knowledge); sum < best.score) best = {bin, sum};
    return best;
  }
  Found best_beside(const std::vector<std::uint64_t>& chosen,
                    const ToneInformation::Knowledge& knowledge) const {
    std::vector<std::uint64_t> left;
    std::ranges::copy_if(information_.candidates(), std::back_inserter(left),
                         [&](std::uint64_t bin) { return std::ranges::find(chosen, bin) == chosen.end(); });
    return best_of(left, knowledge);
  }

  std::vector<std::uint64_t> ordered(std::vector<std::uint64_t> bins) const {
    std::vector<std::uint64_t> order;
    while (!bins.empty()) {
      order.push_back(best_of(bins, knowledge_of(order)).bin);
      std::erase(bins, order.back());
    }
    return order;
  }

  const ToneInformation& information_;
  std::vector<double> errors_;
};

}  // namespace

ToneAdvice advise_tones(const TypicalPixel& pixel, std::size_t tones,
                        const std::function<void(std::size_t, std::size_t)>& progress) {
  check(pixel);
  const std::vector<double> motion_nm = settled_motion(pixel);
  const Phasors motion = spectrum_of(motion_nm);
  const Judge judge(pixel, motion);
  const FitResult now = judge.fit({});
  if (now.status == FitStatus::no_contact)
    throw std::invalid_argument("parameters: the tip does not touch this surface");
  if (!comes_back(now, pixel.parameters))
    throw std::invalid_argument(
        fmt::format("parameters: a fit of this comb does not come back to them from exact tones (status {}); "
                    "choose others",
                    to_string(now.status)));
  ToneAdvice advice;
  advice.std_errors = errors_of(now);
  if (!std::ranges::all_of(advice.std_errors, [](double error) { return std::isfinite(error); }))
    throw std::invalid_argument(fmt::format("comb: does not determine all parameters of {} (status {})",
                                            pixel.conditions.settings.model, to_string(now.status)));

  std::vector<double> known;
  for (const double error : advice.std_errors) known.push_back(hardly_known * error);
  const ToneInformation information(pixel.conditions, pixel.parameters, known, motion_nm);
  const Choice choice(information, advice.std_errors);
  std::vector<std::uint64_t> barred;  // a fit with them goes elsewhere
  for (;;) {
    const std::vector<std::uint64_t> added = choice.best(tones, barred);
    std::vector<FitResult> fits(added.size());
    std::size_t done = 0;
    std::mutex progress_mutex;
    parallel_for(fits.size(), [&] {
      return [&](std::size_t i) {
        fits[i] = judge.fit(std::span(added).first(i + 1));
        const std::lock_guard lock(progress_mutex);
        if (progress) progress(++done, fits.size());
      };
    });
    const std::size_t before = barred.size();
    for (std::size_t i = 0; i < added.size(); ++i)
      if (!comes_back(fits[i], pixel.parameters)) barred.push_back(added[i]);
    if (barred.size() > before) continue;
    for (std::size_t i = 0; i < added.size(); ++i) advice.steps.push_back({added[i], errors_of(fits[i])});
    return advice;
  }
}

}  // namespace combforce
