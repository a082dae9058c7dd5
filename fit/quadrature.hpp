// Gauss-Legendre rules, the ladder of refinements, and what a quadrature needs of polynomials: turning points
// and crossings.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "fit/motion.hpp"

namespace combforce {

// Nodes and weights for the integral over [0, 1]; exact for polynomials up to degree 2n - 1.
struct GaussRule {
  std::vector<double> nodes, weights;
};

// n >= 1. Nodes are roots of the Legendre polynomial, by Newton's method.
GaussRule gauss_legendre(std::size_t n);

// Points in the open interval (-1, 1) where the slope of a cell's polynomial changes sign, ascending; returns
// how many (at most Motion::order - 2). None is missed: intervals are halved until the Bernstein coefficients
// of the slope change sign at most once (Descartes' rule), down to 2^-20 of the cell.
std::size_t turning_points(const Motion::Polynomial& c, std::span<double, Motion::order> points);

// Where the polynomial, monotone over [a, b], takes a value between those at the ends: by Newton's method
// inside a shrinking bracket, until it is within `tolerance` of it or the bracket is exhausted.
double crossing(const Motion::Polynomial& c, double a, double b, double value, double tolerance);

}  // namespace combforce
