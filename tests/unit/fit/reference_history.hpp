// Phasors of forces that depend on history, another way than fit/ goes: contact is followed through two
// periods of the motion from crossing to crossing, found by bisection, and the forces are the textbooks'
// formulas with JKR's contact radius by bisection.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "tests/unit/fit/paper_cantilever.hpp"
#include "tests/unit/fit/reference_force.hpp"

namespace combforce::test {

struct HistoryForce {
  double surface_nm, release_nm;          // deflections where contact forms, and where it is lost
  std::function<double(double)> engaged;  // nN at a deflection
};

HistoryForce jkr_force(std::span<const double> p);
HistoryForce capillary_force(std::span<const double> p);

struct Engagement {
  double begin, end;  // periods: begin < 1, end may lie in the next one
};
// A tip that is not in contact when it starts, far away in time.
std::vector<Engagement> engagements(const ReferenceMotion& motion, const HistoryForce& force);

Phasors history_phasors(const ReferenceMotion& motion, const HistoryForce& force, double tolerance = 1e-8);

// By nothing but samples of d at equal distances in time, each the middle of its share of the period.
Phasors sampled_phasors(const ReferenceMotion& motion, std::span<const std::uint64_t> harmonics,
                        const HistoryForce& force, std::size_t samples);

// Work that the surface takes in a period along a motion that it lets go as often as it holds it, nN nm: what
// lies between the branches, each time.
double work_nn_nm(const ReferenceMotion& motion, const HistoryForce& force);

}  // namespace combforce::test
