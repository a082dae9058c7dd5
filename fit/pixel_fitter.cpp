#include "fit/pixel_fitter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "fit/box_least_squares.hpp"
#include "fit/fitter.hpp"
#include "fit/force_balance.hpp"
#include "fit/harmonics.hpp"
#include "fit/measured_force.hpp"
#include "fit/model_list.hpp"
#include "fit/whitening.hpp"

namespace combforce {
namespace {

std::vector<std::uint64_t> bins_of(const Comb& comb) {
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : comb.tones) bins.push_back(tone.bin);
  return bins;
}

std::vector<Bounds> bounds_of(const FitSettings& settings) {
  std::vector<Bounds> bounds;
  for (const ParameterInfo& info : find_model(settings.model).parameters) {
    bounds.push_back({info.lower, info.upper});
    for (const ParameterBounds& own : settings.bounds)
      if (own.parameter == info.name) bounds.back() = {own.lower, own.upper};
  }
  return bounds;
}

void validate_bounds(const FitSettings& settings) {
  const ModelInfo& model = find_model(settings.model);
  for (std::size_t i = 0; i < settings.bounds.size(); ++i) {
    const ParameterBounds& own = settings.bounds[i];
    const auto info = std::ranges::find(model.parameters, own.parameter, &ParameterInfo::name);
    if (info == model.parameters.end())
      throw std::invalid_argument(fmt::format("settings.bounds[{}].parameter: \"{}\", not of model {}", i,
                                              own.parameter, model.name));
    if (!std::isfinite(own.lower) || !std::isfinite(own.upper) || !(own.lower < own.upper))
      throw std::invalid_argument(fmt::format("settings.bounds[{}]: {} to {}, must be finite and ascending",
                                              i, own.lower, own.upper));
    if (info->lower > 0.0 && !(own.lower > 0.0))
      throw std::invalid_argument(
          fmt::format("settings.bounds[{}].lower: {}, must be positive for {}", i, own.lower, own.parameter));
  }
}

void validate_free_response(const FreeResponse& free, std::size_t tones) {
  if (free.mean_nm.size() != tones)
    throw std::invalid_argument(
        fmt::format("free_response.mean_nm: {} values for {} tones", free.mean_nm.size(), tones));
  for (std::size_t i = 0; i < tones; ++i)
    if (!std::isfinite(std::abs(free.mean_nm[i])))
      throw std::invalid_argument(fmt::format("free_response.mean_nm[{}]: must be finite", i));
  if (free.covariance && free.covariance->size() != 4 * tones * tones)
    throw std::invalid_argument(fmt::format("free_response.covariance: {} values, must be {} for {} tones",
                                            free.covariance->size(), 4 * tones * tones, tones));
}

void validate_weighting(const FitConditions& conditions) {
  if (conditions.settings.weighting == Weighting::none) return;
  if (!conditions.noise)
    throw std::invalid_argument("settings.weighting: noise, but conditions.noise is missing");
  const auto& detector = conditions.noise->detector_nm_per_sqrt_hz;
  if (conditions.noise->temperature_k == 0.0 && std::ranges::find(detector, 0.0) != detector.end())
    throw std::invalid_argument(
        "settings.weighting: noise, but noise.temperature_k and detector noise are 0");
}

void validate_intervals(const FitConditions& conditions) {
  if (!conditions.settings.profile_intervals) return;
  if (conditions.settings.refine == 0)
    throw std::invalid_argument(
        "settings.profile_intervals: true, but settings.refine is 0, must be at least 1");
  if (!conditions.noise)
    throw std::invalid_argument("settings.profile_intervals: true, but conditions.noise is missing");
}

void validate_refine(const FitSettings& settings) {
  if (settings.refine > 0 && depends_on_history(find_model(settings.model)))
    throw std::invalid_argument(fmt::format(
        "settings.refine: {}, must be 0 for model {}: its force depends on history, partial fit only",
        settings.refine, settings.model));
}

double spacing_hz(const FitConditions& conditions) {
  return conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
}

// Beyond a millimetre nothing is the tip of a cantilever: overflow, or a scale gone wrong. False for NaN.
constexpr double longest_nm = 1e6;

bool plausible(std::span<const std::complex<double>> tones) {
  return std::ranges::all_of(tones, [](std::complex<double> tone) { return std::abs(tone) <= longest_nm; });
}

}  // namespace

void validate(const FitConditions& conditions) {
  if (!(conditions.sample_rate_hz > 0.0) || !std::isfinite(conditions.sample_rate_hz))
    throw std::invalid_argument(
        fmt::format("sample_rate_hz: {}, must be positive and finite", conditions.sample_rate_hz));
  validate(conditions.comb);
  if (conditions.windows < 1) throw std::invalid_argument("windows: 0, must be at least 1");
  validate(conditions.cantilever);
  const std::size_t tones = conditions.comb.tones.size();
  if (conditions.free_response) validate_free_response(*conditions.free_response, tones);
  if (conditions.noise) validate(*conditions.noise, tones);
  validate_bounds(conditions.settings);
  validate_refine(conditions.settings);
  if (conditions.settings.tip) validate(*conditions.settings.tip);
  validate_weighting(conditions);
  validate_intervals(conditions);
}

class PixelFitter::State {
 public:
  explicit State(const FitConditions& conditions)
      : comb_(conditions.comb),
        model_(&find_model(conditions.settings.model)),
        tones_(conditions.comb.tones.size()),
        refers_(conditions.free_response.has_value()),
        harmonics_(harmonics_of(conditions)),
        measured_(refers_ ? conditions : without_motion(conditions), strong_hz(harmonics_.get())),
        balance_(bins_of(conditions.comb), spacing_hz(conditions)),
        fitter_(fitter_of(conditions.settings)),
        weights_(weights_of(conditions, measured_)),
        whitening_(whitening(measured_, weights_)),
        ones_(tones_, 1.0),
        turns_(tones_),
        tip_nm_(tones_),
        last_(tones_) {}

  void fit(std::span<const std::complex<double>> tip_nm, std::uint64_t first_sample,
           std::span<const double> start, FitResult& result) {
    const std::size_t count = model_->parameters.size();
    require_tones(tip_nm);
    if (!refers_) {
      result = unfitted(FitStatus::no_free_response, count);
      return;
    }
    if (!plausible(tip_nm)) {
      result = unfitted(FitStatus::not_converged, count);
      return;
    }
    begin_at(first_sample, tip_nm);
    if (!measured_.contact()) {
      result = unfitted(FitStatus::no_contact, count);
    } else if (std::ranges::all_of(tip_nm, [](std::complex<double> d) { return d == 0.0; })) {
      result = unfitted(FitStatus::not_converged, count);
    } else {
      set_motion(tip_nm_);
      fitter_->fit(measured_, tip_nm_, weights_, whitening_, start, result);
      return;
    }
    result.virial_nn_nm = measured_.virial_nn_nm();
    result.dissipated_fw = measured_.dissipated_fw();
  }

  double error(std::span<const std::complex<double>> tip_nm, std::span<const double> parameters) {
    require_tones(tip_nm);
    begin_at(0, tip_nm);
    set_motion(tip_nm_);
    return fitter_->error(measured_, ones_, parameters);
  }

  const ModelInfo& model() const { return *model_; }

 private:
  // Without a free response nothing is fitted, and E refers to none.
  static FitConditions without_motion(FitConditions conditions) {
    conditions.free_response = FreeResponse{};
    conditions.free_response->mean_nm.assign(conditions.comb.tones.size(), 0.0);
    return conditions;
  }

  std::unique_ptr<Fitter> fitter_of(const FitSettings& settings) {
    const std::vector<Bounds> bounds = bounds_of(settings);
    const FitterSetup setup{balance_,         tones_,          bounds,
                            harmonics_.get(), settings.refine, settings.profile_intervals};
    return visit_model(*model_, [&](auto type) { return make_fitter<decltype(type)>(setup); });
  }

  // By the noise where it is known; a refined fit without it weighs by the thermal forces' share, whatever
  // the temperature.
  static std::vector<double> weights_of(const FitConditions& conditions, const MeasuredForce& measured) {
    std::vector<double> weights(conditions.comb.tones.size(), 1.0);
    const bool known =
        measured.noise_known() && std::ranges::all_of(measured.variances(), [](double v) { return v > 0.0; });
    if (known && (conditions.settings.refine > 0 || conditions.settings.weighting == Weighting::noise))
      std::ranges::transform(measured.variances(), weights.begin(), [](double v) { return 1.0 / v; });
    else if (conditions.settings.refine > 0)
      for (std::size_t i = 0; i < weights.size(); ++i)
        weights[i] = 1.0 / tip_force_density(conditions.cantilever,
                                             conditions.sample_rate_hz *
                                                 static_cast<double>(conditions.comb.tones[i].bin) /
                                                 static_cast<double>(conditions.comb.window_samples),
                                             1.0);
    return weights;
  }

  static std::unique_ptr<Harmonics> harmonics_of(const FitConditions& conditions) {
    if (conditions.settings.refine == 0) return nullptr;
    const double band = visit_model(find_model(conditions.settings.model), [](auto type) {
      return DependsOnVelocity<decltype(type)> ? Harmonics::band_of_viscous_forces
                                               : Harmonics::band_of_elastic_forces;
    });
    return std::make_unique<Harmonics>(conditions.comb, conditions.cantilever, spacing_hz(conditions), band);
  }

  static std::vector<double> strong_hz(const Harmonics* harmonics) {
    std::vector<double> frequencies_hz;
    if (harmonics != nullptr)
      for (const std::size_t n : harmonics->strong())
        frequencies_hz.push_back(static_cast<double>(n) * harmonics->spacing_hz());
    return frequencies_hz;
  }

  void require_tones(std::span<const std::complex<double>> tip_nm) const {
    if (tip_nm.size() != tones_)
      throw std::invalid_argument(fmt::format("tip_nm: {} values for {} tones", tip_nm.size(), tones_));
  }

  // The noise model has the window begin at time 0.
  void begin_at(std::uint64_t first_sample, std::span<const std::complex<double>> tip_nm) {
    for (std::size_t i = 0; i < tones_; ++i) {
      const std::uint64_t index = phase_index(comb_.tones[i].bin, first_sample, comb_.window_samples);
      turns_[i] = std::polar(1.0, phase_radians(index, comb_.window_samples));
      tip_nm_[i] = turns_[i] * tip_nm[i];
    }
    measured_.set(tip_nm_, turns_);
  }

  // Maps of E ask for one motion again and again.
  void set_motion(std::span<const std::complex<double>> tip_nm) {
    if (std::ranges::equal(tip_nm, last_)) return;
    balance_.set_motion(tip_nm);
    std::ranges::copy(tip_nm, last_.begin());
  }

  Comb comb_;
  const ModelInfo* model_;
  std::size_t tones_;
  bool refers_;
  std::unique_ptr<Harmonics> harmonics_;  // null: the paper's fit
  MeasuredForce measured_;
  ForceBalance balance_;
  std::unique_ptr<Fitter> fitter_;
  std::vector<double> weights_;
  Whitening whitening_;
  std::vector<double> ones_;
  std::vector<std::complex<double>> turns_, tip_nm_;  // of the pixel, from sample 0 to its first and there
  std::vector<std::complex<double>> last_;            // tones of the motion in balance_; all 0 at first
};

PixelFitter::PixelFitter(const FitConditions& conditions) {
  validate(conditions);
  state_ = std::make_unique<State>(conditions);
}
PixelFitter::~PixelFitter() = default;
PixelFitter::PixelFitter(PixelFitter&&) noexcept = default;
PixelFitter& PixelFitter::operator=(PixelFitter&&) noexcept = default;

void PixelFitter::fit(std::span<const std::complex<double>> tip_nm, FitResult& result,
                      std::uint64_t first_sample) {
  state_->fit(tip_nm, first_sample, {}, result);
}

void PixelFitter::fit_from(std::span<const std::complex<double>> tip_nm, std::span<const double> start,
                           FitResult& result) {
  if (start.size() != model().parameters.size())
    throw std::invalid_argument(fmt::format("start: {} values, but model {} has {}", start.size(),
                                            model().name, model().parameters.size()));
  state_->fit(tip_nm, 0, start, result);
}

double PixelFitter::error(std::span<const std::complex<double>> tip_nm, std::span<const double> parameters) {
  if (parameters.size() != model().parameters.size())
    throw std::invalid_argument(fmt::format("parameters: {} values, but model {} has {}", parameters.size(),
                                            model().name, model().parameters.size()));
  return state_->error(tip_nm, parameters);
}

const ModelInfo& PixelFitter::model() const {
  return state_->model();
}

}  // namespace combforce
