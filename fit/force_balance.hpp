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
  static constexpr std::size_t levels = 5;

  explicit ForceBalance(std::span<const std::uint64_t> bins);

  void set_motion(std::span<const std::complex<double>> tones);
  const Motion& motion() const { return motion_; }

  // Prepares evaluations at this level for surfaces about p0: true up to ceiling_nm(), efficient down to
  // about as far below p0 as the ceiling is above. What is prepared for a p0 within half of margin_nm() is
  // kept, until reset() or the next motion. `tail`: the model has a force beyond the surface.
  void prepare(double p0, std::size_t level, bool tail);
  void reset() { prepared_ = false; }
  double ceiling_nm() const { return far_from_ - margin_; }
  double margin_nm() const { return margin_; }

  // Phasors of the model's terms, a unit of each linear parameter: one column a contact term, then one a tail
  // term; one row a tone. p[0] must not exceed ceiling_nm(); linear parameters are not used.
  template <typename Model>
  static constexpr std::size_t columns = Model::contact_terms.size() + Model::tail_terms.size();
  template <typename Model>
  void evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> terms) const;

 private:
  struct Piece {  // a stretch of a cell over which d is monotone
    double begin, end, d_begin, d_end;
  };
  struct NearCell {
    std::size_t cell;
    std::size_t first_piece, pieces;
    double lowest, highest;
  };
  template <typename Model>
  struct Sum {  // moments over one cell of every term
    std::array<Motion::Moments, columns<Model>> moments;
  };

  void split(double p0, bool tail);
  bool add_near_cell(std::size_t cell);
  void add_far_cell(std::size_t cell);
  void add_far_part(const Motion::Polynomial& c, double curvature, std::size_t split, std::size_t part);
  void deposit(double d, const std::complex<double>* phases, double weight);
  template <typename Model>
  void add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <std::size_t First, std::size_t Terms, typename SumOfModel>
  static void add_node(const std::array<double, Terms>& values, double s, double weight, SumOfModel& sum);

  // Far grid: cells of equal ratio in d - (far_from - margin), each with its Lagrange nodes.
  static constexpr std::size_t grid_order = 4;
  static constexpr double cells_per_octave = 8.0;
  static constexpr std::size_t grid_cells = 160;  // 20 octaves
  static constexpr std::size_t far_splits = 6;    // halvings of a cell: whole, halves, …, 32nds
  static constexpr std::array<std::size_t, levels> contact_nodes{6, 9, 13, 18, 24};
  static constexpr std::array<std::size_t, levels> far_nodes{3, 5, 7, 9, 12};
  static constexpr double widest_ratio = 4.0;
  static constexpr std::array<double, 4> tail_ratios{1.3, 1.7, 2.4, widest_ratio};
  static constexpr std::array<std::array<std::size_t, tail_ratios.size()>, levels> tail_nodes_of_ratio{
      {{3, 4, 5, 6}, {5, 6, 7, 9}, {7, 9, 10, 13}, {9, 12, 14, 18}, {12, 16, 19, 24}}};
  static constexpr std::size_t most_nodes = 24;

  std::size_t tail_nodes(double ratio) const {
    std::size_t i = 0;
    while (i + 1 < tail_ratios.size() && ratio > tail_ratios[i]) ++i;
    return tail_nodes_of_ratio[level_][i];
  }

  Motion motion_;
  std::array<GaussRule, most_nodes + 1> rules_;  // by their number of nodes
  // [level][split]: exp(i w t) from the centre of a cell, row-major nodes x tones, over 2^split equal parts.
  std::array<std::array<std::vector<std::complex<double>>, far_splits>, levels> far_phases_;

  double margin_ = 0.0, far_from_ = 0.0;
  std::size_t level_ = 0, far_level_ = 0;
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

// Adds terms First, First + 1, … at one node.
template <std::size_t First, std::size_t Terms, typename SumOfModel>
void ForceBalance::add_node(const std::array<double, Terms>& values, double s, double weight,
                            SumOfModel& sum) {
  Motion::Moments powers;
  powers[0] = weight;
  powers[1] = weight * s;
  const double square = s * s;
  for (std::size_t k = 2; k < Motion::order; ++k) powers[k] = powers[k - 2] * square;
  for (std::size_t m = 0; m < Terms; ++m)
    for (std::size_t k = 0; k < Motion::order; ++k) sum.moments[First + m][k] += values[m] * powers[k];
}

// Nodes crowd quadratically at the shallow end when it is at, or close to, the kink.
template <typename Model>
void ForceBalance::add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece,
                               Sum<Model>& sum) const {
  const bool falling = piece.d_begin > piece.d_end;
  const double shallow = falling ? piece.begin : piece.end;
  const double length = falling ? piece.end - piece.begin : piece.begin - piece.end;
  const double shallow_depth = p[0] - std::max(piece.d_begin, piece.d_end);
  const double deep_depth = p[0] - std::min(piece.d_begin, piece.d_end);
  const bool crowd = 3.0 * shallow_depth < deep_depth;
  const GaussRule& rule = rules_[contact_nodes[level_]];
  for (std::size_t j = 0; j < rule.nodes.size(); ++j) {
    const double u = rule.nodes[j];
    const double s = shallow + length * (crowd ? u * u : u);
    const double weight = std::abs(length) * rule.weights[j] * (crowd ? 2.0 * u : 1.0);
    const double depth = std::max(p[0] - value_at(c, s), 0.0);
    add_node<0>(Model::contact(p, depth), s, weight, sum);
  }
}

// Parts over which the distance to the pole at p0 - tail_length() grows by widest_ratio at most, each with as
// many nodes as its ratio asks for.
template <typename Model>
void ForceBalance::add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece,
                            Sum<Model>& sum) const {
  const double pole = p[0] - Model::tail_length(p);
  const double from = piece.d_begin - pole, to = piece.d_end - pole;
  const double whole = std::max(from, to) / std::min(from, to);
  int parts = 1;
  for (double reach = widest_ratio; reach < whole; reach *= widest_ratio) ++parts;
  const double ratio = parts > 1 ? std::pow(to / from, 1.0 / parts) : to / from;
  const GaussRule& rule = rules_[tail_nodes(std::max(ratio, 1.0 / ratio))];
  double begin = piece.begin, distance = from;
  for (int part = 1; part <= parts; ++part) {
    distance *= ratio;
    const double end =
        part == parts ? piece.end : crossing(c, begin, piece.end, pole + distance, 0.02 * distance);
    for (std::size_t j = 0; j < rule.nodes.size(); ++j) {
      const double s = begin + (end - begin) * rule.nodes[j];
      const double height = std::max(value_at(c, s) - p[0], 0.0);
      add_node<Model::contact_terms.size()>(Model::tail(p, height), s, (end - begin) * rule.weights[j], sum);
    }
    begin = end;
  }
}

template <typename Model>
void ForceBalance::add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece,
                             Sum<Model>& sum) const {
  constexpr bool tail = !Model::tail_terms.empty();
  const double surface = p[0];
  if (piece.d_begin <= surface && piece.d_end <= surface) {
    add_contact<Model>(p, c, piece, sum);
  } else if (piece.d_begin >= surface && piece.d_end >= surface) {
    if constexpr (tail) add_tail<Model>(p, c, piece, sum);
  } else {
    const double s = crossing(c, piece.begin, piece.end, surface, 1e-12);
    const Piece before{piece.begin, s, piece.d_begin, surface};
    const Piece after{s, piece.end, surface, piece.d_end};
    add_contact<Model>(p, c, piece.d_begin < surface ? before : after, sum);
    if constexpr (tail) add_tail<Model>(p, c, piece.d_begin < surface ? after : before, sum);
  }
}

template <typename Model>
void ForceBalance::evaluate(const double* p, Eigen::Ref<Eigen::MatrixXcd> terms) const {
  constexpr std::size_t contacts = Model::contact_terms.size(), tails = Model::tail_terms.size();
  terms.setZero();
  for (const NearCell& near : near_) {
    if (tails == 0 && near.lowest > p[0]) continue;
    Sum<Model> sum{};
    const Motion::Polynomial& c = motion_.polynomial(near.cell);
    for (std::size_t i = 0; i < near.pieces; ++i) add_piece<Model>(p, c, pieces_[near.first_piece + i], sum);
    const std::span<const Motion::Moments> moments(sum.moments);
    if (near.lowest < p[0]) motion_.add_moments(near.cell, moments.first(contacts), terms.data());
    if (tails > 0 && near.highest > p[0])
      motion_.add_moments(near.cell, moments.last(tails), terms.data() + contacts * motion_.tones());
  }
  if constexpr (tails > 0) {
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
