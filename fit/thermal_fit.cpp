#include "fit/thermal_fit.hpp"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "fit/thermal_oscillator.hpp"

namespace combforce {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double least_floor = 1e-9;  // of the mean density

// ln f0, ln Q, ln P a mode, ln W; values at bins of a band.
class Model {
 public:
  Model(const AveragedSpectrum& spectrum, std::vector<std::size_t> bins, std::size_t modes)
      : spectrum_(spectrum), bins_(std::move(bins)), modes_(modes) {}

  std::size_t parameters() const { return 3 * modes_ + 1; }
  const std::vector<std::size_t>& bins() const { return bins_; }
  double measured(std::size_t i) const { return spectrum_.density[bins_[i]]; }

  // Densities, and rows d ln M/dp when asked for.
  void evaluate(const double* p, std::vector<double>& density, Eigen::MatrixXd* gradient) const {
    const double floor = std::exp(p[3 * modes_]);
    density.assign(bins_.size(), floor);
    const auto rows = static_cast<Eigen::Index>(bins_.size());
    if (gradient != nullptr) {
      gradient->resize(rows, static_cast<Eigen::Index>(parameters()));
      gradient->rightCols(1).setConstant(floor);
    }
    for (std::size_t m = 0; m < modes_; ++m) add_mode(p + 3 * m, m, density, gradient);
    if (gradient == nullptr) return;
    for (Eigen::Index i = 0; i < rows; ++i) gradient->row(i) /= density[static_cast<std::size_t>(i)];
  }

 private:
  void add_mode(const double* p, std::size_t mode, std::vector<double>& density,
                Eigen::MatrixXd* gradient) const {
    const double frequency = std::exp(p[0]), quality = std::exp(p[1]), variance = std::exp(p[2]);
    std::optional<HannPeriodogram> smeared;
    if (const auto& record = spectrum_.record)
      smeared.emplace(record->samples, record->sample_rate_hz, frequency, quality);
    const auto first = static_cast<std::size_t>(std::lround(spectrum_.first_hz / spectrum_.bin_hz));
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      const OscillatorDensity at =
          smeared ? smeared->at_bin(first + bins_[i])
                  : oscillator_density(frequency, quality, spectrum_.frequency_hz(bins_[i]));
      density[i] += variance * at.value;
      if (gradient == nullptr) continue;
      const auto row = static_cast<Eigen::Index>(i);
      const auto column = static_cast<Eigen::Index>(3 * mode);
      (*gradient)(row, column) = variance * at.by_log_frequency;
      (*gradient)(row, column + 1) = variance * at.by_log_quality;
      (*gradient)(row, column + 2) = variance * at.value;
    }
  }

  const AveragedSpectrum& spectrum_;
  std::vector<std::size_t> bins_;
  std::size_t modes_;
};

// The signed roots of the Gamma deviance, n = 1.
class Deviance final : public ceres::CostFunction {
 public:
  explicit Deviance(const Model& model) : model_(model) {
    set_num_residuals(static_cast<int>(model.bins().size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(model.parameters()));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const bool derive = jacobians != nullptr && jacobians[0] != nullptr;
    std::vector<double> density;
    Eigen::MatrixXd gradient;
    model_.evaluate(parameters[0], density, derive ? &gradient : nullptr);
    const auto columns = static_cast<Eigen::Index>(model_.parameters());
    for (std::size_t i = 0; i < density.size(); ++i) {
      const double excess = model_.measured(i) / density[i] - 1.0;
      if (!std::isfinite(excess) || excess <= -1.0) return false;
      const double root = std::sqrt(2.0 * std::max(excess - std::log1p(excess), 0.0));
      residuals[i] = std::copysign(root, excess);
      if (!derive) continue;
      constexpr double small = 1e-4;
      const double slope = std::abs(excess) < small ? 1.0 + excess / 3.0 : excess / residuals[i];
      const auto row = static_cast<Eigen::Index>(i);
      for (Eigen::Index k = 0; k < columns; ++k) jacobians[0][row * columns + k] = -slope * gradient(row, k);
    }
    return true;
  }

 private:
  const Model& model_;
};

void require_field(bool good, const char* field, double value, const std::string& bound) {
  if (!good) throw std::invalid_argument(fmt::format("{}: {}, must be {}", field, value, bound));
}

void check(const AveragedSpectrum& spectrum, const ThermalFitSettings& settings,
           const std::vector<std::size_t>& bins) {
  const FrequencyBand& band = settings.band;
  require_field(band.low_hz >= 0.0 && band.low_hz < band.high_hz, "band.low_hz", band.low_hz,
                fmt::format("at least 0 and below band.high_hz = {}", band.high_hz));
  require_field(!settings.modes.empty(), "modes", 0, "at least one");
  for (const OscillatorStart& mode : settings.modes) {
    require_field(mode.frequency_hz > band.low_hz && mode.frequency_hz < band.high_hz, "modes.frequency_hz",
                  mode.frequency_hz, fmt::format("within the band {} to {} Hz", band.low_hz, band.high_hz));
    require_field(mode.quality_factor >= least_quality_factor && mode.quality_factor <= most_quality_factor,
                  "modes.quality_factor", mode.quality_factor,
                  fmt::format("in [{}, {}]", least_quality_factor, most_quality_factor));
  }
  const std::size_t least = 8 * (3 * settings.modes.size() + 1);
  if (bins.size() < least)
    throw std::invalid_argument(
        fmt::format("band: {} bins of {} Hz in {} to {} Hz, must be at least {}, 8 a parameter", bins.size(),
                    spectrum.bin_hz, band.low_hz, band.high_hz, least));
  for (const std::size_t bin : bins)
    require_field(spectrum.density[bin] > 0.0 && std::isfinite(spectrum.density[bin]),
                  fmt::format("density at {} Hz", spectrum.frequency_hz(bin)).c_str(), spectrum.density[bin],
                  "positive and finite");
}

double mean_density(const Model& model) {
  double sum = 0.0;
  for (std::size_t i = 0; i < model.bins().size(); ++i) sum += model.measured(i);
  return sum / static_cast<double>(model.bins().size());
}

std::vector<double> start_parameters(const Model& model, const AveragedSpectrum& spectrum,
                                     const ThermalFitSettings& settings, double mean) {
  std::vector<double> p;
  const double share = mean * spectrum.bin_hz * static_cast<double>(model.bins().size()) /
                       static_cast<double>(settings.modes.size());
  for (const OscillatorStart& mode : settings.modes)
    for (const double value : {mode.frequency_hz, mode.quality_factor, 0.5 * share})
      p.push_back(std::log(value));
  p.push_back(std::log(0.1 * mean));
  return p;
}

bool minimise(const Model& model, const ThermalFitSettings& settings, double mean, std::vector<double>& p) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  Deviance deviance(model);
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&deviance, nullptr, p.data());
  for (std::size_t m = 0; m < settings.modes.size(); ++m) {
    const auto k = static_cast<int>(3 * m);
    const double nearly_zero = 1e-6 * settings.band.high_hz;
    problem.SetParameterLowerBound(p.data(), k, std::log(std::max(settings.band.low_hz, nearly_zero)));
    problem.SetParameterUpperBound(p.data(), k, std::log(settings.band.high_hz));
    problem.SetParameterLowerBound(p.data(), k + 1, std::log(least_quality_factor));
    problem.SetParameterUpperBound(p.data(), k + 1, std::log(most_quality_factor));
  }
  problem.SetParameterLowerBound(p.data(), static_cast<int>(p.size() - 1), std::log(least_floor * mean));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-13;
  options.parameter_tolerance = 1e-11;
  options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.termination_type == ceres::CONVERGENCE;
}

bool at_bound(const ThermalFitSettings& settings, const FittedMode& mode) {
  constexpr double margin = 1.0 + 1e-6;
  return mode.frequency_hz < settings.band.low_hz * margin ||
         mode.frequency_hz * margin > settings.band.high_hz ||
         mode.quality_factor < least_quality_factor * margin ||
         mode.quality_factor * margin > most_quality_factor;
}

// NaN where not determined; the last parameter is left out when the floor is held.
Eigen::MatrixXd covariance_of(const AveragedSpectrum& spectrum, const Model& model,
                              const Eigen::MatrixXd& gradient, bool floor_free) {
  const Eigen::Index all = gradient.cols();
  const Eigen::Index free = floor_free ? all : all - 1;
  const Eigen::MatrixXd g = gradient.leftCols(free);
  const Eigen::MatrixXd information = g.transpose() * g;
  Eigen::MatrixXd scatter = information;
  const auto& bins = model.bins();
  for (std::size_t l = 1; l <= spectrum.statistics.correlation.size(); ++l) {
    Eigen::MatrixXd lagged = Eigen::MatrixXd::Zero(free, free);
    for (std::size_t i = 0, j = 0; i < bins.size(); ++i) {
      while (j < bins.size() && bins[j] < bins[i] + l) ++j;
      if (j < bins.size() && bins[j] == bins[i] + l)
        lagged += g.row(static_cast<Eigen::Index>(i)).transpose() * g.row(static_cast<Eigen::Index>(j));
    }
    scatter += spectrum.statistics.correlation[l - 1] * (lagged + lagged.transpose());
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Constant(all, all, nan);
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return covariance;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  constexpr double singular = 1e-12;
  if (solver.eigenvalues()(0) < singular * solver.eigenvalues()(free - 1)) return covariance;
  const Eigen::MatrixXd inverse = scale.asDiagonal() * solver.eigenvectors() *
                                  solver.eigenvalues().cwiseInverse().asDiagonal() *
                                  solver.eigenvectors().transpose() * scale.asDiagonal();
  covariance.topLeftCorner(free, free) = inverse * scatter * inverse / spectrum.statistics.averages;
  return covariance;
}

// Blocks whose mean ratio scatters by 1/7: 50 averages a block, whatever a bin's.
void judge(const AveragedSpectrum& spectrum, const std::vector<double>& ratios, std::size_t parameters,
           ThermalFit& fit) {
  constexpr double averages_a_block = 50.0;
  const SpectrumStatistics& statistics = spectrum.statistics;
  const auto wanted = static_cast<std::size_t>(std::ceil(averages_a_block / statistics.averages));
  const std::size_t block = std::clamp<std::size_t>(wanted, 1, ratios.size());
  double inflation = 1.0;
  for (std::size_t l = 1; l <= statistics.correlation.size() && l < block; ++l)
    inflation +=
        2.0 * (1.0 - static_cast<double>(l) / static_cast<double>(block)) * statistics.correlation[l - 1];
  const double variance = inflation / (statistics.averages * static_cast<double>(block));
  const std::size_t blocks = ratios.size() / block;
  double chi2 = 0.0;
  for (std::size_t b = 0; b < blocks; ++b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < block; ++i) sum += ratios[b * block + i] - 1.0;
    chi2 += sum * sum / (static_cast<double>(block * block) * variance);
  }
  if (blocks <= parameters) {
    fit.chi2_reduced = nan;
    return;
  }
  fit.chi2_degrees = blocks - parameters;
  fit.chi2_reduced = chi2 / static_cast<double>(fit.chi2_degrees);
  constexpr double deviations = 4.0;
  if (fit.chi2_reduced > 1.0 + deviations * std::sqrt(2.0 / static_cast<double>(fit.chi2_degrees)))
    fit.status = ThermalStatus::misfit;
}

bool contains(const FrequencyBand& band, double hz) {
  return hz >= band.low_hz && hz <= band.high_hz;
}

}  // namespace

std::string_view to_string(ThermalStatus status) {
  constexpr std::array<std::string_view, 5> names{"converged", "not_converged", "at_bound", "misfit",
                                                  "undetermined"};
  return names[static_cast<std::size_t>(status)];
}

double ThermalFit::relative_error(std::size_t parameter) const {
  const auto k = static_cast<Eigen::Index>(parameter);
  return std::sqrt(covariance(k, k));
}

std::vector<std::size_t> bins_of(const AveragedSpectrum& spectrum, const ThermalFitSettings& settings) {
  std::vector<std::size_t> bins;
  for (std::size_t bin = 0; bin < spectrum.density.size(); ++bin) {
    const double hz = spectrum.frequency_hz(bin);
    constexpr double least_bins = 1.5;  // f = 0 and the bin above carry what is left of the mean
    if (hz < least_bins * spectrum.bin_hz || !contains(settings.band, hz)) continue;
    if (std::ranges::none_of(settings.excluded, [&](const auto& band) { return contains(band, hz); }))
      bins.push_back(bin);
  }
  return bins;
}

ThermalFit fit_thermal(const AveragedSpectrum& spectrum, const ThermalFitSettings& settings) {
  std::vector<std::size_t> bins = bins_of(spectrum, settings);
  check(spectrum, settings, bins);
  const std::size_t modes = settings.modes.size();
  const Model model(spectrum, std::move(bins), modes);
  const double mean = mean_density(model);
  std::vector<double> p = start_parameters(model, spectrum, settings, mean);
  ThermalFit fit;
  fit.status = minimise(model, settings, mean, p) ? ThermalStatus::converged : ThermalStatus::not_converged;
  for (std::size_t m = 0; m < modes; ++m)
    fit.modes.push_back({std::exp(p[3 * m]),
                         std::clamp(std::exp(p[3 * m + 1]), least_quality_factor, most_quality_factor),
                         std::exp(p[3 * m + 2])});
  fit.floor_v2_per_hz = std::exp(p.back());
  fit.floor_determined = fit.floor_v2_per_hz > 2.0 * least_floor * mean;
  fit.bins = model.bins().size();

  std::vector<double> density, ratios;
  Eigen::MatrixXd gradient;
  model.evaluate(p.data(), density, &gradient);
  for (std::size_t i = 0; i < density.size(); ++i) {
    ratios.push_back(model.measured(i) / density[i]);
    if (ratios.back() <= fit.greatest_ratio) continue;
    fit.greatest_ratio = ratios.back();
    fit.greatest_at_hz = spectrum.frequency_hz(model.bins()[i]);
  }
  fit.scatter = measure_scatter(ratios);
  fit.covariance = covariance_of(spectrum, model, gradient, fit.floor_determined);
  if (fit.status != ThermalStatus::converged) return fit;
  judge(spectrum, ratios, p.size(), fit);
  if (!std::isfinite(fit.covariance(0, 0))) fit.status = ThermalStatus::undetermined;
  if (std::ranges::any_of(fit.modes, [&](const auto& mode) { return at_bound(settings, mode); }))
    fit.status = ThermalStatus::at_bound;
  return fit;
}

std::vector<double> model_density(const AveragedSpectrum& spectrum, const ThermalFit& fit,
                                  const std::vector<std::size_t>& bins) {
  const Model model(spectrum, bins, fit.modes.size());
  std::vector<double> p, density;
  for (const FittedMode& mode : fit.modes)
    for (const double value : {mode.frequency_hz, mode.quality_factor, mode.variance_v2})
      p.push_back(std::log(value));
  p.push_back(std::log(fit.floor_v2_per_hz));
  model.evaluate(p.data(), density, nullptr);
  return density;
}

}  // namespace combforce
