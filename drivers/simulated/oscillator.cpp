#include "drivers/simulated/oscillator.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dsp/comb.hpp"
#include "fit/noise.hpp"
#include "fit/units.hpp"

namespace combforce {

using Complex = std::complex<double>;

namespace {

// Greatest distance between neighbouring nodes of a cell, in its length.
constexpr double node_gap = 0.33;

double two_pi_f(double sample_rate_hz, std::uint64_t window, std::uint64_t bin) {
  return 2.0 * std::numbers::pi * sample_rate_hz * static_cast<double>(bin) / static_cast<double>(window);
}

StateDynamics make_dynamics(const OscillatorSettings& settings) {
  StateDynamics dynamics;
  for (const std::uint64_t bin : settings.drive_bins) {
    dynamics.lambda.emplace_back(0.0, two_pi_f(settings.sample_rate_hz, settings.window_samples, bin));
    dynamics.weight.emplace_back(0.0);
  }
  for (const Mode& mode : settings.cantilever.modes) {
    const ModeDynamics of_mode = mode_dynamics(mode);
    dynamics.lambda.push_back(of_mode.lambda);
    dynamics.weight.emplace_back(1.0);
    dynamics.coupling.push_back(of_mode.coupling);
  }
  return dynamics;
}

OscillatorSettings validated(const OscillatorSettings& settings) {
  const auto require = [](bool holds, const char* field, double value, const char* bound) {
    if (!holds)
      throw std::invalid_argument(fmt::format("oscillator.{}: {}, must be {}", field, value, bound));
  };
  validate(settings.cantilever);
  require(settings.sample_rate_hz > 0.0 && std::isfinite(settings.sample_rate_hz), "sample_rate_hz",
          settings.sample_rate_hz, "> 0");
  require(settings.window_samples > 0, "window_samples", 0.0, ">= 1");
  require(settings.temperature_k >= 0.0 && std::isfinite(settings.temperature_k), "temperature_k",
          settings.temperature_k, ">= 0");
  return settings;
}

}  // namespace

Oscillator::Oscillator(const OscillatorSettings& settings)
    : settings_(validated(settings)),
      tolerances_(tolerances(settings.accuracy)),
      tones_(settings.drive_bins.size()),
      modes_(settings.cantilever.modes.size()),
      dynamics_(make_dynamics(settings)),
      re_(dynamics_.states(), 0.0),
      im_(dynamics_.states(), 0.0),
      whole_sample_(dynamics_, 1.0 / settings.sample_rate_hz),
      short_(dynamics_),
      random_(settings.seed) {
  for (const Mode& mode : settings_.cantilever.modes)
    volts_per_nm_.push_back(1.0 / mode.sensitivity_nm_per_v);
  detuned_turns_.assign(tones_, 0.0);
  set_weights(settings.drive_forces_nn);
  make_cells();
  make_thermal_forces();
  renew_phases();
  renew_guards();
}

Oscillator::Tolerances Oscillator::tolerances(IntegratorAccuracy accuracy) {
  return accuracy == IntegratorAccuracy::live ? Tolerances{2.6, 0.1, 1.0} : Tolerances{1.3, 0.003, 0.5};
}

void Oscillator::make_cells() {
  double fastest = 0.0;
  for (const Complex& lambda : dynamics_.lambda) fastest = std::max(fastest, std::abs(lambda));
  double speed = 0.0;
  for (std::size_t n = 0; n < tones_; ++n) speed += std::abs(dynamics_.weight[n] * dynamics_.lambda[n]);
  const double longest = 1.0 / settings_.sample_rate_hz;
  cells_a_sample_ = static_cast<std::uint32_t>(std::ceil(longest * fastest / tolerances_.turn));
  double seconds = longest / cells_a_sample_;
  ladder_.emplace_back(dynamics_, seconds);
  while (seconds * fastest > short_cell_limit || seconds * speed > tolerances_.resolution_nm) {
    seconds *= 0.5;
    ladder_.emplace_back(dynamics_, seconds);
  }
  guard_nm_.resize(ladder_.size());
}

// Covariance of z's increment over a time h under white force of two-sided density S/2 through the coupling
// b: E|dz|^2 = |b|^2 S/2 (1 - e^(-2gh))/(2g), E dz^2 = b^2 S/2 (e^(2 lambda h) - 1)/(2 lambda). In
// equilibrium q and q' are independent, of variance kB T/k and w^2 kB T/k.
void Oscillator::make_thermal_forces() {
  const double h = whole_sample_.seconds;
  for (std::size_t m = 0; m < modes_ && settings_.temperature_k > 0.0; ++m) {
    const Mode& mode = settings_.cantilever.modes[m];
    const Complex lambda = dynamics_.lambda[tones_ + m];
    const Complex b = dynamics_.coupling[m];
    const double density = 0.5 * thermal_force_density(mode, settings_.temperature_k);
    const double power = std::norm(b) * density * std::expm1(2.0 * lambda.real() * h) / (2.0 * lambda.real());
    const Complex square = b * b * density * (std::exp(2.0 * lambda * h) - 1.0) / (2.0 * lambda);
    ThermalForce& force = thermal_.emplace_back();
    force.re = std::sqrt(0.5 * (power + square.real()));
    force.im_along = 0.5 * square.imag() / force.re;
    force.im_across =
        std::sqrt(std::max(0.0, 0.5 * (power - square.real()) - force.im_along * force.im_along));

    const double sigma = std::sqrt(boltzmann_nn_nm_per_k * settings_.temperature_k / mode.stiffness_n_per_m);
    const double q = sigma * random_.normal();
    const double velocity = sigma * std::abs(lambda) * random_.normal();
    re_[tones_ + m] = q;
    im_[tones_ + m] = (lambda.real() * q - velocity) / lambda.imag();
  }
}

void Oscillator::set_weights(std::span<const Complex> forces_nn) {
  if (forces_nn.size() != tones_) {
    throw std::invalid_argument(fmt::format(
        "oscillator.drive_forces_nn: {} values, must be {}, one a driven tone", forces_nn.size(), tones_));
  }
  free_mode_nm_.assign(modes_, std::vector<Complex>(tones_));
  free_detector_v_.assign(tones_, 0.0);
  for (std::size_t n = 0; n < tones_; ++n) {
    dynamics_.weight[n] = 0.0;
    for (std::size_t m = 0; m < modes_; ++m) {
      const Mode& mode = settings_.cantilever.modes[m];
      const double frequency = dynamics_.lambda[n].imag() / (2.0 * std::numbers::pi);
      free_mode_nm_[m][n] = mode_response(mode, frequency) * forces_nn[n];
      dynamics_.weight[n] += free_mode_nm_[m][n];
      free_detector_v_[n] += free_mode_nm_[m][n] * volts_per_nm_[m];
    }
  }
  for (CellTable& cell : ladder_) cell.set_weights(dynamics_);
  short_.set_weights(dynamics_);
}

void Oscillator::set_drive(std::span<const Complex> forces_nn) {
  settings_.drive_forces_nn.assign(forces_nn.begin(), forces_nn.end());
  keep_motion([&] { set_weights(forces_nn); });
}

void Oscillator::detune(double relative) {
  keep_motion([&] {
    for (std::size_t n = 0; n < tones_; ++n) {
      const double ahead =
          static_cast<double>(sample_ - detuned_from_) / static_cast<double>(settings_.window_samples);
      detuned_turns_[n] += detuning_ * static_cast<double>(settings_.drive_bins[n]) * ahead;
      dynamics_.lambda[n] *= (1.0 + relative) / (1.0 + detuning_);
    }
    detuning_ = relative;
    detuned_from_ = sample_;
    whole_sample_ = CellTable(dynamics_, whole_sample_.seconds);
    short_ = ShortCell(dynamics_);
    set_weights(settings_.drive_forces_nn);
  });
}

// What changes in the steady state of the drive is made up for in the response.
template <typename Change>
void Oscillator::keep_motion(Change change) {
  std::vector<Complex> before(modes_), velocity_before(modes_);
  for (std::size_t m = 0; m < modes_; ++m) {
    before[m] = free_nm(m);
    velocity_before[m] = drive_velocity(m);
  }
  change();
  ladder_.clear();
  make_cells();
  level_ = 0;
  renew_guards();
  for (std::size_t m = 0; m < modes_; ++m) {
    const double q = (before[m] - free_nm(m)).real();
    const double velocity = (velocity_before[m] - drive_velocity(m)).real();
    const Complex lambda = dynamics_.lambda[tones_ + m];
    re_[tones_ + m] += q;
    im_[tones_ + m] += (lambda.real() * q - velocity) / lambda.imag();
  }
}

Complex Oscillator::free_nm(std::size_t mode) const {
  Complex sum = 0.0;
  for (std::size_t n = 0; n < tones_; ++n) sum += free_mode_nm_[mode][n] * Complex(re_[n], im_[n]);
  return sum;
}

Complex Oscillator::drive_velocity(std::size_t mode) const {
  Complex sum = 0.0;
  for (std::size_t n = 0; n < tones_; ++n) {
    sum += dynamics_.lambda[n] * free_mode_nm_[mode][n] * Complex(re_[n], im_[n]);
  }
  return sum;
}

double Oscillator::tip_nm() const {
  double sum = 0.0;
  for (std::size_t n = 0; n < re_.size(); ++n) {
    sum += dynamics_.weight[n].real() * re_[n] - dynamics_.weight[n].imag() * im_[n];
  }
  return sum;
}

double Oscillator::tip_nm_per_s() const {
  double sum = 0.0;
  for (std::size_t n = 0; n < re_.size(); ++n)
    sum += (dynamics_.weight[n] * dynamics_.lambda[n] * Complex(re_[n], im_[n])).real();
  return sum;
}

double Oscillator::detector_v() const {
  double sum = 0.0;
  for (std::size_t n = 0; n < tones_; ++n) {
    sum += free_detector_v_[n].real() * re_[n] - free_detector_v_[n].imag() * im_[n];
  }
  for (std::size_t m = 0; m < modes_; ++m) sum += volts_per_nm_[m] * re_[tones_ + m];
  return sum;
}

void Oscillator::renew_phases() {
  for (std::size_t n = 0; n < tones_; ++n) {
    const std::uint64_t index = phase_index(settings_.drive_bins[n], sample_, settings_.window_samples);
    double phase = phase_radians(index, settings_.window_samples);
    if (detuning_ != 0.0 || detuned_turns_[n] != 0.0) {
      const double ahead =
          static_cast<double>(sample_ - detuned_from_) / static_cast<double>(settings_.window_samples);
      phase += 2.0 * std::numbers::pi *
               (detuned_turns_[n] + detuning_ * static_cast<double>(settings_.drive_bins[n]) * ahead);
    }
    re_[n] = std::cos(phase);
    im_[n] = std::sin(phase);
  }
}

// Between nodes t apart the tip leaves its chord by at most |d''| t^2/8.
void Oscillator::renew_guards() {
  double acceleration = 0.0;
  for (std::size_t n = 0; n < re_.size(); ++n) {
    acceleration +=
        std::norm(dynamics_.lambda[n]) * std::abs(dynamics_.weight[n]) * std::hypot(re_[n], im_[n]);
  }
  for (std::size_t i = 0; i < ladder_.size(); ++i) {
    const double gap = node_gap * ladder_[i].seconds;
    guard_nm_[i] = acceleration * gap * gap / 8.0;
  }
}

void Oscillator::withdraw() {
  advance_ = nullptr;
}

void Oscillator::propagate_free() {
  for (std::size_t n = 0; n < re_.size(); ++n) {
    const double re = re_[n];
    re_[n] = whole_sample_.propagate_re[n] * re - whole_sample_.propagate_im[n] * im_[n];
    im_[n] = whole_sample_.propagate_re[n] * im_[n] + whole_sample_.propagate_im[n] * re;
  }
}

void Oscillator::begin_next_sample() {
  for (std::size_t m = 0; m < thermal_.size(); ++m) {
    const double along = random_.normal();
    re_[tones_ + m] += thermal_[m].re * along;
    im_[tones_ + m] += thermal_[m].im_along * along + thermal_[m].im_across * random_.normal();
  }
  ++sample_;
  if (sample_ % settings_.window_samples == 0) renew_phases();
  if (sample_ % 256 == 0) renew_guards();
}

void Oscillator::advance(std::span<double> detector) {
  if (advance_ != nullptr) {
    (this->*advance_)(detector);
    return;
  }
  for (double& volts : detector) {
    volts = detector_v();
    propagate_free();
    begin_next_sample();
  }
}

}  // namespace combforce
