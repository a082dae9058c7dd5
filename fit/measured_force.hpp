// The measured side of the force balance: F_i = chi^-1(w_i) (d_i - d_free,i) (paper, equation 6), its noise,
// and what follows from it without a model.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace combforce {

struct FitConditions;

// Thread-bound. Only the constructor allocates.
class MeasuredForce {
 public:
  // Conditions are valid and have a free response.
  explicit MeasuredForce(const FitConditions& conditions);

  // Force phasors, nN, of these tip-deflection phasors, nm, both with their phases at the time at which those
  // of the free response are multiplied by `turns`, one a tone.
  void set(std::span<const std::complex<double>> tip_nm, std::span<const std::complex<double>> turns);
  std::span<const std::complex<double>> phasors() const { return forces_; }

  // Variance of each quadrature, nN^2, one a tone, of the engaged measurement; all 0 without a noise model.
  std::span<const double> variances() const { return variances_; }
  bool noise_known() const { return noise_known_; }

  // Covariance of all of them, rows (re, im) of every tone, nN^2, as if the detector's noise were seen by the
  // measurement alone: through chi^-1. All 0 without a noise model.
  const Eigen::MatrixXd& covariance() const { return covariance_; }
  // As covariance() where noise is known, else of heat at 300 K: says a search how far minima extend.
  const Eigen::MatrixXd& search_covariance() const { return search_covariance_; }
  // The same of the difference between a model's forces and the measured ones, over a surface. `stiffness`,
  // rows x rows: dF_model/dd, nN/nm, by (re, im) of every tone's motion; `heat`: covariance of the tones'
  // thermal motion there, nm^2 (engaged_heat.hpp). It, like the detector's noise, which is taken for motion,
  // enters both forces, through `stiffness` - chi^-1. Noise must be known; does not allocate.
  void covariance_at(const Eigen::MatrixXd& stiffness, const Eigen::MatrixXd& heat,
                     Eigen::MatrixXd& covariance) const;

  // Whether the forces are distinguishable from none: sum |F_i|^2/s_i^2 exceeds the 5-sigma quantile of chi^2
  // with two degrees of freedom a tone, s_i^2 being the variance of engaged and free measurement together
  // and, for what noise leaves out, (1e-6 of the drive forces)^2: tones are extracted to 1e-6 of full scale.
  bool contact() const;

  // Whether a reduced chi^2 with this many fitted parameters exceeds its mean by more than `deviate` standard
  // deviations of the normal distribution. Without a noise model, or degrees of freedom, nothing is known:
  // false.
  bool misfit(double chi2_reduced, std::size_t parameters, double deviate) const;

  double virial_nn_nm() const;   // 1/2 sum Re(F_i conj d_i)
  double dissipated_fw() const;  // -1/2 sum w_i Im(F_i conj d_i)

 private:
  void set_covariance(const FitConditions& conditions, std::span<const double> frequencies_hz);
  // What a motion seen at `column` changes of the difference at `row`.
  double gain(const Eigen::MatrixXd& stiffness, Eigen::Index row, Eigen::Index column) const;

  std::vector<std::complex<double>> inverse_response_, free_nm_, tip_nm_, forces_;
  std::vector<double> angular_frequencies_, variances_, contact_variances_;
  std::vector<double> detector_variances_;  // of each quadrature of the motion, nm^2
  Eigen::MatrixXd covariance_, search_covariance_;
  double contact_threshold_ = 0.0;
  bool noise_known_ = false;
};

}  // namespace combforce
