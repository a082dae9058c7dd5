// Oscillator under a tip-surface force: cells, the kink, and the dispatch to the force models.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "drivers/simulated/oscillator.hpp"
#include "fit/model_list.hpp"

namespace combforce {

using Complex = std::complex<double>;

namespace {

// The force is evaluated again where the motion it makes within the cell exceeds this.
constexpr double correction_nm = 1e-7;
// A tip nearer to the kink than this is on it.
constexpr double on_kink_nm = 1e-5;
// The next cell is twice as long where the coefficient is below this part of the tolerance.
constexpr double growth = 0.05;

using Tip = std::array<double, cell_nodes>;

// Coefficients of the Legendre polynomials of degree 3 and 4 in the quartic through the nodes.
double highest_coefficient(const Tip& f) {
  const double fourth = 0.2 * (f[0] + f[4]) - 7.0 / 15.0 * (f[1] + f[3]) + 8.0 / 15.0 * f[2];
  const double third = 0.35 * (f[4] - f[0]) - 0.534522483824849 * (f[3] - f[1]);
  return std::abs(fourth) + 0.1 * std::abs(third);
}

// Whether the tip is on one side of the kink throughout. Its start may lie on the kink, where a cell was
// split.
bool one_sided(const Tip& tip, double kink) {
  const bool outside = tip[1] > kink;
  for (std::size_t j = 2; j < cell_nodes; ++j) {
    if ((tip[j] > kink) != outside) return false;
  }
  return (tip[0] > kink) == outside || std::abs(tip[0] - kink) < on_kink_nm;
}

// First root of tip(s) = kink on [0, 1], s in cell lengths, on the quartic through the nodes; tip is not
// one-sided.
double first_crossing(const Tip& tip, double kink) {
  const auto value = [&](double s) {
    double sum = 0.0;
    for (std::size_t l = 0; l < cell_nodes; ++l) {
      double product = tip[l] - kink;
      for (std::size_t j = 0; j < cell_nodes; ++j) {
        if (j != l) product *= (s - cell_node[j]) / (cell_node[l] - cell_node[j]);
      }
      sum += product;
    }
    return sum;
  };
  std::size_t j = std::abs(tip[0] - kink) < on_kink_nm ? 1 : 0;
  while (j + 2 < cell_nodes && (tip[j] > kink) == (tip[j + 1] > kink)) ++j;
  double low = cell_node[j], high = cell_node[j + 1];
  double at_low = tip[j] - kink, at_high = tip[j + 1] - kink;
  double s = low;
  for (int i = 0; i < 20 && std::abs(at_high - at_low) > 0.0; ++i) {  // Illinois variant of regula falsi
    s = (low * at_high - high * at_low) / (at_high - at_low);
    const double at_s = value(s);
    if (std::abs(at_s) < 0.01 * on_kink_nm) break;
    if ((at_s > 0.0) == (at_high > 0.0)) {
      at_low *= 0.5;
    } else {
      low = high;
      at_low = at_high;
    }
    high = s;
    at_high = at_s;
  }
  return s;
}

// slope_weights[j][l]: slope at node j, per cell, of the quartic through the nodes, of a unit at node l.
using SlopeWeights = std::array<Tip, cell_nodes>;

SlopeWeights make_slope_weights() {
  SlopeWeights weights{};
  for (std::size_t j = 0; j < cell_nodes; ++j)
    for (std::size_t l = 0; l < cell_nodes; ++l)
      for (std::size_t k = 0; k < cell_nodes; ++k) {
        if (k == l) continue;
        double product = 1.0 / (cell_node[l] - cell_node[k]);
        for (std::size_t m = 0; m < cell_nodes; ++m)
          if (m != l && m != k) product *= (cell_node[j] - cell_node[m]) / (cell_node[l] - cell_node[m]);
        weights[j][l] += product;
      }
  return weights;
}

}  // namespace

// The velocity, where a model wants it, is the slope of the quartic through the tip's nodes.
template <typename Model>
void Oscillator::force_at_later_nodes(const Tip& tip, double seconds, Tip& force) const {
  if constexpr (DependsOnVelocity<Model>) {
    static const SlopeWeights slope_weights = make_slope_weights();
    for (std::size_t j = 1; j < cell_nodes; ++j) {
      double slope = 0.0;
      for (std::size_t l = 0; l < cell_nodes; ++l) slope += slope_weights[j][l] * (tip[l] - tip[0]);
      force[j] = Model::force(parameters_.data(), tip[j], slope / seconds);
    }
  } else {
    for (std::size_t j = 1; j < cell_nodes; ++j) force[j] = Model::force(parameters_.data(), tip[j]);
  }
}

template <typename Model>
void Oscillator::evaluate(const CellTable& cell, Tip& tip, Tip& force) const {
  CellTable::Later later;
  for (std::size_t j = 0; j < later.size(); ++j) later[j] = cell.tip_per_steady_force[j] * force[0];
  for (std::size_t n = 0; n < re_.size(); ++n) {
    for (std::size_t j = 0; j < later.size(); ++j) {
      later[j] += cell.tip_re[n][j] * re_[n] + cell.tip_im[n][j] * im_[n];
    }
  }
  std::ranges::copy(later, tip.begin() + 1);
  force_at_later_nodes<Model>(tip, cell.seconds, force);
  double change = 0.0;
  for (std::size_t j = 1; j < cell_nodes; ++j) change = std::max(change, std::abs(force[j] - force[0]));
  if (change * cell.greatest_tip_per_force < correction_nm) return;
  for (std::size_t l = 1; l < cell_nodes; ++l) {
    for (std::size_t j = 0; j < later.size(); ++j)
      tip[j + 1] += cell.tip_per_force[l][j] * (force[l] - force[0]);
  }
  force_at_later_nodes<Model>(tip, cell.seconds, force);
}

void Oscillator::apply(const CellTable& cell, const Tip& force) {
  for (std::size_t n = 0; n < re_.size(); ++n) {
    const double re = re_[n];
    re_[n] = cell.propagate_re[n] * re - cell.propagate_im[n] * im_[n];
    im_[n] = cell.propagate_re[n] * im_[n] + cell.propagate_im[n] * re;
  }
  for (std::size_t m = 0; m < modes_; ++m) {
    double re = re_[tones_ + m], im = im_[tones_ + m];
    for (std::size_t l = 0; l < cell_nodes; ++l) {
      re += cell.force_re[m][l] * force[l];
      im += cell.force_im[m][l] * force[l];
    }
    re_[tones_ + m] = re;
    im_[tones_ + m] = im;
  }
}

void Oscillator::apply_short(double seconds, const Tip& force) {
  for (std::size_t n = 0; n < re_.size(); ++n) {
    const Complex turned = Complex(re_[n], im_[n]) * std::exp(dynamics_.lambda[n] * seconds);
    re_[n] = turned.real();
    im_[n] = turned.imag();
  }
  Tip impulse{};
  for (std::size_t k = 0; k < ShortCell::moments; ++k) {
    for (std::size_t l = 0; l < cell_nodes; ++l) impulse[k] += short_.moment[k][l] * force[l];
  }
  for (std::size_t m = 0; m < modes_; ++m) {
    const Complex turn = dynamics_.lambda[tones_ + m] * seconds;
    Complex series = impulse[ShortCell::moments - 1];
    for (std::size_t k = ShortCell::moments - 1; k-- > 0;) series = series * turn + impulse[k];
    const Complex effect = dynamics_.coupling[m] * seconds * series;
    re_[tones_ + m] += effect.real();
    im_[tones_ + m] += effect.imag();
  }
}

template <typename Model>
void Oscillator::evaluate_short(const Taylor& taylor, double seconds, Tip& tip, Tip& force) const {
  const double shift = short_.acceleration * seconds * seconds;
  const auto predict = [&](std::size_t j) {
    double sum = 0.0;
    for (std::size_t k = taylor.size(); k-- > 0;) sum = sum * (cell_node[j] * seconds) + taylor[k];
    for (std::size_t l = 0; l < cell_nodes && j > 0; ++l)
      sum += shift * short_.tip_per_force[l][j - 1] * force[l];
    return sum;
  };
  tip[0] = taylor[0];
  force.fill(force_of<Model>(parameters_.data(), tip[0], taylor[1]));
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t j = 1; j < cell_nodes; ++j) tip[j] = predict(j);
    force_at_later_nodes<Model>(tip, seconds, force);
  }
}

Oscillator::Taylor Oscillator::taylor() const {
  Taylor taylor{};
  for (std::size_t k = 0; k < taylor.size(); ++k) {
    for (std::size_t n = 0; n < re_.size(); ++n) {
      taylor[k] += short_.taylor_re[k][n] * re_[n] + short_.taylor_im[k][n] * im_[n];
    }
  }
  return taylor;
}

// A shortest cell with the kink in it, or too long for its force, as pieces that end at the kink and are
// halved until the force is a quartic.
template <typename Model>
void Oscillator::cross_in_pieces(double seconds) {
  constexpr int most_crossings = 5;              // grazing tips may cross more than once
  const double shortest = seconds / (1U << 14);  // beside a pole: 0.06 pm
  const double kink = surface_nm<Model>(parameters_.data());
  Tip tip, force;
  int crossings = 0;
  double left = seconds, piece = seconds;
  while (left > 0.0) {
    piece = std::max(piece, std::min(left, shortest));
    const Taylor taylor = this->taylor();
    evaluate_short<Model>(taylor, piece, tip, force);
    if (!one_sided(tip, kink) && crossings < most_crossings) {
      ++crossings;
      piece *= first_crossing(tip, kink);
      evaluate_short<Model>(taylor, piece, tip, force);
    }
    while (piece > shortest && highest_coefficient(force) > tolerances_.force_nn) {
      piece *= 0.5;
      evaluate_short<Model>(taylor, piece, tip, force);
    }
    apply_short(piece, force);
    left -= piece;
    piece = std::min(left, 2.0 * piece);
  }
}

template <typename Model>
double Oscillator::force_now(double tip) const {
  return force_of<Model>(parameters_.data(), tip, DependsOnVelocity<Model> ? tip_nm_per_s() : 0.0);
}

template <typename Model>
void Oscillator::cross_sample() {
  const auto finest = static_cast<std::uint32_t>(ladder_.size() - 1);
  const std::uint64_t end = std::uint64_t{cells_a_sample_} << finest;  // in shortest cells
  const double kink = surface_nm<Model>(parameters_.data());
  std::uint64_t position = 0;
  Tip tip, force;
  tip[0] = tip_nm();
  force[0] = force_now<Model>(tip[0]);
  while (position < end) {
    const CellTable& cell = ladder_[level_];
    evaluate<Model>(cell, tip, force);
    const bool smooth = one_sided(tip, kink);
    const double nearest = std::ranges::min(tip) - kink;
    const double coefficient = highest_coefficient(force);
    const bool clear = smooth && (nearest <= 0.0 || nearest > guard_nm_[level_]);
    if (level_ < finest && (!clear || coefficient > tolerances_.force_nn)) {
      ++level_;
      continue;
    }
    position += std::uint64_t{1} << (finest - level_);
    ++cells_;
    if (smooth && !(coefficient > tolerances_.force_nn)) {
      apply(cell, force);
      tip[0] = tip[cell_nodes - 1];
      force[0] = force[cell_nodes - 1];
    } else {
      cross_in_pieces<Model>(cell.seconds);
      tip[0] = tip_nm();
      force[0] = force_now<Model>(tip[0]);
    }
    const std::uint64_t longer = std::uint64_t{2} << (finest - level_);
    if (level_ > 0 && clear && coefficient < growth * tolerances_.force_nn && position % longer == 0)
      --level_;
  }
}

template <typename Model>
void Oscillator::advance_engaged(std::span<double> detector) {
  for (double& volts : detector) {
    volts = detector_v();
    cross_sample<Model>();
    begin_next_sample();
  }
}

void Oscillator::engage(const ModelInfo& model, std::span<const double> parameters) {
  if (parameters.size() != model.parameters.size()) {
    throw std::invalid_argument(fmt::format("parameters of model {}: {} values, must be {}", model.name,
                                            parameters.size(), model.parameters.size()));
  }
  std::ranges::copy(parameters, parameters_.begin());
  visit_model(model, [this]<typename Model>(Model /*type*/) {
    if constexpr (DependsOnHistory<Model>)
      throw std::invalid_argument(
          fmt::format("model: \"{}\", whose force depends on history, is not simulated", Model::model.name));
    else
      advance_ = &Oscillator::advance_engaged<Model>;
  });
}

}  // namespace combforce
