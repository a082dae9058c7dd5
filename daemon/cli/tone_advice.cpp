#include "daemon/cli/tone_advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "daemon/cli/parallel.hpp"
#include "drivers/simulated/steady_state.hpp"
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

double delta_f_hz(const FitConditions& conditions) {
  return conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
}

std::vector<std::uint64_t> candidates(const Comb& comb, std::uint64_t reach) {
  std::uint64_t divisor = 0;
  for (const Tone& tone : comb.tones)
    if (tone.driven) divisor = std::gcd(divisor, tone.bin);
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : comb.tones)
    for (std::uint64_t bin = tone.bin > reach ? tone.bin - reach : 1; bin <= tone.bin + reach; ++bin)
      if (bin % divisor == 0 && 2 * bin < comb.window_samples) bins.push_back(bin);
  std::ranges::sort(bins);
  bins.erase(std::ranges::unique(bins).begin(), bins.end());
  std::erase_if(bins, [&](std::uint64_t bin) {
    return std::ranges::find(comb.tones, bin, &Tone::bin) != comb.tones.end();
  });
  return bins;
}

SteadyStateSettings motion_of(const TypicalPixel& pixel, const std::vector<std::uint64_t>& bins) {
  const FitConditions& conditions = pixel.conditions;
  double fastest_hz = 0.0, relaxation_s = 0.0;
  for (const Mode& mode : conditions.cantilever.modes) {
    fastest_hz = std::max(fastest_hz, mode.frequency_hz);
    relaxation_s = std::max(relaxation_s, mode.quality_factor / (std::numbers::pi * mode.frequency_hz));
  }
  const double finer = std::ceil(std::max(1.0, oversampling * fastest_hz / conditions.sample_rate_hz));
  if (!(finer <= most_finer))
    throw std::invalid_argument(fmt::format("sample rate: {} Hz, must be at least {} Hz for a mode at {} Hz",
                                            conditions.sample_rate_hz, oversampling / most_finer * fastest_hz,
                                            fastest_hz));
  const double windows = std::ceil(settled_relaxations * relaxation_s * delta_f_hz(conditions));
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
  settings.bins = bins;
  settings.settle_windows = static_cast<std::uint32_t>(windows);
  return settings;
}

Phasors settled_tones(const TypicalPixel& pixel, const std::vector<std::uint64_t>& bins) {
  SteadyStateSettings settings = motion_of(pixel, bins);
  const std::uint32_t least = settings.settle_windows;
  for (const std::uint32_t windows : {least, least + further_windows}) {
    settings.settle_windows = windows;
    const Phasors before = simulate_steady_state(settings).tip_nm;
    settings.settle_windows = windows + 1;
    Phasors after = simulate_steady_state(settings).tip_nm;
    double moved = 0.0;
    for (std::size_t i = 0; i < after.size(); ++i) moved = std::max(moved, std::abs(after[i] - before[i]));
    if (moved < settled_nm) return after;
  }
  throw std::invalid_argument("parameters: the motion over this surface does not settle; choose others");
}

// The tones of every bin that may be measured, and how well a comb of some of them tells the parameters.
class Judge {
 public:
  Judge(const TypicalPixel& pixel, std::vector<std::uint64_t> bins)
      : pixel_(pixel), bins_(std::move(bins)), tones_(settled_tones(pixel, bins_)) {}

  FitResult fit(const std::vector<std::uint64_t>& added) const {
    FitConditions conditions = pixel_.conditions;
    FreeResponse free;
    Phasors tones;
    std::size_t driven = 0;
    for (const std::uint64_t bin : added) {
      conditions.comb.tones.push_back({bin, false});
      if (conditions.noise->detector_nm_per_sqrt_hz.size() > 1)
        conditions.noise->detector_nm_per_sqrt_hz.push_back(
            conditions.noise->detector_nm_per_sqrt_hz[nearest_tone(bin)]);
    }
    for (const Tone& tone : conditions.comb.tones) {
      const double hz = delta_f_hz(conditions) * static_cast<double>(tone.bin);
      free.mean_nm.push_back(
          tone.driven ? tip_response(conditions.cantilever, hz) * pixel_.drive_forces_nn[driven++] : 0.0);
      tones.push_back(
          tones_[static_cast<std::size_t>(std::ranges::lower_bound(bins_, tone.bin) - bins_.begin())]);
    }
    conditions.free_response = free;
    PixelFitter fitter(conditions);
    FitResult result;
    fitter.fit_from(tones, pixel_.parameters, result);
    return result;
  }

 private:
  std::size_t nearest_tone(std::uint64_t bin) const {
    const auto distance = [bin](const Tone& tone) {
      return tone.bin > bin ? tone.bin - bin : bin - tone.bin;
    };
    const std::vector<Tone>& tones = pixel_.conditions.comb.tones;
    return static_cast<std::size_t>(std::ranges::min_element(tones, {}, distance) - tones.begin());
  }

  const TypicalPixel& pixel_;
  std::vector<std::uint64_t> bins_;  // ascending
  Phasors tones_;
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

// Logarithm of the product of the errors; infinite where one is not known, or the fit went elsewhere.
double score(const FitResult& fit, const std::vector<double>& truth) {
  double sum = 0.0;
  for (std::size_t k = 0; k < truth.size(); ++k) sum += std::log(fit.std_errors[k]);
  return comes_back(fit, truth) && std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

}  // namespace

ToneAdvice advise_tones(const TypicalPixel& pixel, std::size_t tones, std::uint64_t reach,
                        const std::function<void(std::size_t, std::size_t)>& progress) {
  check(pixel);
  std::vector<std::uint64_t> left = candidates(pixel.conditions.comb, reach), bins = left;
  for (const Tone& tone : pixel.conditions.comb.tones) bins.push_back(tone.bin);
  std::ranges::sort(bins);
  const Judge judge(pixel, bins);

  ToneAdvice advice;
  const FitResult now = judge.fit({});
  if (now.status == FitStatus::no_contact)
    throw std::invalid_argument("parameters: the tip does not touch this surface");
  if (!comes_back(now, pixel.parameters))
    throw std::invalid_argument(
        fmt::format("parameters: a fit of this comb does not come back to them from exact tones (status {}); "
                    "choose others",
                    to_string(now.status)));
  double least = score(now, pixel.parameters);
  if (!std::isfinite(least))
    throw std::invalid_argument(fmt::format("comb: does not determine all parameters of {} (status {})",
                                            pixel.conditions.settings.model, to_string(now.status)));
  advice.std_errors = errors_of(now);

  std::vector<std::uint64_t> added;
  std::size_t tried = 0, to_try = 0;
  for (std::size_t i = 0; i < std::min(tones, left.size()); ++i) to_try += left.size() - i;
  std::mutex progress_mutex;
  while (added.size() < tones && !left.empty()) {
    std::vector<FitResult> fits(left.size());
    parallel_for(left.size(), [&] {
      return [&](std::size_t i) {
        std::vector<std::uint64_t> with = added;
        with.push_back(left[i]);
        fits[i] = judge.fit(with);
        const std::lock_guard lock(progress_mutex);
        ++tried;
        if (progress) progress(tried, to_try);
      };
    });
    std::size_t best = 0;
    for (std::size_t i = 1; i < fits.size(); ++i)
      if (score(fits[i], pixel.parameters) < score(fits[best], pixel.parameters)) best = i;
    if (!(score(fits[best], pixel.parameters) < least)) break;
    least = score(fits[best], pixel.parameters);
    added.push_back(left[best]);
    advice.steps.push_back({left[best], errors_of(fits[best])});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
  }
  return advice;
}

}  // namespace combforce
