#include "fit/force_balance.hpp"

namespace combforce {
namespace {

// Lagrange nodes of a grid cell over [0, 1]: Chebyshev points of order 4.
constexpr std::array<double, 4> lagrange_nodes{0.03806023374435663, 0.30865828381745514, 0.6913417161825449,
                                               0.9619397662556434};

// 1 over the product of the distances to the other nodes.
constexpr std::array<double, 4> lagrange_scales = [] {
  std::array<double, 4> scales{1.0, 1.0, 1.0, 1.0};
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t m = 0; m < 4; ++m)
      if (m != j) scales[j] /= lagrange_nodes[j] - lagrange_nodes[m];
  return scales;
}();

std::array<double, 4> lagrange_weights(double u) {
  const double a = u - lagrange_nodes[0], b = u - lagrange_nodes[1];
  const double c = u - lagrange_nodes[2], d = u - lagrange_nodes[3];
  return {b * c * d * lagrange_scales[0], a * c * d * lagrange_scales[1], a * b * d * lagrange_scales[2],
          a * b * c * lagrange_scales[3]};
}

// Of the span of the motion: how far above the surface the far grid's singularities stay away, at least.
constexpr double margin_of_span = 1.0 / 40.0;

}  // namespace

ForceBalance::ForceBalance(std::span<const std::uint64_t> bins, double spacing_hz)
    : motion_(bins),
      velocity_per_slope_(motion_.velocity_per_slope(spacing_hz)),
      quadrature_(velocity_per_slope_) {
  const std::size_t tones = motion_.tones();
  for (std::size_t level = 0; level < levels; ++level) {
    for (std::size_t split = 0; split < far_splits; ++split) {
      const std::size_t parts = std::size_t{1} << split;
      for (std::size_t part = 0; part < parts; ++part)
        for (const double u : quadrature_.rule(far_nodes[level]).nodes)
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
  centre_.resize(tones);
}

void ForceBalance::set_motion(std::span<const std::complex<double>> tones) {
  motion_.set(tones);
  margin_ = margin_of_span * (motion_.highest_nm() - motion_.lowest_nm());
  prepared_ = false;
}

void ForceBalance::prepare(double p0, std::size_t level, bool tail) {
  const double about = far_from_ - 2.0 * margin_;
  const bool kept = prepared_ && (std::abs(p0 - about) <= 0.5 * margin_ ||
                                  (all_near() && p0 + 2.0 * margin_ > motion_.highest_nm()));
  quadrature_.set_level(level);
  if (kept && (!tail || far_level_ == level)) return;
  far_level_ = level;
  prepared_ = true;
  split(kept ? about : p0, tail);
}

void ForceBalance::split(double p0, bool tail) {
  far_from_ = p0 + 2.0 * margin_;
  near_.clear();
  pieces_.clear();
  grid_used_ = grid_last_ = 0;
  grid_weights_.setZero();
  for (std::size_t cell = 0; cell < motion_.cells(); ++cell)
    if (!add_near_cell(cell) && tail) add_far_cell(cell);
  for (std::size_t cell = 0; cell < grid_used_; ++cell) {
    const double low = grid_bounds_[cell], width = grid_bounds_[cell + 1] - low;
    for (std::size_t j = 0; j < grid_order; ++j)
      grid_d_[cell * grid_order + j] = grid_begin_nm() + margin_ * (low + width * lagrange_nodes[j]);
  }
}

void ForceBalance::add_turning_points(Turning which, double low, double high,
                                      std::vector<double>& points) const {
  for (const NearCell& near : near_)
    for (std::size_t i = 0; i + 1 < near.pieces; ++i) {
      const Piece& piece = pieces_[near.first_piece + i];
      const bool falls = piece.d_end < piece.d_begin;
      if (falls == (which == Turning::lower) && piece.d_end > low && piece.d_end < high &&
          points.size() < points.capacity())
        points.push_back(piece.d_end);
    }
}

// False when the cell stays above far_from_: nothing is added then.
bool ForceBalance::add_near_cell(std::size_t cell) {
  const Motion::Polynomial& c = motion_.polynomial(cell);
  if (c[0] - spread(c) >= far_from_) return false;
  std::array<double, Motion::order> points;
  const std::size_t turns = turning_points(c, points);
  const std::size_t first = pieces_.size();
  double begin = -1.0, d_begin = value_at(c, -1.0);
  double lowest = d_begin, highest = d_begin;
  for (std::size_t i = 0; i <= turns; ++i) {
    const double end = i < turns ? points[i] : 1.0;
    const double d_end = value_at(c, end);
    lowest = std::min(lowest, d_end);
    highest = std::max(highest, d_end);
    if (end > begin && pieces_.size() < pieces_.capacity()) pieces_.push_back({begin, end, d_begin, d_end});
    begin = end;
    d_begin = d_end;
  }
  if (lowest >= far_from_) {
    pieces_.resize(first);
    return false;
  }
  near_.push_back({cell, first, pieces_.size() - first, lowest, highest});
  return true;
}

void ForceBalance::add_far_cell(std::size_t cell) {
  const Motion::Polynomial& c = motion_.polynomial(cell);
  for (std::size_t tone = 0; tone < motion_.tones(); ++tone) centre_[tone] = motion_.centre_phase(cell, tone);
  double curvature = 0.0;
  for (std::size_t k = 2; k < Motion::order; ++k)
    curvature += static_cast<double>(k * (k - 1)) * std::abs(c[k]);
  add_far_part(c, curvature, 0, 0);
}

// Part `part` of 2^split equal ones of a cell; halved until d, bounded by its slope and the greatest
// curvature, varies over it by less than its distance from where the force may be singular.
void ForceBalance::add_far_part(const Motion::Polynomial& c, double curvature, std::size_t split,
                                std::size_t part) {
  const double half = 1.0 / static_cast<double>(std::size_t{1} << split);
  const double middle = -1.0 + half * (2.0 * static_cast<double>(part) + 1.0);
  if (split + 1 < far_splits) {
    const auto [d, slope] = value_and_slope_at(c, middle);
    const double reach = std::abs(slope) * half + 0.5 * curvature * half * half;
    if (2.0 * reach > std::max(d - reach, far_from_) - grid_begin_nm()) {
      add_far_part(c, curvature, split + 1, 2 * part);
      add_far_part(c, curvature, split + 1, 2 * part + 1);
      return;
    }
  }
  const GaussRule& rule = quadrature_.rule(far_nodes[far_level_]);
  const std::complex<double>* phases =
      far_phases_[far_level_][split].data() + part * rule.nodes.size() * motion_.tones();
  for (std::size_t j = 0; j < rule.nodes.size(); ++j, phases += motion_.tones())
    deposit(value_at(c, middle + half * (2.0 * rule.nodes[j] - 1.0)), phases,
            motion_.cell_weight() * 2.0 * half * rule.weights[j]);
}

void ForceBalance::deposit(double d, const std::complex<double>* phases, double weight) {
  const double x = (d - grid_begin_nm()) / margin_;
  std::size_t cell = grid_last_;
  while (cell > 0 && x < grid_bounds_[cell]) --cell;
  while (cell + 1 < grid_cells && x >= grid_bounds_[cell + 1]) ++cell;
  grid_last_ = cell;
  grid_used_ = std::max(grid_used_, cell + 1);
  std::array<double, 4> shares =
      lagrange_weights((x - grid_bounds_[cell]) / (grid_bounds_[cell + 1] - grid_bounds_[cell]));
  for (double& share : shares) share *= weight;
  double* weights = grid_weights_.col(static_cast<Eigen::Index>(cell * grid_order)).data();
  const std::size_t tones = motion_.tones();
  for (std::size_t tone = 0; tone < tones; ++tone) {
    const double re = phases[tone].real() * centre_[tone].real() - phases[tone].imag() * centre_[tone].imag();
    const double im = phases[tone].real() * centre_[tone].imag() + phases[tone].imag() * centre_[tone].real();
    for (std::size_t j = 0; j < grid_order; ++j) {
      weights[2 * (j * tones + tone)] += shares[j] * re;
      weights[2 * (j * tones + tone) + 1] -= shares[j] * im;
    }
  }
}

}  // namespace combforce
