#include "tests/unit/fit/reference_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace combforce::test {
namespace {

// Of JKR's contact radius over sqrt(R), from where contact is lost upwards.
double contact_radius(double depth_nm, double p1, double p2) {
  const auto depth = [&](double s) { return s * s - 4.0 / 3.0 * std::sqrt(p2 * s / p1); };
  double low = std::cbrt(p2 / (9.0 * p1)), high = 2.0 * low + 2.0 * std::sqrt(std::max(depth_nm, 1.0));
  while (depth(high) < depth_nm) high *= 2.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (depth(middle) < depth_nm ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

// w and E* at R = 1 nm give the release its textbook form, -3/4 (pi^2 w^2 R/E*^2)^(1/3).
HistoryForce jkr_force(std::span<const double> p) {
  const double p1 = p[1], p2 = p[2], surface = p[0];
  const double work = 2.0 * p2 / (3.0 * std::numbers::pi), modulus = 0.75 * p1;
  const double release = 0.75 * std::cbrt(std::pow(std::numbers::pi * work / modulus, 2));
  return {surface, surface + release, [=](double d) {
            const double cube = std::pow(contact_radius(surface - d, p1, p2), 3);
            return p1 * cube - 2.0 * std::sqrt(p1 * p2 * cube);
          }};
}

HistoryForce capillary_force(std::span<const double> p) {
  const std::vector<double> q(p.begin(), p.end());
  return {q[0], q[0] + q[4], [q](double d) {
            const double z = d - q[0];
            if (z <= 0.0) return q[1] * std::pow(-z, 1.5) - q[2];
            return -q[2] * (1.0 - z / std::hypot(z, q[3]));
          }};
}

std::vector<Engagement> engagements(const ReferenceMotion& motion, const HistoryForce& force) {
  struct Event {
    double time;
    bool engages;
  };
  std::vector<Event> events;
  for (const double t : motion.crossings(force.surface_nm))
    if (motion.slope(t) < 0.0) events.push_back({t, true});
  for (const double t : motion.crossings(force.release_nm))
    if (motion.slope(t) > 0.0) events.push_back({t, false});
  std::ranges::sort(events, {}, &Event::time);
  const std::size_t count = events.size();
  for (std::size_t i = 0; i < count; ++i) events.push_back({events[i].time + 1.0, events[i].engages});
  std::vector<Engagement> found;
  bool engaged = false;
  double since = 0.0;
  for (const Event& event : events) {
    if (event.engages == engaged) continue;
    engaged = event.engages;
    if (engaged) since = event.time;
    // The first period only finds the state at its end: what begins there ends in it or in the next one.
    if (!engaged && since < 1.0) found.push_back({since, event.time});
  }
  if (engaged && since < 1.0) found.push_back({since, since + 1.0});
  return found;
}

Phasors history_phasors(const ReferenceMotion& motion, const HistoryForce& force, double tolerance) {
  Eigen::VectorXd sum;
  const std::vector<ReferenceMotion::Edge> edges{
      [&](double d, double /*velocity*/) { return d - force.surface_nm; }};
  const auto value = [&](double d, double /*velocity*/, std::span<double> values) {
    values[0] = force.engaged(std::min(d, force.release_nm));
  };
  const auto add = [&](double begin, double end) {
    const Eigen::MatrixXd part = motion.integrate_between(begin, end, edges, 1, value, tolerance);
    sum = sum.size() == 0 ? Eigen::VectorXd(part.col(0)) : Eigen::VectorXd(sum + part.col(0));
  };
  add(0.0, 0.0);
  for (const Engagement& one : engagements(motion, force)) {
    add(one.begin, std::min(one.end, 1.0));
    if (one.end > 1.0) add(0.0, one.end - 1.0);
  }
  Phasors phasors;
  for (Eigen::Index row = 0; row < sum.size(); row += 2) phasors.emplace_back(sum(row), sum(row + 1));
  return phasors;
}

Phasors sampled_phasors(const ReferenceMotion& motion, std::span<const std::uint64_t> harmonics,
                        const HistoryForce& force, std::size_t samples) {
  Phasors phasors(harmonics.size());
  bool engaged = false;
  for (std::size_t n = 0; n < 2 * samples; ++n) {
    const double t = (static_cast<double>(n % samples) + 0.5) / static_cast<double>(samples);
    const double d = motion.at(t);
    engaged = d < force.surface_nm || (engaged && d < force.release_nm);
    if (n < samples || !engaged) continue;
    for (std::size_t i = 0; i < harmonics.size(); ++i)
      phasors[i] += 2.0 / static_cast<double>(samples) * force.engaged(d) *
                    std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(harmonics[i]) * t);
  }
  return phasors;
}

double work_nn_nm(const ReferenceMotion& motion, const HistoryForce& force) {
  constexpr int steps = 100'000;
  double area = 0.0;
  for (int i = 0; i < steps; ++i)
    area -= force.engaged(std::lerp(force.surface_nm, force.release_nm, (i + 0.5) / steps)) / steps;
  return area * (force.release_nm - force.surface_nm) *
         static_cast<double>(engagements(motion, force).size());
}

}  // namespace combforce::test
