#include "dsp/fourier.hpp"

#include <fmt/format.h>

#include <limits>
#include <stdexcept>

#include "dsp/fftw.hpp"

namespace combforce {
namespace {

int fftw_size(std::size_t samples) {
  if (samples > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw std::invalid_argument(fmt::format("signal: {} samples, must be at most 2^31 - 1", samples));
  return static_cast<int>(samples);
}

template <typename Make>
FftwPlan make_plan(const Make& make) {
  const std::scoped_lock lock(fftw_planner_mutex());
  return FftwPlan(make());
}

fftw_complex* as_fftw(std::vector<std::complex<double>>& values) {
  return reinterpret_cast<fftw_complex*>(values.data());
}

}  // namespace

std::vector<std::complex<double>> spectrum_of(std::span<const double> signal) {
  std::vector<double> in(signal.begin(), signal.end());
  std::vector<std::complex<double>> out(in.size() / 2 + 1);
  const FftwPlan plan = make_plan(
      [&] { return fftw_plan_dft_r2c_1d(fftw_size(in.size()), in.data(), as_fftw(out), FFTW_ESTIMATE); });
  fftw_execute(plan.get());
  const double scale = 2.0 / static_cast<double>(in.size());
  for (std::complex<double>& phasor : out) phasor *= scale;
  out.front() *= 0.5;
  out.back() *= 0.5;
  return out;
}

std::vector<double> signal_of(std::span<const std::complex<double>> spectrum) {
  std::vector<std::complex<double>> in(spectrum.begin(), spectrum.end());
  for (std::size_t k = 1; k + 1 < in.size(); ++k) in[k] *= 0.5;
  std::vector<double> out(2 * (in.size() - 1));
  const FftwPlan plan = make_plan(
      [&] { return fftw_plan_dft_c2r_1d(fftw_size(out.size()), as_fftw(in), out.data(), FFTW_ESTIMATE); });
  fftw_execute(plan.get());
  return out;
}

}  // namespace combforce
