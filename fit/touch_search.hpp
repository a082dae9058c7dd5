// Minima of the error E where the model's force depends on history.
//
// As the surface rises through a lower turning point of the motion one more cycle touches, and is held on its
// way out; as it sinks from an upper one, a cycle is let go sooner. The model's phasors jump there, and so
// does E, every 0.1 nm or so of four tones. Derivatives between jumps do not know of them, so a solver ends
// at the next one. Hence E, least over the other parameters, is looked at once between every two jumps.
#pragma once

#include <ceres/tiny_solver.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "fit/force_balance.hpp"
#include "fit/force_model.hpp"
#include "fit/residuals.hpp"

namespace combforce {

// Of a model that DependsOnHistory. Thread-bound. Only the constructor allocates.
template <typename Model>
class TouchSearch {
 public:
  using Parameters = std::array<double, Model::parameters>;
  using Solver = ceres::TinySolver<Residuals<Model>>;
  static constexpr std::size_t most = 4;  // places

  // `balance` outlives the search.
  explicit TouchSearch(ForceBalance& balance) : balance_(&balance) {
    jumps_.reserve(2 * balance.motion().highest_harmonic() + 2);
  }

  // For the motion, forces and bounds that balance and residuals hold: writes the best places between jumps
  // no farther than `reach` from p's surface, best first; returns how many. `solver` is one that has been
  // used: it keeps its workspace.
  std::size_t search(Residuals<Model>& residuals, Solver& solver, const Parameters& p, double reach,
                     std::span<Parameters, most> places) {
    residuals_ = &residuals;
    solver_ = &solver;
    find_jumps(p, p[0] - reach, p[0] + reach);
    const std::size_t stride = jumps_.size() / most_steps + 1;
    std::array<Place, most> best;
    for (const bool up : {false, true}) {
      Parameters from = p;
      for (std::size_t n = 0; n + 1 < jumps_.size(); n += stride) {
        const std::size_t i = up ? n : jumps_.size() - 2 - n;
        const double middle = 0.5 * (jumps_[i] + jumps_[i + 1]);
        if (up ? middle < p[0] : middle > p[0]) continue;
        const Place place = least_at(middle, from);
        from = place.p;
        keep(place, best);
      }
    }
    residuals_->release();
    std::size_t found = 0;
    for (const Place& place : best)
      if (place.error < std::numeric_limits<double>::infinity()) places[found++] = place.p;
    return found;
  }

 private:
  struct Place {
    Parameters p{};
    double error = std::numeric_limits<double>::infinity();
  };

  static constexpr std::size_t most_steps = 40;

  // Surface positions between `low` and `high` where E jumps as the surface moves, ascending.
  void find_jumps(const Parameters& p, double low, double high) {
    const double release = Model::release_height_nm(p.data());
    jumps_.clear();
    balance_->prepare(high + release, 0, false);
    balance_->add_turning_points(ForceBalance::Turning::upper, low + release, high + release, jumps_);
    for (double& jump : jumps_) jump -= release;
    balance_->add_turning_points(ForceBalance::Turning::lower, low, high, jumps_);
    std::ranges::sort(jumps_);
  }

  // Least error with the surface there, from the other parameters of p.
  Place least_at(double p0, Parameters p) {
    p[0] = p0;
    residuals_->hold_surface(p0);
    balance_->prepare(contact_top_nm<Model>(p.data()), 0, false);
    residuals_->invalidate();
    auto x = residuals_->coordinates(p);
    solver_->options.max_num_iterations = 3;
    solver_->options.parameter_tolerance = 1e-3;
    solver_->options.function_tolerance = 1e-2 * residuals_->squared_norm(x);
    solver_->options.gradient_tolerance = solver_->options.cost_threshold = 0.0;
    solver_->options.initial_trust_region_radius = 1e6;
    solver_->Solve(*residuals_, &x);
    return {residuals_->parameters(x), residuals_->squared_norm(x)};
  }

  static void keep(const Place& place, std::array<Place, most>& best) {
    const auto at = std::ranges::find_if(best, [&](const Place& other) { return place.error < other.error; });
    if (at == best.end()) return;
    std::move_backward(at, best.end() - 1, best.end());
    *at = place;
  }

  ForceBalance* balance_;
  Residuals<Model>* residuals_ = nullptr;
  Solver* solver_ = nullptr;
  std::vector<double> jumps_;
};

}  // namespace combforce
