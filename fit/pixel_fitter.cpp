#include "fit/pixel_fitter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "fit/box_least_squares.hpp"
#include "fit/calibration_errors.hpp"
#include "fit/engaged_heat.hpp"
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

double spacing_hz(const FitConditions& conditions) {
  return conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
}

// Beyond a millimetre nothing is the tip of a cantilever: overflow, or a scale gone wrong. False for NaN.
constexpr double longest_nm = 1e6;

bool plausible(std::span<const std::complex<double>> tones) {
  return std::ranges::all_of(tones, [](std::complex<double> tone) { return std::abs(tone) <= longest_nm; });
}

std::vector<std::complex<double>> motion_beside_deflection(const FitConditions& conditions) {
  const std::size_t tones = conditions.comb.tones.size();
  if (!conditions.free_response) return std::vector<std::complex<double>>(tones);
  auto beside_nm = motion_beside_deflection(conditions.excitation, conditions.cantilever,
                                            frequencies_hz(conditions), conditions.free_response->mean_nm);
  for (std::size_t i = 0; i < tones; ++i)
    if (!conditions.comb.tones[i].driven) beside_nm[i] = 0.0;  // where the base rests there is but noise
  return beside_nm;
}

// No instrument is without noise: it is not known then.
bool is_none(const Noise& noise) {
  return noise.temperature_k == 0.0 &&
         std::ranges::all_of(noise.detector_nm_per_sqrt_hz, [](double density) { return density == 0.0; });
}

// The conditions as a force at the tip has them: the free motion of the whole tip, and where a background is
// removed that near the surface, with the cantilever as it is there; the noise if there is any.
FitConditions at_surface(const FitConditions& conditions, std::span<const std::complex<double>> beside_nm) {
  FitConditions here = conditions;
  if (here.noise && is_none(*here.noise)) here.noise.reset();
  if (!here.free_response) return here;
  std::vector<std::complex<double>>& mean_nm = here.free_response->mean_nm;
  if (conditions.settings.background == Background::linear) {
    const auto& lifted_nm = conditions.free_response->lifted_nm;
    if (lifted_nm) {
      here.cantilever = cantilever_near_surface(conditions);
      mean_nm = *lifted_nm;
      here.free_response->windows = conditions.free_response->lifted_windows;
    }
  }
  for (std::size_t i = 0; i < beside_nm.size(); ++i) mean_nm[i] += beside_nm[i];
  return here;
}

// Whether there is something that forces can be measured from.
bool refers(const FitConditions& conditions) {
  return conditions.free_response &&
         (conditions.settings.background == Background::none || conditions.free_response->lifted_nm);
}

}  // namespace

class PixelFitter::State {
 public:
  // `beside_nm`: what moves the tip besides its deflection, and is part of the conditions' free response.
  State(const FitConditions& conditions, std::vector<std::complex<double>> beside_nm)
      : comb_(conditions.comb),
        model_(&find_model(conditions.settings.model)),
        tones_(conditions.comb.tones.size()),
        refers_(refers(conditions)),
        harmonics_(harmonics_of(conditions)),
        heat_(heat_of(conditions)),
        measured_(refers_ ? conditions : without_motion(conditions)),
        balance_(bins_of(conditions.comb), spacing_hz(conditions)),
        fitter_(fitter_of(conditions.settings)),
        weights_(weights_of(conditions, measured_)),
        whitening_(whitening(measured_, weights_)),
        ones_(tones_, 1.0),
        beside_nm_(std::move(beside_nm)),
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
    const FitterSetup setup{
        balance_, tones_, bounds, harmonics_.get(), heat_.get(), settings.refine, settings.profile_intervals};
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

  std::unique_ptr<EngagedHeat> heat_of(const FitConditions& conditions) const {
    if (!harmonics_) return nullptr;
    return std::make_unique<EngagedHeat>(*harmonics_, conditions.cantilever,
                                         conditions.noise ? conditions.noise->temperature_k : 0.0,
                                         conditions.windows);
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
      tip_nm_[i] = turns_[i] * (tip_nm[i] + beside_nm_[i]);
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
  std::unique_ptr<EngagedHeat> heat_;     // the same
  MeasuredForce measured_;
  ForceBalance balance_;
  std::unique_ptr<Fitter> fitter_;
  std::vector<double> weights_;
  Whitening whitening_;
  std::vector<double> ones_;
  std::vector<std::complex<double>> beside_nm_;
  std::vector<std::complex<double>> turns_, tip_nm_;  // of the pixel, from sample 0 to its first and there
  std::vector<std::complex<double>> last_;            // tones of the motion in balance_; all 0 at first
};

PixelFitter::PixelFitter(const FitConditions& conditions) {
  validate(conditions);
  const auto beside_nm = motion_beside_deflection(conditions);
  state_ = std::make_unique<State>(at_surface(conditions, beside_nm), beside_nm);
  if (conditions.settings.calibration_errors)
    calibration_errors_ = std::make_unique<CalibrationErrors>(conditions);
  for (const std::string& model : conditions.settings.compare) {
    FitConditions other = conditions;
    other.settings = single_fit(conditions.settings, model);
    compared_.emplace_back(other);
  }
}
PixelFitter::~PixelFitter() = default;
PixelFitter::PixelFitter(PixelFitter&&) noexcept = default;
PixelFitter& PixelFitter::operator=(PixelFitter&&) noexcept = default;

void PixelFitter::fit(std::span<const std::complex<double>> tip_nm, FitResult& result,
                      std::uint64_t first_sample) {
  state_->fit(tip_nm, first_sample, {}, result);
  if (calibration_errors_) calibration_errors_->find(tip_nm, first_sample, result);
  if (compared_.empty()) return;
  const std::size_t data = 2 * tip_nm.size();
  result.aicc = corrected_akaike(result, data);
  for (PixelFitter& other : compared_) {
    other.fit(tip_nm, other_, first_sample);
    result.compared[result.compared_count++] = {&other.model(), other_.status, other_.chi2_reduced,
                                                corrected_akaike(other_, data)};
  }
}

void PixelFitter::fit_from(std::span<const std::complex<double>> tip_nm, std::span<const double> start,
                           FitResult& result, std::uint64_t first_sample) {
  if (start.size() != model().parameters.size())
    throw std::invalid_argument(fmt::format("start: {} values, but model {} has {}", start.size(),
                                            model().name, model().parameters.size()));
  state_->fit(tip_nm, first_sample, start, result);
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
