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

  // Adds the moments of a unit of each linear parameter over a piece of the cell with polynomial `c`; where
  // the force depends on history, of a tip that is engaged throughout.
  template <typename Model>
  void add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;

  // The same of a model whose force depends on history, for a tip that is `engaged` or not at the piece's
  // begin; returns whether it is at its end. Where contact forms and is lost the force jumps: as these
  // moments move with the parameters, that belongs to the derivatives of the integral, which get a node
  // there.
  template <DependsOnHistory Model>
  bool add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, bool engaged,
                 Sum<Model>& sum) const;

  // The same of other models over a whole cell, s from -1 to 1.
  template <typename Model>
  void add_cell(const double* p, const Motion::Polynomial& c, Sum<Model>& sum) const;

 private:
  template <typename Model>
  void add_tail(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <typename Model>
  void add_active(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <DependsOnHistory Model>
  void add_neck(const double* p, const Motion::Polynomial& c, const Piece& piece, Sum<Model>& sum) const;
  template <DependsOnHistory Model, std::size_t First, std::size_t Terms>
  static void add_switch(const std::array<ModelTerm, Terms>& terms, const std::array<double, Terms>& values,
                         const std::array<double, Model::parameters>& moves, double s, Sum<Model>& sum);
  template <typename Function>
  void for_nodes_from_top(const Piece& piece, bool crowd, const Function& function) const;
  template <std::size_t First, std::size_t Terms, typename SumOfModel>
  static void add_node(const std::array<double, Terms>& values, double s, double weight, SumOfModel& sum);

  static constexpr std::array<std::size_t, levels> contact_nodes{6, 9, 13, 18, 24};
  static constexpr double widest_ratio = 4.0;
  static constexpr std::array<double, 4> tail_ratios{1.3, 1.7, 2.4, widest_ratio};
  static constexpr std::array<std::array<std::size_t, tail_ratios.size()>, levels> tail_nodes_of_ratio{
      {{3, 4, 5, 6}, {5, 6, 7, 9}, {7, 9, 10, 13}, {9, 12, 14, 18}, {12, 16, 19, 24}}};
  static constexpr std::size_t most_nodes = 26;
  static constexpr double least_slope = 1e-6;  // nm in a cell, where contact forms or is lost

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

// Calls function(s, weight) for the nodes of a piece, which may crowd quadratically at its upper end.
template <typename Function>
void CellQuadrature::for_nodes_from_top(const Piece& piece, bool crowd, const Function& function) const {
  const bool falling = piece.d_begin > piece.d_end;
  const double top = falling ? piece.begin : piece.end;
  const double length = falling ? piece.end - piece.begin : piece.begin - piece.end;
  const GaussRule& rule = rules_[contact_nodes[level_]];
  for (std::size_t j = 0; j < rule.nodes.size(); ++j) {
    const double u = rule.nodes[j];
    function(top + length * (crowd ? u * u : u),
             std::abs(length) * rule.weights[j] * (crowd ? 2.0 * u : 1.0));
  }
}

// Nodes crowd at the shallow end when it is at, or close to, the kink.
template <typename Model>
void CellQuadrature::add_contact(const double* p, const Motion::Polynomial& c, const Piece& piece,
                                 Sum<Model>& sum) const {
  const double shallow_depth = p[0] - std::max(piece.d_begin, piece.d_end);
  const double deep_depth = p[0] - std::min(piece.d_begin, piece.d_end);
  for_nodes_from_top(piece, 3.0 * shallow_depth < deep_depth, [&](double s, double weight) {
    const auto [d, slope] = value_and_slope_at(c, s);
    const double depth = std::max(p[0] - d, 0.0);
    add_node<0>(contact_of<Model>(p, depth, velocity_per_slope_ * slope), s, weight, sum);
  });
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
  const double surface = p[0];
  const auto contact = [&](const Piece& part) {
    if constexpr (DependsOnVelocity<Model>)
      add_active<Model>(p, c, part, sum);
    else
      add_contact<Model>(p, c, part, sum);
  };
  const auto tail = [&]([[maybe_unused]] const Piece& part) {
    if constexpr (DependsOnHistory<Model>)
      add_neck<Model>(p, c, part, sum);
    else if constexpr (!Model::tail_terms.empty())
      add_tail<Model>(p, c, part, sum);
  };
  if (piece.d_begin <= surface && piece.d_end <= surface) {
    contact(piece);
  } else if (piece.d_begin >= surface && piece.d_end >= surface) {
    tail(piece);
  } else {
    const double s = crossing(c, piece.begin, piece.end, surface, 1e-12);
    const Piece before{piece.begin, s, piece.d_begin, surface};
    const Piece after{s, piece.end, surface, piece.d_end};
    contact(piece.d_begin < surface ? before : after);
    tail(piece.d_begin < surface ? after : before);
  }
}

// Tails of engaged tips: parts as in add_tail(), whose nodes crowd where contact is about to be lost.
template <DependsOnHistory Model>
void CellQuadrature::add_neck(const double* p, const Motion::Polynomial& c, const Piece& piece,
                              Sum<Model>& sum) const {
  const double release = Model::release_height_nm(p), pole = p[0] - Model::tail_length(p);
  const double from = piece.d_begin - pole, to = piece.d_end - pole;
  const double whole = std::max(from, to) / std::min(from, to);
  int parts = 1;
  for (double reach = widest_ratio; reach < whole; reach *= widest_ratio) ++parts;
  const double ratio = std::pow(to / from, 1.0 / parts);
  Piece part{piece.begin, piece.begin, piece.d_begin, piece.d_begin};
  for (int i = 1; i <= parts; ++i) {
    part.begin = part.end;
    part.d_begin = part.d_end;
    part.d_end = i == parts ? piece.d_end : pole + ratio * (part.d_begin - pole);
    part.end =
        i == parts ? piece.end : crossing(c, part.begin, piece.end, part.d_end, 1e-3 * (part.d_end - pole));
    const double near = p[0] + release - std::max(part.d_begin, part.d_end);
    const double far = p[0] + release - std::min(part.d_begin, part.d_end);
    for_nodes_from_top(part, 3.0 * near < far, [&](double s, double weight) {
      const double height = std::clamp(value_at(c, s) - p[0], 0.0, release);
      add_node<Model::contact_terms.size()>(Model::tail(p, height), s, weight, sum);
    });
  }
}

// One node at the end of an integral: `values` of the model's terms there, and how far each parameter `moves`
// it, in s per unit.
template <DependsOnHistory Model, std::size_t First, std::size_t Terms>
void CellQuadrature::add_switch(const std::array<ModelTerm, Terms>& terms,
                                const std::array<double, Terms>& values,
                                const std::array<double, Model::parameters>& moves, double s,
                                Sum<Model>& sum) {
  std::array<double, Terms> gains{};
  for (std::size_t t = 0; t < Terms; ++t)
    for (std::size_t of = 0; of < Terms; ++of)
      if (terms[t].derivative != value_of_term && terms[of].derivative == value_of_term &&
          terms[of].linear == terms[t].linear)
        gains[t] = values[of] * moves[terms[t].derivative];
  add_node<First>(gains, s, 1.0, sum);
}

template <DependsOnHistory Model>
bool CellQuadrature::add_piece(const double* p, const Motion::Polynomial& c, const Piece& piece, bool engaged,
                               Sum<Model>& sum) const {
  const double surface = p[0], release = contact_top_nm<Model>(p);
  // A turning point at the switch has no slope: there the integral jumps.
  const auto slope_at = [&](double s) {
    const double slope = value_and_slope_at(c, s).second;
    return std::copysign(std::max(std::abs(slope), least_slope), slope);
  };
  const auto form = [&](double s) {
    std::array<double, Model::parameters> moves{-1.0 / slope_at(s)};
    add_switch<Model, 0>(Model::contact_terms, Model::contact(p, 0.0), moves, s, sum);
  };
  const auto lose = [&](double s) {
    std::array<double, Model::parameters> moves = Model::release_gradient(p);
    moves[0] = 1.0;
    for (double& move : moves) move /= slope_at(s);
    add_switch<Model, Model::contact_terms.size()>(
        Model::tail_terms, Model::tail(p, Model::release_height_nm(p)), moves, s, sum);
  };
  // What rounding hides between one piece and the next.
  if (engaged && piece.d_begin > release) {
    lose(piece.begin);
    engaged = false;
  } else if (!engaged && piece.d_begin < surface) {
    form(piece.begin);
    engaged = true;
  }
  Piece held = piece;
  if (!engaged) {
    if (!(piece.d_end < surface)) return false;
    held.begin = crossing(c, piece.begin, piece.end, surface, 1e-12);
    held.d_begin = surface;
    form(held.begin);
  }
  const bool lost = held.d_end > release;
  if (lost) {
    held.end = crossing(c, held.begin, piece.end, release, 1e-12);
    held.d_end = release;
    lose(held.end);
  }
  add_piece<Model>(p, c, held, sum);
  return !lost;
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
