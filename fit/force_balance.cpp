#include "fit/force_balance.hpp"

namespace combforce {
namespace {

// Lagrange nodes of a grid cell over [0, 1]: Chebyshev points of order 4.
constexpr std::array<double, 4> lagrange_nodes{0.03806023374435663, 0.30865828381745514, 0.6913417161825449,
                                               0.9619397662556434};

std::array<double, 4> lagrange_weights(double u) {
  std::array<double, 4> weights;
  for (std::size_t j = 0; j < 4; ++j) {
    weights[j] = 1.0;
    for (std::size_t m = 0; m < 4; ++m)
      if (m != j) weights[j] *= (u - lagrange_nodes[m]) / (lagrange_nodes[j] - lagrange_nodes[m]);
  }
  return weights;
}

// Of the span of the motion: how far above the surface the far grid's singularities stay away, at least.
constexpr double margin_of_span = 1.0 / 40.0;

}  // namespace

ForceBalance::ForceBalance(std::span<const std::uint64_t> bins) : motion_(bins) {
  const std::size_t tones = motion_.tones();
  for (std::size_t level = 0; level < levels; ++level) {
    near_rules_[level] = gauss_legendre(near_nodes[level]);
    far_rules_[level] = gauss_legendre(far_nodes[level]);
    for (std::size_t split = 0; split < far_splits; ++split) {
      const std::size_t parts = std::size_t{1} << split;
      for (std::size_t part = 0; part < parts; ++part)
        for (const double u : far_rules_[level].nodes)
          for (std::size_t tone = 0; tone < tones; ++tone)
            far_phases_[level][split].push_back(motion_.local_phase(
                tone, -1.0 + 2.0 * (static_cast<double>(part) + u) / static_cast<double>(parts)));
    }
  }
  near_.reserve(motion_.cells());
  // A cell has one piece, and one more for every turning point in it; the motion has 2 highest_harmonic() at
  // most.
  pieces_.reserve(motion_.cells() + 2 * motion_.highest_harmonic());
  grid_d_.resize(grid_cells * grid_order);
  for (std::size_t i = 0; i <= grid_cells; ++i)
    grid_bounds_.push_back(std::exp2(static_cast<double>(i) / cells_per_octave));
  grid_weights_.resize(static_cast<Eigen::Index>(2 * tones), grid_cells * grid_order);
  node_phases_.resize(tones);
  centre_.resize(tones);
}

void ForceBalance::set_motion(std::span<const std::complex<double>> tones) {
  motion_.set(tones);
}

void ForceBalance::prepare(double p0, std::size_t level, bool tail) {
  margin_ = margin_of_span * (motion_.highest_nm() - motion_.lowest_nm());
  far_from_ = p0 + 2.0 * margin_;
  level_ = level;
  near_.clear();
  pieces_.clear();
  grid_used_ = 0;
  grid_weights_.setZero();
  for (std::size_t cell = 0; cell < motion_.cells(); ++cell) {
    const Motion::Polynomial& c = motion_.polynomial(cell);
    if (c[0] - spread(c) < far_from_)
      add_near_cell(cell);
    else if (tail)
      add_far_cell(cell);
  }
  for (std::size_t cell = 0; cell < grid_used_; ++cell) {
    const double low = grid_bounds_[cell], width = grid_bounds_[cell + 1] - low;
    for (std::size_t j = 0; j < grid_order; ++j)
      grid_d_[cell * grid_order + j] = ceiling_nm() + margin_ * (low + width * lagrange_nodes[j]);
  }
}

void ForceBalance::add_near_cell(std::size_t cell) {
  const Motion::Polynomial& c = motion_.polynomial(cell);
  std::array<double, Motion::order> points;
  const std::size_t turns = turning_points(c, points);
  near_.push_back({cell, pieces_.size(), 0});
  double begin = -1.0, d_begin = value_at(c, -1.0);
  for (std::size_t i = 0; i <= turns; ++i) {
    const double end = i < turns ? points[i] : 1.0;
    const double d_end = value_at(c, end);
    if (end > begin && pieces_.size() < pieces_.capacity()) {
      pieces_.push_back({begin, end, d_begin, d_end});
      ++near_.back().pieces;
    }
    begin = end;
    d_begin = d_end;
  }
}

// The cell is halved until d varies over a part by less than its distance from where the force may be
// singular.
void ForceBalance::add_far_cell(std::size_t cell) {
  const Motion::Polynomial& c = motion_.polynomial(cell);
  const double reach = spread(c);
  const double distance = c[0] - reach - ceiling_nm();
  std::size_t split = 0;
  while (split + 1 < far_splits && 2.0 * reach > distance * static_cast<double>(std::size_t{1} << split))
    ++split;
  const std::size_t parts = std::size_t{1} << split;
  const double length = 2.0 / static_cast<double>(parts);
  const GaussRule& rule = far_rules_[level_];
  const std::complex<double>* phases = far_phases_[level_][split].data();
  for (std::size_t tone = 0; tone < motion_.tones(); ++tone) centre_[tone] = motion_.centre_phase(cell, tone);
  for (std::size_t part = 0; part < parts; ++part)
    for (std::size_t j = 0; j < rule.nodes.size(); ++j, phases += motion_.tones()) {
      const double s = -1.0 + length * (static_cast<double>(part) + rule.nodes[j]);
      deposit(value_at(c, s), phases, motion_.cell_weight() * length * rule.weights[j]);
    }
}

void ForceBalance::deposit(double d, const std::complex<double>* phases, double weight) {
  const double x = (d - ceiling_nm()) / margin_;
  const auto cell =
      std::min(static_cast<std::size_t>(cells_per_octave * std::log2(std::max(x, 1.0))), grid_cells - 1);
  grid_used_ = std::max(grid_used_, cell + 1);
  const std::array<double, 4> shares =
      lagrange_weights((x - grid_bounds_[cell]) / (grid_bounds_[cell + 1] - grid_bounds_[cell]));
  const std::size_t tones = motion_.tones();
  for (std::size_t tone = 0; tone < tones; ++tone) {
    const double re = phases[tone].real() * centre_[tone].real() - phases[tone].imag() * centre_[tone].imag();
    const double im = phases[tone].real() * centre_[tone].imag() + phases[tone].imag() * centre_[tone].real();
    node_phases_[tone] = {weight * re, -weight * im};
  }
  const auto* node = reinterpret_cast<const double*>(node_phases_.data());
  for (std::size_t j = 0; j < grid_order; ++j) {
    double* column = grid_weights_.col(static_cast<Eigen::Index>(cell * grid_order + j)).data();
    for (std::size_t i = 0; i < 2 * tones; ++i) column[i] += shares[j] * node[i];
  }
}

}  // namespace combforce
