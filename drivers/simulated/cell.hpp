// One time step ("cell") of the simulator: the free motion of every state is propagated exactly, the
// tip-surface force is a quartic through its values at the five Gauss-Lobatto nodes of the cell, and its
// effect on every mode is the exact integral of that quartic against the mode's response (exponential time
// differencing; Hochbruck, Ostermann, Acta Numerica 2010, with collocation at Lobatto nodes).
//
// A state is a complex number z with z' = lambda z, plus b F(t) for a mode:
// - a drive tone: z = exp(i w t), lambda = i w; it moves the tip by Re(D z);
// - a mode q'' + (w/Q) q' + w^2 q = (w^2/k) F: with g = w/(2Q), W = sqrt(w^2 - g^2), lambda = -g + i W and
//   b = -i w^2/(k W), q = Re z and q' = Re(lambda z).
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "fit/cantilever.hpp"

namespace combforce {

inline constexpr std::size_t cell_nodes = 5;  // the first at the start of the cell, the last at its end

// The nodes on [0, 1].
extern const std::array<double, cell_nodes> cell_node;

struct ModeDynamics {
  std::complex<double> lambda;    // 1/s
  std::complex<double> coupling;  // b, nm/(nN s)
};

// Throws std::invalid_argument for a mode that is not underdamped (Q > 1/2).
ModeDynamics mode_dynamics(const Mode& mode);

// All states of the motion, tones first, and how each moves the tip: d = sum Re(weight z).
struct StateDynamics {
  std::vector<std::complex<double>> lambda;
  std::vector<std::complex<double>> weight;    // D of a tone (nm), 1 for a mode
  std::vector<std::complex<double>> coupling;  // b of the modes alone
  std::size_t states() const { return lambda.size(); }
  std::size_t modes() const { return coupling.size(); }
  std::size_t tones() const { return states() - modes(); }
};

// Coefficients for cells of one length.
struct CellTable {
  CellTable(const StateDynamics& dynamics, double cell_seconds);
  // Renewed when the weights (the drive) change.
  void set_weights(const StateDynamics& dynamics);

  double seconds;
  using Later = std::array<double, cell_nodes - 1>;  // one value a node but the first
  // Tip at the later nodes without force: sum over states of re * Re z + im * Im z.
  std::vector<Later> tip_re, tip_im;
  // Tip at the later nodes per force at each node, nm/nN; `steady`: per force constant over the cell.
  std::array<Later, cell_nodes> tip_per_force{};
  Later tip_per_steady_force{};
  double greatest_tip_per_force = 0.0;
  // States at the end: propagation, and for the modes per force at each node.
  std::vector<double> propagate_re, propagate_im;
  std::vector<std::array<double, cell_nodes>> force_re, force_im;
};

// Coefficients for cells of any length h with |lambda| h <= `short_cell_limit`, by power series in h.
struct ShortCell {
  explicit ShortCell(const StateDynamics& dynamics);
  void set_weights(const StateDynamics& dynamics);

  static constexpr std::size_t order = 7;
  // The tip without force is sum_k h^k sum over states of re[k] * Re z + im[k] * Im z.
  std::array<std::vector<double>, order + 1> taylor_re, taylor_im;
  double acceleration =
      0.0;  // sum w^2/k, nm/(s^2 nN): the tip moves by acceleration * h^2 * tip_per_force[l][j] F_l
  std::array<std::array<double, cell_nodes - 1>, cell_nodes> tip_per_force{};
  // moment[k][l] = integral over [0, 1] of (1-s)^k/k! times the Lagrange polynomial of node l.
  static constexpr std::size_t moments = 5;
  std::array<std::array<double, cell_nodes>, moments> moment{};
};

// The errors of the series, (limit)^8/8! of an amplitude and (limit)^5/6! of a force's effect, are below
// 1e-6.
inline constexpr double short_cell_limit = 0.2;

}  // namespace combforce
