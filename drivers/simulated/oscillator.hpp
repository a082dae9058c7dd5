// The cantilever in time: N modes under a drive of exact tones, a tip-surface force and thermal forces.
//
// The steady state of the drive is a sum of tones, known exactly at any time; what the surface and heat add,
// u = q - q_free in every mode, is propagated exactly under a force interpolated over cells (cell.hpp). A
// cell is halved where the highest Legendre coefficient of the force exceeds a tolerance or the force's kink,
// d = p0, lies in it or too near to be missed between nodes; the shortest cells are split where the kink
// is, and again where the force, as at a wall, still changes too much.
//
// Thermal forces: white, of one-sided density S = 4 kB T k/(w Q) in every mode. Their effect over one sample
// is drawn from the exact covariance of (q, q') after that time and added at its end, so without surface the
// motion at the samples has exactly the distribution of the continuous process. Within a sample it lags by at
// most w^2/k sqrt(S h^3/6) (0.3 pm at 8 MS/s for the paper's cantilever), which only the tip-surface force
// sees.
//
// Thread-bound. advance() does not allocate. The samples are a function of the settings and the calls.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/simulated/cell.hpp"
#include "drivers/simulated/random.hpp"
#include "drivers/simulated/simulation.hpp"
#include "fit/fit_result.hpp"
#include "fit/force_model.hpp"

namespace combforce {

struct OscillatorSettings {
  double sample_rate_hz = 0.0;
  Cantilever cantilever;
  std::uint64_t window_samples = 0;  // N: a tone's frequency is bin * sample_rate / N
  std::vector<std::uint64_t> drive_bins;
  std::vector<std::complex<double>> drive_forces_nn;  // at the tip, peak phasors at sample 0, one a bin
  double temperature_k = 0.0;
  std::uint64_t seed = 1;
  IntegratorAccuracy accuracy = IntegratorAccuracy::live;
};

class Oscillator {
 public:
  // At sample 0, withdrawn, in the drive's steady state, with thermal motion drawn from equilibrium. Throws
  // std::invalid_argument naming field, value and bound.
  explicit Oscillator(const OscillatorSettings& settings);

  // From the next sample on. `parameters` in the model's order; the first is the surface position where there
  // is one.
  void engage(const ModelInfo& model, std::span<const double> parameters);
  void withdraw();
  // The next sample on has this drive; deflection and velocity of every mode are continuous.
  void set_drive(std::span<const std::complex<double>> forces_nn);

  // From the next sample on the drive's clock runs fast by `relative` (negative: slow): tones keep their
  // forces, and their phases here, and every frequency is (1 + relative) times that of its bin. Deflection
  // and velocity of every mode are continuous.
  void detune(double relative);

  // Writes the detector signal sum q_m/alpha_m (V) at the next samples and moves past them.
  void advance(std::span<double> detector_v);

  // The state at the next sample.
  std::uint64_t next_sample() const { return sample_; }
  double tip_nm() const;  // d
  double tip_nm_per_s() const;
  std::complex<double> free_nm(std::size_t mode) const;  // q_free,m as an analytic signal: q in the real part
  double mode_nm(std::size_t mode) const { return free_nm(mode).real() + response_nm(mode); }  // q_m
  double response_nm(std::size_t mode) const { return re_[tones_ + mode]; }                    // u_m
  std::uint64_t cells() const { return cells_; }  // integrated since the start: what accuracy costs

 private:
  struct Tolerances {
    double turn;           // the fastest state turns by less than this in the longest cell, rad
    double force_nn;       // greatest accepted Legendre coefficient
    double resolution_nm;  // the tip moves less than this in the shortest cell
  };
  using Tip = std::array<double, cell_nodes>;
  using Taylor = std::array<double, ShortCell::order + 1>;

  static Tolerances tolerances(IntegratorAccuracy accuracy);
  void make_cells();
  void make_thermal_forces();
  void set_weights(std::span<const std::complex<double>> forces_nn);
  std::complex<double> drive_velocity(std::size_t mode) const;
  double detector_v() const;
  template <typename Change>
  void keep_motion(Change change);
  void renew_phases();
  void renew_guards();
  void begin_next_sample();
  void propagate_free();

  template <typename Model>
  void advance_engaged(std::span<double> detector_v);
  template <typename Model>
  void cross_sample();
  template <typename Model>
  void evaluate(const CellTable& cell, Tip& tip, Tip& force) const;
  template <typename Model>
  void force_at_later_nodes(const Tip& tip, double seconds, Tip& force) const;
  template <typename Model>
  void evaluate_short(const Taylor& taylor, double seconds, Tip& tip, Tip& force) const;
  template <typename Model>
  double force_now(double tip) const;
  Taylor taylor() const;  // of the tip without force
  template <typename Model>
  void cross_in_pieces(double seconds);
  void apply(const CellTable& cell, const Tip& force);
  void apply_short(double seconds, const Tip& force);

  OscillatorSettings settings_;
  Tolerances tolerances_;
  std::size_t tones_, modes_;
  StateDynamics dynamics_;
  std::vector<double> re_, im_;                                  // the states
  std::vector<std::vector<std::complex<double>>> free_mode_nm_;  // chi_m F by mode, then tone
  std::vector<std::complex<double>> free_detector_v_;            // one a tone
  std::vector<double> volts_per_nm_;                             // 1/alpha_m
  std::uint64_t sample_ = 0, cells_ = 0;
  double detuning_ = 0.0;              // relative
  std::vector<double> detuned_turns_;  // of each tone at detuned_from_, beyond the phase of its bin
  std::uint64_t detuned_from_ = 0;

  std::vector<CellTable> ladder_;     // each half as long as the one before
  std::vector<double> guard_nm_;      // one a ladder step: how near the kink may be without being in the cell
  std::uint32_t level_ = 0;           // of the ladder, as last used
  std::uint32_t cells_a_sample_ = 1;  // longest ones
  CellTable whole_sample_;
  ShortCell short_;

  struct ThermalForce {
    double re = 0.0, im_along = 0.0,
           im_across = 0.0;  // Cholesky factor of the covariance of a mode's (Re z, Im z)
  };
  std::vector<ThermalForce> thermal_;
  Random random_;

  std::array<double, max_parameters> parameters_{};
  void (Oscillator::*advance_)(std::span<double>) = nullptr;  // null: withdrawn
};

}  // namespace combforce
