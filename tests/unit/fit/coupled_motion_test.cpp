// Motion off the comb that feels the force it changes, against the dense system of all harmonics, written
// from the couplings of ForceGradient.
#include "fit/coupled_motion.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <complex>
#include <vector>

#include "tests/support/failing_allocator.hpp"

namespace combforce::test {
namespace {

using Complex = std::complex<double>;

// Five products about one mode: 250 harmonics are coupled, of which the dense part holds 96.
struct Lever {
  Cantilever cantilever{{{70e3, 150.0, 2.0, 1.0}}};
  Comb comb;
  Harmonics harmonics;

  Lever() : comb(five()), harmonics(comb, cantilever, 2000.0) {}
  static Comb five() {
    Comb comb;
    comb.window_samples = 4000;
    for (std::uint64_t bin = 31; bin < 41; bin += 2) comb.tones.push_back({bin, true});
    return comb;
  }
};

// A contact of a tenth of the oscillation about harmonic 36, in beats of 18: mean 0.2 N/m, some N/m at the
// peak.
struct Contact {
  std::vector<Complex> by_surface, by_velocity;

  Contact(std::size_t band, bool viscous) : by_surface(band + 1), by_velocity(viscous ? band + 1 : 0) {
    for (std::size_t n = 0; n <= band; ++n) {
      const double of_cycle = static_cast<double>(n) / 36.0;
      const Complex value = 0.4 * std::exp(-0.1 * of_cycle * of_cycle) * std::polar(1.0, 0.3 * of_cycle) *
                            (n % 36 == 0 || n % 36 == 2 || n % 36 == 34 ? 1.0 : 0.0);
      by_surface[n] = n == 0 ? 0.2 : value;
      if (viscous) by_velocity[n] = -1e-7 * (n == 0 ? 0.2 : value);
    }
  }
};

// (1 - chi G) o = r of all harmonics off the comb below `count`.
std::vector<Complex> dense(const Harmonics& harmonics, const ForceGradient& gradient,
                           const std::vector<Complex>& right, std::size_t count) {
  const auto size = static_cast<Eigen::Index>(2 * count);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(size);
  for (std::size_t n = 0; n < count; ++n) {
    if (harmonics.is_tone(n)) continue;
    const auto row = static_cast<Eigen::Index>(2 * n);
    values(row) = right[n].real();
    values(row + 1) = n == 0 ? 0.0 : right[n].imag();
    for (std::size_t m = 0; m < count; ++m) {
      if (harmonics.is_tone(m)) continue;
      const auto [re, im] = gradient.coupling(n, m);
      const Complex x = harmonics.response()[n] * re, y = harmonics.response()[n] * im;
      const auto column = static_cast<Eigen::Index>(2 * m);
      matrix(row, column) -= x.real();
      matrix(row, column + 1) -= y.real();
      if (n == 0) continue;
      matrix(row + 1, column) -= x.imag();
      matrix(row + 1, column + 1) -= y.imag();
    }
  }
  const Eigen::VectorXd solved = matrix.partialPivLu().solve(values);
  std::vector<Complex> motion(right.size());
  for (std::size_t n = 0; n < count; ++n)
    motion[n] = {solved(static_cast<Eigen::Index>(2 * n)), solved(static_cast<Eigen::Index>(2 * n + 1))};
  return motion;
}

std::vector<Complex> some_motion(const Harmonics& harmonics) {
  std::vector<Complex> motion(harmonics.band() + 1);
  for (std::size_t n = 0; n < motion.size(); n += 2)
    motion[n] = std::abs(harmonics.response()[n]) * std::polar(1.0, 0.7 * static_cast<double>(n));
  motion[0] = motion[0].real();
  for (const std::size_t tone : harmonics.tones()) motion[tone] = 0.0;
  return motion;
}

double norm(const std::vector<Complex>& motion) {
  double sum = 0.0;
  for (const Complex value : motion) sum += std::norm(value);
  return std::sqrt(sum);
}

double distance(const std::vector<Complex>& one, const std::vector<Complex>& other) {
  double sum = 0.0, of = 0.0;
  for (std::size_t n = 0; n < one.size(); ++n) {
    sum += std::norm(one[n] - other[n]);
    of += std::norm(other[n]);
  }
  return std::sqrt(sum / of);
}

class CoupledMotionOf : public testing::TestWithParam<bool> {};  // whether the contact is viscous

// The last harmonic whose |chi| is at least 2 % of the static compliance.
std::size_t last_coupled(const Harmonics& harmonics) {
  std::size_t last = 0;
  for (std::size_t n = 0; n <= harmonics.band(); ++n)
    if (std::abs(harmonics.response()[n]) >= 0.02 * std::abs(harmonics.response()[0])) last = n;
  return last;
}

// GMRES stops where 1e-6 is left of the right side, which the system makes larger by less than ten.
TEST_P(CoupledMotionOf, AllHarmonicsIsThatOfTheDenseSystem) {
  const Lever lever;
  const Contact contact(lever.harmonics.band(), GetParam());
  const ForceGradient gradient{contact.by_surface, contact.by_velocity, lever.harmonics.angular_frequency(1)};
  const std::size_t count = last_coupled(lever.harmonics) + 1;
  std::vector<Complex> right = some_motion(lever.harmonics);
  std::fill(right.begin() + static_cast<std::ptrdiff_t>(count), right.end(), 0.0);
  const std::vector<Complex> expected = dense(lever.harmonics, gradient, right, count);
  ASSERT_GT(distance(expected, right), 0.3);  // the contact matters
  CoupledMotion coupled(lever.harmonics);
  coupled.set_gradient(gradient);
  std::vector<Complex> solved = right;
  const double left = coupled.solve(solved, 1e-6);
  EXPECT_LT(left, 1e-6 * norm(right));
  EXPECT_LT(distance(solved, expected), 1e-5);
  for (const std::size_t tone : lever.harmonics.tones()) EXPECT_EQ(solved[tone], 0.0);
}

// The force, and what it moves, harmonic by harmonic.
TEST_P(CoupledMotionOf, ForcesAreThoseOfTheCouplings) {
  const Lever lever;
  const Contact contact(lever.harmonics.band(), GetParam());
  const ForceGradient gradient{contact.by_surface, contact.by_velocity, lever.harmonics.angular_frequency(1)};
  CoupledMotion coupled(lever.harmonics);
  coupled.set_gradient(gradient);
  for (const std::size_t m : {std::size_t{0}, std::size_t{6}, std::size_t{35}, std::size_t{72}}) {
    const Complex one(0.8, m == 0 ? 0.0 : -0.6);
    std::vector<Complex> motion(lever.harmonics.band() + 1);
    motion[m] = one;
    std::vector<Complex> forces(lever.harmonics.tones().size());
    coupled.force(motion, forces);
    coupled.respond(motion);
    const auto force_at = [&](std::size_t n) {
      const auto [re, im] = gradient.coupling(n, m);
      return n == 0 ? Complex((re * one.real() + im * one.imag()).real()) : re * one.real() + im * one.imag();
    };
    for (std::size_t i = 0; i < forces.size(); ++i)
      EXPECT_LT(std::abs(forces[i] - force_at(lever.harmonics.tones()[i])), 1e-12) << m << " to tone " << i;
    for (const std::size_t n : {std::size_t{0}, std::size_t{4}, std::size_t{36}, std::size_t{70}})
      EXPECT_LT(std::abs(motion[n] - lever.harmonics.response()[n] * force_at(n)), 1e-11) << m << " to " << n;
    EXPECT_EQ(motion[lever.harmonics.tones()[0]], 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Contacts, CoupledMotionOf, testing::Bool());

TEST(CoupledMotion, DoesNotAllocate) {
  COMBFORCE_SKIP_UNLESS_ALLOCATIONS_COUNT();
  const Lever lever;
  const Contact contact(lever.harmonics.band(), true);
  CoupledMotion coupled(lever.harmonics);
  std::vector<Complex> motion = some_motion(lever.harmonics), forces(lever.harmonics.tones().size());
  std::size_t allocations = 0;
  {
    const ForbidAllocation guard;
    coupled.set_gradient({contact.by_surface, contact.by_velocity, lever.harmonics.angular_frequency(1)});
    coupled.solve(motion, 1e-6);
    coupled.force(motion, forces);
    coupled.respond(motion);
    allocations = guard.calls();
  }
  EXPECT_EQ(allocations, 0U);
}

}  // namespace
}  // namespace combforce::test
