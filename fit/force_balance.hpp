// The model's side of the force balance (paper, equation 8): phasors of a model force along the partial
// motion,
//     F_i = (2/T) integral F(d(t)) exp(-i w_i t) dt,
// averaged over the motion's period, which divides the measured window: not over independent phases.
//
// Near the surface the cells of time go through CellQuadrature. Those that stay well above it (beyond
// `far_from`) are met once a motion: their nodes are deposited on a grid of d by cubic Lagrange
// interpolation, and an evaluation there costs the grid only.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "fit/cell_quadrature.hpp"
#include "fit/motion.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class ForceBalance {
 public:
  static constexpr std::size_t levels = CellQuadrature::levels;

  // `spacing_hz`: of the bins; only forces that depend on velocity need it.
  explicit ForceBalance(std::span<const std::uint64_t> bins, double spacing_hz = 0.0);

  void set_motion(std::span<const std::complex<double>> tones);
  const Motion& motion() const { return motion_; }
  double velocity_per_slope() const { return velocity_per_slope_; }  // nm/s per unit of dd/ds in a cell

  // Prepares evaluations at this level for surfaces about p0: true up to ceiling_nm(), efficient down to
  // about as far below p0 as the ceiling is above. What is prepared for a p0 within half of margin_nm() is
  // kept, until reset() or the next motion. `tail`: the model has a force beyond the surface. Where the force
  // depends on history all this is said of its contact_top_nm() instead of p0, and there is no such tail.
  void prepare(double p0, std::size_t level, bool tail);
  void reset() { prepared_ = false; }
  double ceiling_nm() const { return all_near() ? std::numeric_limits<double>::infinity() : grid_begin_nm(); }
  double margin_nm() const { return margin_; }

  // Adds the motion's lower, or its upper, turning points between `low` and `high`, no more than `points` has
  // room for, in time's order. True up to the ceiling.
  enum class Turning : bool { lower, upper };
  void add_turning_points(Turning which, double low, double high, std::vector<double>& points) const;

  // Phasors of the model's terms, a unit of each linear parameter: one column a contact term, then one a tail
  // term; one row a tone. contact_top_nm(p) must not exceed ceiling_nm(); linear parameters are not used.
  template <typename Model>
  static constexpr std::size_t columns = CellQuadrature::columns<Model>;
  template <typename Model>
  void evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> terms) const;

 private:
  using Piece = CellQuadrature::Piece;
  struct NearCell {
    std::size_t cell;
    std::size_t first_piece, pieces;
    double lowest, highest;
  };
  void split(double p0, bool tail);
  template <DependsOnHistory Model>
  bool begins_engaged(const double* p) const;
  bool add_near_cell(std::size_t cell);
  void add_far_cell(std::size_t cell);
  void add_far_part(const Motion::Polynomial& c, double curvature, std::size_t split, std::size_t part);
  void deposit(double d, const std::complex<double>* phases, double weight);

  // Far grid: cells of equal ratio in d - (far_from - margin), each with its Lagrange nodes.
  static constexpr std::size_t grid_order = 4;
  static constexpr double cells_per_octave = 8.0;
  static constexpr std::size_t grid_cells = 160;  // 20 octaves
  static constexpr std::size_t far_splits = 6;    // halvings of a cell: whole, halves, …, 32nds
  static constexpr std::array<std::size_t, levels> far_nodes{3, 5, 7, 9, 12};

  Motion motion_;
  double velocity_per_slope_;
  CellQuadrature quadrature_;
  // [level][split]: exp(i w t) from the centre of a cell, row-major nodes x tones, over 2^split equal parts.
  std::array<std::array<std::vector<std::complex<double>>, far_splits>, levels> far_phases_;

  // Whether no cell of the motion is far.
  bool all_near() const { return far_from_ > motion_.highest_nm(); }
  double grid_begin_nm() const { return far_from_ - margin_; }

  double margin_ = 0.0, far_from_ = 0.0;
  std::size_t far_level_ = 0;
  bool prepared_ = false;
  std::vector<NearCell> near_;
  std::vector<Piece> pieces_;
  std::size_t grid_used_ = 0;        // cells of the grid that hold something
  std::size_t grid_last_ = 0;        // cell of the last node: the next one is not far
  std::vector<double> grid_d_;       // nodes, of the cells used
  std::vector<double> grid_bounds_;  // of cells, over margin
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> grid_weights_;  // (re, im a tone) x nodes
  std::vector<std::complex<double>> centre_;
};

// Whether the motion, which repeats, has the tip engaged at the period's begin: as it last came to be before
// the period's end. Tips that neither touch nor rise above the neck's end in the whole period are not.
template <DependsOnHistory Model>
bool ForceBalance::begins_engaged(const double* p) const {
  const double surface = p[0], release = contact_top_nm<Model>(p);
  std::size_t cell = motion_.cells();
  for (auto near = near_.rbegin(); near != near_.rend() && near->cell + 1 == cell; ++near, --cell) {
    for (std::size_t i = near->pieces; i-- > 0;) {
      const Piece& piece = pieces_[near->first_piece + i];
      for (const double d : {piece.d_end, piece.d_begin})
        if (d < surface || d > release) return d < surface;
    }
  }
  return false;
}

template <typename Model>
void ForceBalance::evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> terms) const {
  constexpr std::size_t contacts = Model::contact_terms.size(), tails = Model::tail_terms.size();
  terms.setZero();
  [[maybe_unused]] bool engaged = false;
  [[maybe_unused]] std::size_t next = 0;
  if constexpr (DependsOnHistory<Model>) engaged = begins_engaged<Model>(p);
  for (const NearCell& near : near_) {
    if constexpr (DependsOnHistory<Model>) {
      engaged = engaged && near.cell == next;  // between near cells the tip is far away
      next = near.cell + 1;
    }
    if ((tails == 0 || DependsOnHistory<Model>)&&!engaged && near.lowest > p[0]) continue;
    CellQuadrature::Sum<Model> sum{};
    const Motion::Polynomial& c = motion_.polynomial(near.cell);
    for (std::size_t i = 0; i < near.pieces; ++i) {
      const Piece& piece = pieces_[near.first_piece + i];
      if constexpr (DependsOnHistory<Model>)
        engaged = quadrature_.add_piece<Model>(p, c, piece, engaged, sum);
      else
        quadrature_.add_piece<Model>(p, c, piece, sum);
    }
    const std::span<const Motion::Moments> moments(sum.moments);
    if (near.lowest < p[0]) motion_.add_moments(near.cell, moments.first(contacts), terms.data());
    if (tails > 0 && near.highest > p[0])
      motion_.add_moments(near.cell, moments.last(tails), terms.data() + contacts * motion_.tones());
  }
  if constexpr (tails > 0 && !DependsOnHistory<Model>) {
    for (std::size_t node = 0; node < grid_used_ * grid_order; ++node) {
      const auto values = Model::tail(p, grid_d_[node] - p[0]);
      const double* weights = grid_weights_.col(static_cast<Eigen::Index>(node)).data();
      auto* column = reinterpret_cast<double*>(terms.data() + contacts * motion_.tones());
      for (std::size_t m = 0; m < tails; ++m)
        for (std::size_t i = 0; i < 2 * motion_.tones(); ++i) *column++ += values[m] * weights[i];
    }
  }
}

}  // namespace combforce
