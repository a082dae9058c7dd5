#include "daemon/cli/paper/grid_fit.hpp"

#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>

#include <algorithm>
#include <numeric>

#include "dsp/comb.hpp"
#include "fit/model_list.hpp"

namespace combforce::paper {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

// What Eigen's MINPACK asks of a function.
template <typename Model>
struct Residuals {
  using Scalar = double;
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };

  const Eigen::VectorXd& d_nm;
  const Eigen::MatrixXd& turn;
  const Eigen::VectorXd& measured_nn;

  Index values() const { return measured_nn.size(); }
  int operator()(const InputType& p, ValueType& residuals) const {
    residuals = -measured_nn;
    for (Index n = 0; n < d_nm.size(); ++n) {
      if (Model::tail_terms.empty() && d_nm(n) > p(0)) break;
      residuals.noalias() +=
          force_of<Model>(p.data(), d_nm(n), 0.0) * turn.col(n);  // the paper's know no velocity
    }
    return 0;
  }
};

}  // namespace

GridProblem::GridProblem(const CaseMotion& motion, std::span<const Complex> tip_nm, double displacement)
    : of_(motion.of) {
  std::uint64_t periods = window_samples;
  for (const std::uint64_t bin : of_->bins) periods = std::gcd(periods, bin);
  const std::uint64_t samples = window_samples / periods;
  const std::size_t tones = of_->bins.size();
  std::vector<std::vector<Complex>> turns(tones, std::vector<Complex>(samples));
  std::vector<Complex> displaced;
  for (const std::uint64_t bin : of_->bins)
    displaced.push_back(std::polar(1.0, -displacement * phase_radians(bin, window_samples)));
  std::vector<std::pair<double, std::size_t>> order(samples);  // (d, sample)
  for (std::size_t n = 0; n < samples; ++n) {
    order[n].second = n;
    for (std::size_t i = 0; i < tones; ++i) {
      turns[i][n] =
          displaced[i] *
          std::polar(1.0, -phase_radians(phase_index(of_->bins[i], n, window_samples), window_samples));
      order[n].first += (tip_nm[i] * std::conj(turns[i][n])).real();
    }
  }
  std::ranges::sort(order);
  d_nm_.resize(static_cast<Index>(samples));
  turn_.resize(static_cast<Index>(2 * tones), static_cast<Index>(samples));
  measured_nn_.resize(static_cast<Index>(2 * tones));
  for (std::size_t n = 0; n < samples; ++n) {
    const auto column = static_cast<Index>(n);
    d_nm_(column) = order[n].first;
    for (std::size_t i = 0; i < tones; ++i) {
      const Complex turn = 2.0 / static_cast<double>(samples) * turns[i][order[n].second];
      turn_(static_cast<Index>(2 * i), column) = turn.real();
      turn_(static_cast<Index>(2 * i + 1), column) = turn.imag();
    }
  }
  for (std::size_t i = 0; i < tones; ++i) {
    const std::uint64_t bin = of_->bins[i];
    const auto row = static_cast<Index>(2 * i);
    const Complex force =
        (tip_nm[i] - motion.free_nm[i]) / tip_response(cantilever(), delta_f_hz * static_cast<double>(bin));
    measured_nn_(row) = force.real();
    measured_nn_(row + 1) = force.imag();
  }
}

GridFit GridProblem::fit(std::span<const double> start) const {
  return visit_model<Models>(find_model(of_->model), [&](auto model) {
    Residuals<decltype(model)> residuals{d_nm_, turn_, measured_nn_};
    Eigen::VectorXd p = Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Index>(start.size()));
    Index evaluations = 0;
    // Its default tolerance, the square root of the machine's precision, is leastsq's; so is its limit of
    // evaluations.
    const auto status =
        Eigen::LevenbergMarquardt<Residuals<decltype(model)>>::lmdif1(residuals, p, &evaluations);
    const bool converged = status >= Eigen::LevenbergMarquardtSpace::RelativeReductionTooSmall &&
                           status <= Eigen::LevenbergMarquardtSpace::CosinusTooSmall && p.allFinite();
    return GridFit{converged, {p.data(), p.data() + p.size()}};
  });
}

}  // namespace combforce::paper
