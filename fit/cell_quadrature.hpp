// Moments of a model's terms over one cell of a motion: what every integral of a force along a motion is made
// of.
//
// A cell is cut at the motion's turning points into pieces over which d is monotone, those at the crossing of
// d = p0 (the kink) and where a force that depends on velocity is clamped, and beyond it where the distance
// to the tail's pole has grown fourfold. Each part gets a Gauss-Legendre rule; contact parts that reach the
// kink after the substitution t = t0 + s^2 that removes the 3/2 power. The cuts move with p0, so the integral
// is as smooth in the parameters as the truth. A level says how fine the rules are; differences between
// levels estimate the error.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "fit/force_model.hpp"
#include "fit/motion.hpp"
#include "fit/quadrature.hpp"

namespace combforce {

// Thread-bound. Only the constructor allocates.
class CellQuadrature {
 public:
  static constexpr std::size_t levels = 5;

  // A stretch of a cell over which d is monotone.
  struct Piece {
    double begin, end, d_begin, d_end;
  };
  // A model's terms: contact terms, then tail terms.
  template <typename Model>
  static constexpr std::size_t columns = Model::contact_terms.size() + Model::tail_terms.size();
  template <typename Model>
  struct Sum {
    std::array<Motion::Moments, columns<Model>> moments;
  };

  // `velocity_per_slope`: nm/s per unit of dd/ds; for models that depend on velocity.
  explicit CellQuadrature(double velocity_per_slope);

  void set_level(std::size_t level) { level_ = level; }
  std::size_t level() const { return level_; }
  const GaussRule& rule(std::size_t nodes) const { return rules_[nodes]; }

  // Adds the moments of a unit of each linear parameter over a piece of the cell with polynomial `c`.
  template <typename Model>
  void add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;

  // The same over a whole cell, s from -1 to 1.
  template <typename Model>
  void add_cell(const double* p, const Motion::Polynomial& c, Sum<Model>& sum) const;

 private:
  template <typename Model>
  void add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_active(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <std::size_t First, std::size_t Terms, typename SumOfModel>
  static void add_node(const std::array<double, Terms>& values, double s, double weight, SumOfModel& sum);

  static constexpr std::array<std::size_t, levels> contact_nodes{6, 9, 13, 18, 24};
  static constexpr double widest_ratio = 4.0;
  static constexpr std::array<double, 4> tail_ratios{1.3, 1.7, 2.4, widest_ratio};
  static constexpr std::array<std::array<std::size_t, tail_ratios.size()>, levels> tail_nodes_of_ratio{
      {{3, 4, 5, 6}, {5, 6, 7, 9}, {7, 9, 10, 13}, {9, 12, 14, 18}, {12, 16, 19, 24}}};
  static constexpr std::size_t most_nodes = 26;

  std::size_t tail_nodes(double ratio) const {
    std::size_t i = 0;
    while (i + 1 < tail_ratios.size() && ratio > tail_ratios[i]) ++i;
    return tail_nodes_of_ratio[level_][i];
  }

  double velocity_per_slope_;
  std::array<GaussRule, most_nodes + 1> rules_;  // by their number of nodes
  std::size_t level_ = 0;
};

inline CellQuadrature::CellQuadrature(double velocity_per_slope) : velocity_per_slope_(velocity_per_slope) {
  for (std::size_t nodes = 1; nodes <= most_nodes; ++nodes) rules_[nodes] = gauss_legendre(nodes);
}

// Adds terms First, First + 1, … at one node.
template <std::size_t First, std::size_t Terms, typename SumOfModel>
void CellQuadrature::add_node(const std::array<double, Terms>& values, double s, double weight,
                              SumOfModel& sum) {
  Motion::Moments powers;
  powers[0] = weight;
  powers[1] = weight * s;
  const double square = s * s;
  for (std::size_t k = 2; k < Motion::order; ++k) powers[k] = powers[k - 2] * square;
  for (std::size_t m = 0; m < Terms; ++m)
    for (std::size_t k = 0; k < Motion::order; ++k) sum.moments[First + m][k] += values[m] * powers[k];
}

// The parts of a contact piece where the force is not clamped: depth > lag * velocity. Tips that go in are
// always ahead of the solid.
template <typename Model>
void CellQuadrature::add_active(const double* p, const Motion::Polynomial& c, const Piece& piece,
                                Sum<Model>& sum) const {
  if (piece.d_begin > piece.d_end) return add_contact<Model>(p, c, piece, sum);
  const double lag = Model::lag_s(p) * velocity_per_slope_;
  Motion::Polynomial pressure{};
  for (std::size_t k = 0; k < Motion::order; ++k)
    pressure[k] = -c[k] - (k + 1 < Motion::order ? lag * static_cast<double>(k + 1) * c[k + 1] : 0.0);
  pressure[0] += p[0];
  std::array<double, Motion::order> points;
  const std::size_t turns = turning_points(pressure, points);
  bool active = value_at(pressure, piece.begin) > 0.0;
  double begin = piece.begin, from = piece.begin;
  const auto add = [&](double to) {
    if (from < to) add_contact<Model>(p, c, {from, to, value_at(c, from), value_at(c, to)}, sum);
  };
  for (std::size_t i = 0; i <= turns; ++i) {
    const double end = i < turns ? std::min(points[i], piece.end) : piece.end;
    if (end <= begin) continue;
    if ((value_at(pressure, end) > 0.0) != active) {
      const double s = crossing(pressure, begin, end, 0.0, 1e-12);
      if (active) add(s);
      from = s;
      active = !active;
    }
    begin = end;
  }
  if (active) add(piece.end);
}

// Nodes crowd quadratically at the shallow end when it is at, or close to, the kink.
template <typename Model>
void CellQuadrature::add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece,
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
    const auto [d, slope] = value_and_slope_at(c, s);
    const double depth = std::max(p[0] - d, 0.0);
    add_node<0>(contact_of<Model>(p, depth, velocity_per_slope_ * slope), s, weight, sum);
  }
}

// Parts over which the distance to the pole at p0 - tail_length() grows by widest_ratio at most, each with as
// many nodes as its ratio asks for.
template <typename Model>
void CellQuadrature::add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece,
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
void CellQuadrature::add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece,
                               Sum<Model>& sum) const {
  constexpr bool tail = !Model::tail_terms.empty();
  const double surface = p[0];
  const auto contact = [&](const Piece& part) {
    if constexpr (DependsOnVelocity<Model>)
      add_active<Model>(p, c, part, sum);
    else
      add_contact<Model>(p, c, part, sum);
  };
  if (piece.d_begin <= surface && piece.d_end <= surface) {
    contact(piece);
  } else if (piece.d_begin >= surface && piece.d_end >= surface) {
    if constexpr (tail) add_tail<Model>(p, c, piece, sum);
  } else {
    const double s = crossing(c, piece.begin, piece.end, surface, 1e-12);
    const Piece before{piece.begin, s, piece.d_begin, surface};
    const Piece after{s, piece.end, surface, piece.d_end};
    contact(piece.d_begin < surface ? before : after);
    if constexpr (tail) add_tail<Model>(p, c, piece.d_begin < surface ? after : before, sum);
  }
}

// Cells whose distance to the pole varies by less than the widest ratio take one rule as they are.
template <typename Model>
void CellQuadrature::add_cell(const double* p, const Motion::Polynomial& c, Sum<Model>& sum) const {
  const double reach = spread(c);
  if (c[0] - reach > p[0]) {
    if constexpr (Model::tail_terms.empty()) {
      return;
    } else {
      const double pole = p[0] - Model::tail_length(p);
      const double ratio = (c[0] + reach - pole) / (c[0] - reach - pole);
      if (ratio < widest_ratio) {
        const GaussRule& rule = rules_[tail_nodes(ratio) + 2];
        for (std::size_t j = 0; j < rule.nodes.size(); ++j) {
          const double s = 2.0 * rule.nodes[j] - 1.0;
          add_node<Model::contact_terms.size()>(Model::tail(p, value_at(c, s) - p[0]), s,
                                                2.0 * rule.weights[j], sum);
        }
        return;
      }
    }
  }
  std::array<double, Motion::order> points;
  const std::size_t turns = turning_points(c, points);
  Piece piece{-1.0, -1.0, 0.0, value_at(c, -1.0)};
  for (std::size_t i = 0; i <= turns; ++i) {
    piece = {piece.end, i < turns ? points[i] : 1.0, piece.d_end, 0.0};
    piece.d_end = value_at(c, piece.end);
    if (piece.end > piece.begin) add_piece<Model>(p, c, piece, sum);
  }
}

}  // namespace combforce
