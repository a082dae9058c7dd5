#include "fit/quadrature.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace combforce {
namespace {

constexpr std::size_t slope_order = Motion::order - 1;  // coefficients of a slope
using Bernstein = std::array<double, slope_order>;

constexpr double binomial(std::size_t n, std::size_t k) {
  double result = 1.0;
  for (std::size_t j = 1; j <= k; ++j)
    result = result * static_cast<double>(n - k + j) / static_cast<double>(j);
  return result;
}

// Bernstein coefficients over [-1, 1] of s^k, by rows: s^k = sum_j table[k][j] B_j. From s = 2u - 1 and
// u^m = sum_j C(j, m)/C(n, m) B_j(u).
constexpr std::array<Bernstein, slope_order> bernstein_table() {
  constexpr std::size_t n = slope_order - 1;
  std::array<Bernstein, slope_order> table{};
  for (std::size_t k = 0; k <= n; ++k)
    for (std::size_t j = 0; j <= n; ++j)
      for (std::size_t m = 0, power = 1; m <= k; ++m, power *= 2) {
        const double sign = (k - m) % 2 == 0 ? 1.0 : -1.0;
        if (m <= j)
          table[k][j] += sign * binomial(k, m) * static_cast<double>(power) * binomial(j, m) / binomial(n, m);
      }
  return table;
}
constexpr std::array<Bernstein, slope_order> table = bernstein_table();

std::size_t sign_changes(const Bernstein& b) {
  std::size_t changes = 0;
  double last = 0.0;
  for (const double value : b) {
    if (value == 0.0) continue;
    if (last * value < 0.0) ++changes;
    last = value;
  }
  return changes;
}

// De Casteljau at the middle: `b` becomes its left half; returns the right one.
Bernstein halve(Bernstein& b) {
  Bernstein right;
  for (std::size_t level = 0; level < slope_order; ++level) {
    right[slope_order - 1 - level] = b[slope_order - 1];
    for (std::size_t j = slope_order - 1; j > level; --j) b[j] = 0.5 * (b[j - 1] + b[j]);
  }
  return right;
}

double slope_at(const Motion::Polynomial& c, double s) {
  return value_and_slope_at(c, s).second;
}

double slope_root(const Motion::Polynomial& c, double a, double b) {
  const bool rising = slope_at(c, a) < 0.0;
  while (b - a > 1e-9) {  // off by that, d is off by its square
    const double middle = 0.5 * (a + b);
    ((slope_at(c, middle) < 0.0) == rising ? a : b) = middle;
  }
  return 0.5 * (a + b);
}

struct Search {
  const Motion::Polynomial& c;
  std::span<double, Motion::order> points;
  std::size_t count = 0;

  void run(Bernstein b, double left, double right, int depth) {
    const std::size_t changes = sign_changes(b);
    if (changes == 0 || count == points.size()) return;
    if (changes == 1) {
      points[count++] = slope_root(c, left, right);
      return;
    }
    if (depth == 20) return;
    const Bernstein upper = halve(b);
    const double middle = 0.5 * (left + right);
    run(b, left, middle, depth + 1);
    run(upper, middle, right, depth + 1);
  }
};

}  // namespace

GaussRule gauss_legendre(std::size_t n) {
  GaussRule rule{std::vector<double>(n), std::vector<double>(n)};
  const auto degree = static_cast<double>(n);
  for (std::size_t i = 0; i < n; ++i) {
    double x = std::cos(std::numbers::pi * (static_cast<double>(n - i) - 0.25) / (degree + 0.5));
    double slope = 0.0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      double p = 1.0, before = 0.0;
      for (std::size_t k = 1; k <= n; ++k) {
        const auto j = static_cast<double>(k);
        const double next = ((2.0 * j - 1.0) * x * p - (j - 1.0) * before) / j;
        before = p;
        p = next;
      }
      slope = degree * (x * p - before) / (x * x - 1.0);
      x -= p / slope;
    }
    rule.nodes[i] = 0.5 * (x + 1.0);
    rule.weights[i] = 1.0 / ((1.0 - x * x) * slope * slope);
  }
  return rule;
}

std::size_t turning_points(const Motion::Polynomial& c, std::span<double, Motion::order> points) {
  double rest = 0.0;
  for (std::size_t k = 2; k < Motion::order; ++k) rest += static_cast<double>(k) * std::abs(c[k]);
  if (std::abs(c[1]) > rest) return 0;
  Bernstein b{};
  for (std::size_t k = 0; k < slope_order; ++k)
    for (std::size_t j = 0; j < slope_order; ++j) b[j] += static_cast<double>(k + 1) * c[k + 1] * table[k][j];
  Search search{c, points};
  search.run(b, -1.0, 1.0, 0);
  return search.count;
}

double crossing(const Motion::Polynomial& c, double a, double b, double value, double tolerance) {
  const double at_a = value_at(c, a), at_b = value_at(c, b);
  const bool rising = at_a < at_b;
  double s = at_a == at_b ? a : a + (b - a) * std::clamp((value - at_a) / (at_b - at_a), 0.0, 1.0);
  for (int i = 0; i < 60 && b - a > 1e-15; ++i) {
    const auto [d, slope] = value_and_slope_at(c, s);
    if (std::abs(d - value) <= tolerance) break;
    ((d < value) == rising ? a : b) = s;
    const double newton = s - (d - value) / slope;
    s = newton > a && newton < b ? newton : 0.5 * (a + b);
  }
  return s;
}

}  // namespace combforce
