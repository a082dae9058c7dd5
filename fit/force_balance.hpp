// The model's side of the force balance (paper, equation 8): phasors of a model force along the partial
// motion,
//     F_i = (2/T) integral F(d(t)) exp(-i w_i t) dt,
// averaged over the motion's period, which divides the measured window: not over independent phases.
//
// Quadrature. Near the surface the time is cut at the motion's turning points, at every crossing of d = p0
// (the kink) and, beyond it, where the distance to the tail's pole has doubled; each piece gets a
// Gauss-Legendre rule, contact pieces after the substitution t = t0 + s^2 that removes the 3/2 power. The
// cuts move with p0, so the integral is as smooth in the parameters as the truth. Cells of time that stay
// well above the surface (beyond `far_from`) are met once a motion: their nodes are deposited on a grid of d
// by cubic Lagrange interpolation, and an evaluation there costs the grid only. A level says how fine all
// this is; differences between levels estimate the error.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/motion.hpp"
#include "fit/quadrature.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class ForceBalance {
 public:
  static constexpr std::size_t levels = 6;

  explicit ForceBalance(std::span<const std::uint64_t> bins);

  void set_motion(std::span<const std::complex<double>> tones);
  const Motion& motion() const { return motion_; }

  // Prepares evaluations at this level for surfaces about p0: true up to ceiling_nm(), efficient down to
  // about as far below p0 as the ceiling is above. `tail`: the model has a force beyond the surface.
  void prepare(double p0, std::size_t level, bool tail);
  double ceiling_nm() const { return far_from_ - margin_; }
  double margin_nm() const { return margin_; }

  // Derivatives of the model's phasors with respect to its parameters, nN a unit of the parameter: column k
  // holds those of p[k], one a tone. The phasors themselves are the sum of p[k] times column k over the
  // linear parameters. p[0] must not exceed ceiling_nm().
  template <typename Model>
  void evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> derivatives);

 private:
  struct Piece {  // a stretch of a cell over which d is monotone
    double begin, end, d_begin, d_end;
  };
  struct NearCell {
    std::size_t cell;
    std::size_t first_piece, pieces;
  };
  template <typename Model>
  struct Sum {  // moments over one cell of every derivative
    std::array<Motion::Moments, Model::parameters> moments;
  };

  void add_near_cell(std::size_t cell);
  void add_far_cell(std::size_t cell);
  void deposit(double d, const std::complex<double>* phases, double weight);
  template <typename Model>
  void add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  static void add_node(const double* p, const Motion::Polynomial& c, double s, double weight,
                       Sum<Model>& sum);

  // Far grid: cells of equal ratio in d - (far_from - margin), each with its Lagrange nodes.
  static constexpr std::size_t grid_order = 4;
  static constexpr double cells_per_octave = 8.0;
  static constexpr std::size_t grid_cells = 160;  // 20 octaves
  static constexpr std::size_t far_splits = 6;    // halvings of a cell: whole, halves, …, 32nds
  static constexpr std::array<std::size_t, levels> near_nodes{4, 6, 9, 13, 18, 24};
  static constexpr std::array<std::size_t, levels> far_nodes{3, 3, 5, 7, 9, 12};

  Motion motion_;
  std::array<GaussRule, levels> near_rules_, far_rules_;
  // [level][split]: exp(i w t) from the centre of a cell, row-major nodes x tones, over 2^split equal parts.
  std::array<std::array<std::vector<std::complex<double>>, far_splits>, levels> far_phases_;

  double margin_ = 0.0, far_from_ = 0.0;
  std::size_t level_ = 0;
  std::vector<NearCell> near_;
  std::vector<Piece> pieces_;
  std::size_t grid_used_ = 0;        // cells of the grid that hold something
  std::vector<double> grid_d_;       // nodes, of the cells used
  std::vector<double> grid_bounds_;  // of cells, over margin
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> grid_weights_;  // (re, im a tone) x nodes
  std::vector<std::complex<double>> node_phases_, centre_;
};

template <typename Model>
void ForceBalance::add_node(const double* p, const Motion::Polynomial& c, double s, double weight,
                            Sum<Model>& sum) {
  std::array<double, Model::parameters> gradient;
  Model::derivatives(p, value_at(c, s), gradient.data());
  Motion::Moments powers;
  powers[0] = weight;
  powers[1] = weight * s;
  const double square = s * s;
  for (std::size_t k = 2; k < Motion::order; ++k) powers[k] = powers[k - 2] * square;
  for (std::size_t m = 0; m < Model::parameters; ++m)
    for (std::size_t k = 0; k < Motion::order; ++k) sum.moments[m][k] += gradient[m] * powers[k];
}

// Contact: deep end and shallow end. Nodes crowd quadratically at the shallow end when it is at, or close to,
// the kink.
template <typename Model>
void ForceBalance::add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece,
                               Sum<Model>& sum) const {
  const bool falling = piece.d_begin > piece.d_end;
  const double shallow = falling ? piece.begin : piece.end;
  const double length = falling ? piece.end - piece.begin : piece.begin - piece.end;
  const double shallow_depth = p[0] - std::max(piece.d_begin, piece.d_end);
  const double deep_depth = p[0] - std::min(piece.d_begin, piece.d_end);
  const bool crowd = shallow_depth < deep_depth / 8.0;
  const GaussRule& rule = near_rules_[level_];
  for (std::size_t j = 0; j < rule.nodes.size(); ++j) {
    const double u = rule.nodes[j];
    const double weight = std::abs(length) * rule.weights[j];
    if (crowd)
      add_node<Model>(p, c, shallow + length * u * u, weight * 2.0 * u, sum);
    else
      add_node<Model>(p, c, shallow + length * u, weight, sum);
  }
}

// Beyond the surface: parts over which the distance to the pole at p0 - tail_length() at most doubles.
template <typename Model>
void ForceBalance::add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece,
                            Sum<Model>& sum) const {
  const double pole = p[0] - Model::tail_length(p);
  const double from = piece.d_begin - pole, to = piece.d_end - pole;
  const double octaves = std::ceil(std::abs(std::log2(to / from)) - 1e-9);
  const int parts = std::max(1, static_cast<int>(octaves));
  const GaussRule& rule = near_rules_[level_];
  const double ratio = parts > 1 ? std::pow(to / from, 1.0 / parts) : 1.0;
  double begin = piece.begin, distance = from;
  for (int part = 1; part <= parts; ++part) {
    distance *= ratio;
    const double end =
        part == parts ? piece.end : crossing(c, begin, piece.end, pole + distance, 0.02 * distance);
    for (std::size_t j = 0; j < rule.nodes.size(); ++j)
      add_node<Model>(p, c, begin + (end - begin) * rule.nodes[j], (end - begin) * rule.weights[j], sum);
    begin = end;
  }
}

template <typename Model>
void ForceBalance::add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece,
                             Sum<Model>& sum) const {
  const double surface = p[0];
  if (piece.d_begin <= surface && piece.d_end <= surface) {
    add_contact<Model>(p, c, piece, sum);
  } else if (piece.d_begin >= surface && piece.d_end >= surface) {
    if constexpr (Model::has_tail) add_tail<Model>(p, c, piece, sum);
  } else {
    const double s = crossing(c, piece.begin, piece.end, surface, 1e-12);
    const Piece before{piece.begin, s, piece.d_begin, surface};
    const Piece after{s, piece.end, surface, piece.d_end};
    add_contact<Model>(p, c, piece.d_begin < surface ? before : after, sum);
    if constexpr (Model::has_tail) add_tail<Model>(p, c, piece.d_begin < surface ? after : before, sum);
  }
}

template <typename Model>
void ForceBalance::evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> derivatives) {
  derivatives.setZero();
  for (const NearCell& near : near_) {
    Sum<Model> sum{};
    const Motion::Polynomial& c = motion_.polynomial(near.cell);
    for (std::size_t i = 0; i < near.pieces; ++i) add_piece<Model>(p, c, pieces_[near.first_piece + i], sum);
    for (std::size_t m = 0; m < Model::parameters; ++m)
      motion_.add_moments(near.cell, sum.moments[m], derivatives.col(static_cast<Eigen::Index>(m)).data());
  }
  if constexpr (Model::has_tail) {
    std::array<double, Model::parameters> gradient;
    for (std::size_t node = 0; node < grid_used_ * grid_order; ++node) {
      Model::derivatives(p, grid_d_[node], gradient.data());
      const double* weights = grid_weights_.col(static_cast<Eigen::Index>(node)).data();
      for (std::size_t m = 0; m < Model::parameters; ++m) {
        auto* column = reinterpret_cast<double*>(derivatives.col(static_cast<Eigen::Index>(m)).data());
        for (std::size_t i = 0; i < 2 * motion_.tones(); ++i) column[i] += gradient[m] * weights[i];
      }
    }
  }
}

}  // namespace combforce
