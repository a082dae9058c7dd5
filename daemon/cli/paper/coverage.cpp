#include "daemon/cli/paper/coverage.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <mutex>

#include "daemon/cli/paper/tables.hpp"
#include "daemon/cli/paper/thermal_pixels.hpp"
#include "daemon/cli/parallel.hpp"
#include "fit/measured_force.hpp"
#include "fit/model_list.hpp"
#include "fit/self_consistent.hpp"

namespace combforce::paper {
namespace {

using Phasors = std::vector<std::complex<double>>;

constexpr std::size_t chain_pixels = 50;  // drawn one after the other before the next draw from rest

// Of the normal distribution.
constexpr double deviate_68 = 1.0, deviate_95 = 1.959964;

FitConditions conditions_of(const CoverageCase& of) {
  const Case& drive = find_case(of.paper_case);
  FitConditions conditions;
  conditions.sample_rate_hz = ThermalPixels::sample_rate_hz;
  conditions.comb.window_samples = ThermalPixels::window_samples;
  std::vector<std::uint64_t> bins = drive.bins;
  bins.insert(bins.end(), of.sidebands.begin(), of.sidebands.end());
  std::ranges::sort(bins);
  for (const std::uint64_t bin : bins)
    conditions.comb.tones.push_back({bin, std::ranges::find(drive.bins, bin) != drive.bins.end()});
  conditions.windows = of.windows;
  conditions.cantilever = cantilever();
  conditions.free_response = FreeResponse{0, 0, free_response(drive, bins), {}};
  conditions.noise = Noise{temperature_k, {0.0}};
  conditions.settings.model = drive.model;
  conditions.settings.refine = most_refinements;
  return conditions;
}

std::vector<std::uint64_t> bins_of(const FitConditions& conditions) {
  std::vector<std::uint64_t> bins;
  for (const Tone& tone : conditions.comb.tones) bins.push_back(tone.bin);
  return bins;
}

// Standard errors of the efficient fit to forces with white thermal noise, at the truth: (J'J/S)^-1/2.
template <typename Model>
std::vector<double> bound_of(const FitConditions& conditions, const Phasors& tip_nm,
                             std::span<const double> truth) {
  MeasuredForce measured(conditions);
  measured.set(tip_nm, Phasors(tip_nm.size(), 1.0));
  const Harmonics harmonics(conditions.comb, conditions.cantilever, delta_f_hz);
  HarmonicBalance<Model> balance(harmonics);
  SelfConsistentFit<Model> fit(balance);
  std::vector<Bounds> bounds;
  for (const ParameterInfo& info : Model::model.parameters) bounds.push_back({info.lower, info.upper});
  const Eigen::Index rows = measured.covariance().rows();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(rows, rows);
  for (Eigen::Index row = 0; row < rows; ++row)
    root(row, row) = std::sqrt(measured.variances()[static_cast<std::size_t>(row / 2)]);
  balance.set_bounds(bounds);
  balance.set_whitening(root);
  balance.set_measured(tip_nm, measured.phasors());
  typename SelfConsistentFit<Model>::Parameters start;
  std::ranges::copy(truth, start.begin());
  fit.solve(start, 1, most_refinements);
  const Eigen::MatrixXd information = fit.jacobian().transpose() * fit.jacobian();
  const Eigen::MatrixXd covariance =
      information.ldlt().solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  std::vector<double> bound;
  for (Eigen::Index k = 0; k < covariance.rows(); ++k) bound.push_back(std::sqrt(covariance(k, k)));
  return bound;
}

std::vector<FitResult> draw(const CoverageCase& of, const FitConditions& conditions, std::size_t pixels,
                            const std::function<void(std::size_t)>& progress) {
  std::vector<FitResult> results(pixels);
  std::mutex progress_mutex;
  std::size_t done = 0;
  const std::vector<std::uint64_t> bins = bins_of(conditions);
  parallel_for((pixels + chain_pixels - 1) / chain_pixels, [&] {
    return [&, fitter = std::make_shared<PixelFitter>(conditions)](std::size_t chain) {
      ThermalPixels source(find_case(of.paper_case), of.windows, temperature_k, seed + chain);
      const std::size_t first = chain * chain_pixels, end = std::min(first + chain_pixels, pixels);
      for (std::size_t i = first; i < end; ++i) fitter->fit(source.next(bins), results[i]);
      const std::lock_guard lock(progress_mutex);
      done += end - first;
      if (progress) progress(done);
    };
  });
  return results;
}

bool has_interval(const FitResult& fit) {
  for (std::size_t k = 0; k < fit.parameters_count; ++k)
    if (!std::isfinite(fit.parameters[k]) || !std::isfinite(fit.std_errors[k])) return false;
  return fit.status != FitStatus::not_converged;
}

ParameterCoverage judge(std::span<const FitResult> fits, std::size_t k, double truth, double bound) {
  ParameterCoverage coverage;
  coverage.truth = truth;
  coverage.bound = bound;
  std::vector<double> values, errors;
  std::size_t within_68 = 0, within_95 = 0;
  for (const FitResult& fit : fits) {
    values.push_back(fit.parameters[k]);
    errors.push_back(fit.std_errors[k]);
    const double deviation = std::abs(fit.parameters[k] - truth) / fit.std_errors[k];
    if (deviation <= deviate_68) ++within_68;
    if (deviation <= deviate_95) ++within_95;
  }
  if (values.empty()) return coverage;
  const Scatter scatter = scatter_of(values);
  coverage.mean = scatter.mean;
  coverage.scatter = scatter.spread;
  std::ranges::nth_element(errors, errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2));
  coverage.claimed = errors[errors.size() / 2];
  coverage.within_68 = static_cast<double>(within_68) / static_cast<double>(values.size());
  coverage.within_95 = static_cast<double>(within_95) / static_cast<double>(values.size());
  return coverage;
}

}  // namespace

std::span<const CoverageCase> coverage_cases() {
  static const std::vector<CoverageCase> all{
      {"hertz_2tone_equal_energy", "Hertz, 2 tones, equal energy", "hertz_2tone_equal_energy", {}, 1, 2000},
      {"hertz_4tone_equal_energy", "Hertz, 4 tones, equal energy", "hertz_4tone_equal_energy", {}, 1, 2000},
      {"dmt_4tone_equal_energy", "DMT, 4 tones, equal energy", "dmt_4tone_equal_energy", {}, 1, 2000},
      {"dmt_4tone_equal_energy_sidebands",
       "DMT, 4 tones, equal energy, 6 products more",
       "dmt_4tone_equal_energy",
       {80, 112, 116, 174, 232, 412},
       1,
       2000},
      {"hertz_2tone_equal_amplitude_16",
       "Hertz, 2 tones, equal amplitude, means of 16 windows",
       "hertz_2tone_equal_amplitude",
       {},
       16,
       400},
      {"dmt_4tone_equal_amplitude",
       "DMT, 4 tones, equal amplitude",
       "dmt_4tone_equal_amplitude",
       {},
       1,
       400}};
  return all;
}

std::vector<double> least_errors(const CoverageCase& of) {
  const Case& truth = find_case(of.paper_case);
  const FitConditions conditions = conditions_of(of);
  const Phasors tip_nm = ThermalPixels(truth, of.windows, 0.0, 1).next(bins_of(conditions));
  return visit_model<Models>(find_model(truth.model), [&](auto model) {
    return bound_of<decltype(model)>(conditions, tip_nm, truth.truth);
  });
}

Coverage measure_coverage(const CoverageCase& of, std::size_t pixels,
                          const std::function<void(std::size_t)>& progress) {
  const Case& truth = find_case(of.paper_case);
  const FitConditions conditions = conditions_of(of);
  std::vector<FitResult> fits = draw(of, conditions, pixels, progress);
  Coverage coverage;
  coverage.of = &of;
  coverage.pixels = pixels;
  for (const FitResult& fit : fits) ++coverage.statuses[static_cast<std::size_t>(fit.status)];
  std::erase_if(fits, [](const FitResult& fit) { return !has_interval(fit); });
  coverage.fitted = fits.size();
  for (const FitResult& fit : fits)
    coverage.chi2_reduced += fit.chi2_reduced / static_cast<double>(fits.size());
  const std::vector<double> bound = least_errors(of);
  for (std::size_t k = 0; k < truth.truth.size(); ++k)
    coverage.parameters.push_back(judge(fits, k, truth.truth[k], bound[k]));
  return coverage;
}

}  // namespace combforce::paper
