#include "daemon/cli/tone_information.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "dsp/fourier.hpp"
#include "fit/engaged_heat.hpp"
#include "fit/force_gradient.hpp"
#include "fit/harmonics.hpp"

namespace combforce {
namespace {

using Complex = std::complex<double>;
using Phasors = std::vector<Complex>;

constexpr double resolved = 1e-5;  // of the greatest tone
constexpr std::size_t most_candidates = 300;
// Between samples of the motion, far less than a well of some angstroms is wide; and how many there may be.
constexpr double longest_way_nm = 0.05;
constexpr std::size_t most_samples = std::size_t{1} << 22;
// Of finite differences: far above rounding, far below where derivatives change.
constexpr double surface_step_nm = 1e-4, relative_step = 1e-5;

Eigen::Index index(std::size_t i) {
  return static_cast<Eigen::Index>(i);
}

std::vector<std::uint64_t> candidates_of(const Comb& comb, std::span<const Complex> motion) {
  std::uint64_t divisor = 0;  // elsewhere nothing moves
  double greatest = 0.0;
  for (const Tone& tone : comb.tones) {
    if (tone.driven) divisor = std::gcd(divisor, tone.bin);
    greatest = std::max(greatest, std::abs(motion[tone.bin]));
  }
  std::vector<std::uint64_t> bins;
  for (std::uint64_t bin = divisor; 2 * bin < comb.window_samples; bin += divisor)
    if (std::abs(motion[bin]) >= resolved * greatest &&
        std::ranges::find(comb.tones, bin, &Tone::bin) == comb.tones.end())
      bins.push_back(bin);
  if (bins.size() > most_candidates) {
    std::ranges::nth_element(bins, bins.begin() + most_candidates, std::ranges::greater{},
                             [&](std::uint64_t bin) { return std::abs(motion[bin]); });
    bins.resize(most_candidates);
  }
  std::ranges::sort(bins);
  return bins;
}

// The spectra of the force's derivatives along a motion of these harmonics.
struct Derivatives {
  std::vector<Phasors> by_parameter;
  Phasors by_velocity;
};

Derivatives differentiate(const ModelInfo& model, std::span<const double> parameters, Phasors motion,
                          double period_s) {
  Phasors rate = motion;
  double fastest_nm_per_s = 0.0;
  for (std::size_t n = 0; n < motion.size(); ++n) {
    rate[n] *= Complex(0.0, 2.0 * std::numbers::pi / period_s * static_cast<double>(n));
    fastest_nm_per_s += std::abs(rate[n]);
  }
  const double samples =
      std::min(static_cast<double>(most_samples), period_s * fastest_nm_per_s / longest_way_nm);
  while (2.0 * static_cast<double>(motion.size() - 1) < samples) motion.resize(2 * motion.size() - 1);
  rate.resize(motion.size());
  const std::vector<double> deflection = signal_of(motion), velocity = signal_of(rate);

  const auto difference = [&](const auto& force, double step) {
    std::vector<double> slope(deflection.size());
    for (std::size_t i = 0; i < slope.size(); ++i)
      slope[i] = (force(i, step) - force(i, -step)) / (2.0 * step);
    return spectrum_of(slope);
  };
  Derivatives result;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    std::vector<double> p(parameters.begin(), parameters.end());
    const auto force = [&](std::size_t i, double change) {
      p[k] = parameters[k] + change;
      return model_force(model, p, deflection[i], velocity[i]);
    };
    result.by_parameter.push_back(
        difference(force, k == 0 ? surface_step_nm : relative_step * std::abs(p[k])));
  }
  const auto force = [&](std::size_t i, double change) {
    return model_force(model, parameters, deflection[i], velocity[i] + change);
  };
  result.by_velocity = difference(force, relative_step * fastest_nm_per_s);
  return result;
}

// The motion that a change of the parameters makes, rows (re, im) of every one of these harmonics:
// (1/chi - G) d = dF/dp.
Eigen::MatrixXd motion_by_parameters(const Cantilever& cantilever, const Derivatives& derivatives,
                                     const ForceGradient& gradient, double spacing_hz,
                                     std::span<const std::size_t> harmonics) {
  const Eigen::Index rows = index(2 * harmonics.size());
  Eigen::MatrixXd balance(rows, rows), forces(rows, index(derivatives.by_parameter.size()));
  for (std::size_t j = 0; j < harmonics.size(); ++j) {
    for (std::size_t i = 0; i < harmonics.size(); ++i) {
      const auto [re, im] = gradient.coupling(harmonics[i], harmonics[j]);
      balance.block<2, 2>(index(2 * i), index(2 * j)) << -re.real(), -im.real(), -re.imag(), -im.imag();
    }
    const Complex stiffness = 1.0 / tip_response(cantilever, spacing_hz * static_cast<double>(harmonics[j]));
    balance.block<2, 2>(index(2 * j), index(2 * j)) +=
        (Eigen::Matrix2d() << stiffness.real(), -stiffness.imag(), stiffness.imag(), stiffness.real())
            .finished();
    for (std::size_t k = 0; k < derivatives.by_parameter.size(); ++k) {
      const Phasors& by_parameter = derivatives.by_parameter[k];
      const Complex slope = harmonics[j] < by_parameter.size() ? by_parameter[harmonics[j]] : 0.0;
      forces.col(index(k)).segment<2>(index(2 * j)) << slope.real(), slope.imag();
    }
  }
  return balance.partialPivLu().solve(forces);
}

}  // namespace

double bin_hz(const FitConditions& conditions) {
  return conditions.sample_rate_hz / static_cast<double>(conditions.comb.window_samples);
}

double detector_density_near(const FitConditions& conditions, std::uint64_t bin) {
  const std::vector<Tone>& tones = conditions.comb.tones;
  const auto distance = [bin](const Tone& tone) { return tone.bin > bin ? tone.bin - bin : bin - tone.bin; };
  const auto nearest = std::ranges::min_element(tones, {}, distance) - tones.begin();
  return detector_density(*conditions.noise, static_cast<std::size_t>(nearest));
}

ToneInformation::ToneInformation(const FitConditions& conditions, std::span<const double> parameters,
                                 std::span<const double> known, std::span<const double> motion_nm)
    : conditions_(conditions), parameters_(index(parameters.size())) {
  const double spacing_hz = bin_hz(conditions);
  const Phasors motion = spectrum_of(motion_nm);
  candidates_ = candidates_of(conditions.comb, motion);
  Comb wide = conditions.comb;
  for (const std::uint64_t bin : candidates_) wide.tones.push_back({bin, false});
  for (const Tone& tone : wide.tones) bins_.push_back(tone.bin);

  const Harmonics harmonics(wide, conditions.cantilever, spacing_hz);
  Phasors repeating;
  for (std::size_t bin = 0; bin < motion.size(); bin += harmonics.periods()) repeating.push_back(motion[bin]);
  const Derivatives derivatives = differentiate(find_model(conditions.settings.model), parameters, repeating,
                                                1.0 / harmonics.spacing_hz());
  const ForceGradient gradient{derivatives.by_parameter[0], derivatives.by_velocity,
                               harmonics.angular_frequency(1)};
  std::vector<std::size_t> moving(harmonics.tones().begin(), harmonics.tones().end());
  moving.insert(moving.end(), harmonics.strong().begin(), harmonics.strong().end());
  const Eigen::Index tones = index(2 * wide.tones.size()), all = parameters_ + tones;
  const Eigen::MatrixXd moved =
      motion_by_parameters(conditions.cantilever, derivatives, gradient, harmonics.spacing_hz(), moving)
          .topRows(tones);
  EngagedHeat heat(harmonics, conditions.cantilever, conditions.noise->temperature_k, conditions.windows);
  if (!heat.engage(gradient))
    throw std::invalid_argument("parameters: the motion over this surface is not stable");

  const Eigen::VectorXd variances = Eigen::Map<const Eigen::VectorXd>(known.data(), parameters_).cwiseAbs2();
  of_comb_.resize(all, all);
  of_comb_.topLeftCorner(parameters_, parameters_) = variances.asDiagonal();
  of_comb_.bottomLeftCorner(tones, parameters_) = moved * variances.asDiagonal();
  of_comb_.topRightCorner(parameters_, tones) = variances.asDiagonal() * moved.transpose();
  of_comb_.bottomRightCorner(tones, tones) =
      heat.covariance() + moved * variances.asDiagonal() * moved.transpose();
  for (const Tone& tone : conditions.comb.tones) measure(tone.bin, of_comb_);
}

Eigen::Index ToneInformation::row_of(std::uint64_t bin) const {
  return parameters_ + 2 * (std::ranges::find(bins_, bin) - bins_.begin());
}

double ToneInformation::detector_variance(std::uint64_t bin) const {
  const double density = detector_density_near(conditions_, bin);
  return density * density * bin_hz(conditions_) / conditions_.windows;
}

void ToneInformation::measure(std::uint64_t bin, Knowledge& knowledge) const {
  const Eigen::Index row = row_of(bin);
  const Eigen::Matrix2d noise =
      knowledge.block<2, 2>(row, row) + detector_variance(bin) * Eigen::Matrix2d::Identity();
  const Eigen::MatrixXd shared = knowledge.middleCols<2>(row);
  knowledge.noalias() -= shared * (noise.inverse() * shared.transpose());
}

Eigen::VectorXd ToneInformation::variances_with(std::uint64_t bin, const Knowledge& knowledge) const {
  const Eigen::Index row = row_of(bin);
  const Eigen::Matrix2d noise =
      knowledge.block<2, 2>(row, row) + detector_variance(bin) * Eigen::Matrix2d::Identity();
  const Eigen::MatrixXd shared = knowledge.block(0, row, parameters_, 2);
  return knowledge.diagonal().head(parameters_) -
         (shared * noise.inverse()).cwiseProduct(shared).rowwise().sum();
}

}  // namespace combforce
