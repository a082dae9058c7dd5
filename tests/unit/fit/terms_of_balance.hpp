// The force that a balance's terms add up to, and its derivatives.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "fit/force_balance.hpp"

namespace combforce::test {

// Columns F, dF/dp …; rows (re, im) of each tone, as the reference has it.
template <typename Model>
Eigen::MatrixXd terms_of_balance(const ForceBalance& balance, const std::vector<double>& p) {
  const auto tones = static_cast<Eigen::Index>(balance.motion().tones());
  Eigen::MatrixXcd terms(tones, static_cast<Eigen::Index>(ForceBalance::columns<Model>));
  balance.evaluate<Model>(p.data(), terms);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(2 * tones, 1 + Model::parameters);
  const auto add = [&](const auto& list, Eigen::Index first) {
    for (std::size_t j = 0; j < list.size(); ++j)
      for (Eigen::Index i = 0; i < tones; ++i) {
        const std::complex<double> term = terms(i, first + static_cast<Eigen::Index>(j));
        const Eigen::Vector2d parts(term.real(), term.imag());
        const auto [linear, derivative] = list[j];
        if (derivative == velocity_of_term) continue;
        if (derivative == value_of_term) {
          sum.block<2, 1>(2 * i, 0) += coefficient(p.data(), list[j]) * parts;
          if (linear != unit_coefficient)
            sum.block<2, 1>(2 * i, 1 + static_cast<Eigen::Index>(linear)) += parts;
        } else {
          sum.block<2, 1>(2 * i, 1 + static_cast<Eigen::Index>(derivative)) +=
              coefficient(p.data(), list[j]) * parts;
        }
      }
  };
  add(Model::contact_terms, 0);
  add(Model::tail_terms, static_cast<Eigen::Index>(Model::contact_terms.size()));
  return sum;
}

}  // namespace combforce::test
