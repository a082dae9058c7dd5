// SUNDIALS CVODE as an oracle that shares nothing with the simulator: the modes' plain equations of motion,
// drive and tip-surface force on the right-hand side, Adams' method at rtol 1e-10.
#pragma once

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "drivers/simulated/oscillator.hpp"

namespace combforce::test {

class CvodeMotion {
 public:
  // From the drive's steady state at t = 0, as the simulator starts.
  CvodeMotion(OscillatorSettings settings, std::function<double(double tip_nm, double nm_per_s)> force)
      : settings_(std::move(settings)), force_(std::move(force)) {
    check(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
    const std::size_t modes = settings_.cantilever.modes.size();
    state_ = N_VNew_Serial(static_cast<sunindextype>(2 * modes), context_);
    for (std::size_t m = 0; m < modes; ++m) {
      std::complex<double> q, v;
      for (std::size_t i = 0; i < settings_.drive_bins.size(); ++i) {
        const std::complex<double> tone =
            mode_response(settings_.cantilever.modes[m], omega(i) / (2.0 * std::numbers::pi)) *
            settings_.drive_forces_nn[i];
        q += tone;
        v += std::complex<double>(0.0, omega(i)) * tone;
      }
      position(m) = q.real();
      velocity(m) = v.real();
    }
    cvode_ = CVodeCreate(CV_ADAMS, context_);
    check(CVodeInit(cvode_, &CvodeMotion::derivative, 0.0, state_), "CVodeInit");
    // Velocities are up to 1e9 nm/s: the absolute tolerance is that of positions, in nm, times the first
    // mode's w.
    tolerance_ = N_VClone(state_);
    for (std::size_t m = 0; m < modes; ++m) {
      const double w = 2.0 * std::numbers::pi * settings_.cantilever.modes[m].frequency_hz;
      N_VGetArrayPointer(tolerance_)[2 * m] = 1e-9;
      N_VGetArrayPointer(tolerance_)[2 * m + 1] = 1e-9 * w;
    }
    check(CVodeSVtolerances(cvode_, 1e-10, tolerance_), "CVodeSVtolerances");
    check(CVodeSetUserData(cvode_, this), "CVodeSetUserData");
    check(CVodeSetMaxNumSteps(cvode_, 100000000), "CVodeSetMaxNumSteps");
    solver_ = SUNNonlinSol_FixedPoint(state_, 0, context_);
    check(CVodeSetNonlinearSolver(cvode_, solver_), "CVodeSetNonlinearSolver");
  }
  ~CvodeMotion() {
    CVodeFree(&cvode_);
    SUNNonlinSolFree(solver_);
    N_VDestroy(tolerance_);
    N_VDestroy(state_);
    SUNContext_Free(&context_);
  }
  CvodeMotion(const CvodeMotion&) = delete;
  CvodeMotion& operator=(const CvodeMotion&) = delete;

  void advance_to(double seconds) {
    if (seconds <= 0.0) return;
    double reached = 0.0;
    check(CVode(cvode_, seconds, state_, &reached, CV_NORMAL), "CVode");
  }
  double mode_nm(std::size_t m) { return position(m); }

 private:
  static void check(int code, const char* call) {
    if (code < 0) throw std::runtime_error(std::string(call) + " failed with " + std::to_string(code));
  }
  double omega(std::size_t tone) const {
    return 2.0 * std::numbers::pi * settings_.sample_rate_hz *
           static_cast<double>(settings_.drive_bins[tone]) / static_cast<double>(settings_.window_samples);
  }
  double& position(std::size_t m) { return N_VGetArrayPointer(state_)[2 * m]; }
  double& velocity(std::size_t m) { return N_VGetArrayPointer(state_)[2 * m + 1]; }

  static int derivative(double t, N_Vector state, N_Vector rate, void* user) {
    const CvodeMotion& self = *static_cast<const CvodeMotion*>(user);
    const double* y = N_VGetArrayPointer(state);
    double* dy = N_VGetArrayPointer(rate);
    const std::size_t modes = self.settings_.cantilever.modes.size();
    double tip = 0.0, tip_velocity = 0.0;
    for (std::size_t m = 0; m < modes; ++m) {
      tip += y[2 * m];
      tip_velocity += y[2 * m + 1];
    }
    double force = self.force_(tip, tip_velocity);
    for (std::size_t i = 0; i < self.settings_.drive_bins.size(); ++i) {
      force += (self.settings_.drive_forces_nn[i] * std::polar(1.0, self.omega(i) * t)).real();
    }
    for (std::size_t m = 0; m < modes; ++m) {
      const Mode& mode = self.settings_.cantilever.modes[m];
      const double w = 2.0 * std::numbers::pi * mode.frequency_hz;
      dy[2 * m] = y[2 * m + 1];
      dy[2 * m + 1] =
          w * w * (force / mode.stiffness_n_per_m - y[2 * m]) - w / mode.quality_factor * y[2 * m + 1];
    }
    return 0;
  }

  OscillatorSettings settings_;
  std::function<double(double, double)> force_;
  SUNContext context_ = nullptr;
  N_Vector state_ = nullptr, tolerance_ = nullptr;
  void* cvode_ = nullptr;
  SUNNonlinearSolver solver_ = nullptr;
};

// The force models once more, from the paper's equations 15 and 16.
inline double paper_hertz(double p0, double p1, double d) {
  return d < p0 ? p1 * std::pow(p0 - d, 1.5) : 0.0;
}
inline double paper_dmt(double p0, double p1, double p2, double p3, double d) {
  return d < p0 ? p1 * std::pow(p0 - d, 1.5) - p2 : -p2 * std::pow(p3 / (d - p0 + p3), 2);
}

// Kelvin-Voigt with a Hertzian contact (Garcia et al. 2006); p2 in us.
inline double viscous_hertz(double p0, double p1, double p2, double d, double velocity) {
  if (d >= p0) return 0.0;
  const double viscous = 1.5e-6 * p2 * std::sqrt(p0 - d) * -velocity;
  return std::max(0.0, p1 * (std::pow(p0 - d, 1.5) + viscous));
}

// Sphere and half-space by Lennard-Jones, with the simulator's floor of z.
inline double lennard_jones(double p0, double p1, double p2, double d) {
  const double z = std::max(d - p0, 0.02);
  return p1 * (std::pow(p2, 6) / (30.0 * std::pow(z, 8)) - 1.0 / (z * z));
}

}  // namespace combforce::test
