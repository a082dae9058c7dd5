#include "dsp/fourier.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace combforce {
namespace {

int fftw_size(std::size_t samples) {
  if (samples < 2 || samples % 2 != 0)
    throw std::invalid_argument(fmt::format("signal: {} samples, must be an even number", samples));
  if (samples > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw std::invalid_argument(fmt::format("signal: {} samples, must be at most 2^31 - 1", samples));
  return static_cast<int>(samples);
}

}  // namespace

FourierTransform::FourierTransform(std::size_t samples) : samples_(samples) {
  const int size = fftw_size(samples);
  signal_.reset(fftw_alloc_real(samples));
  bins_.reset(fftw_alloc_complex(samples / 2 + 1));
  const std::scoped_lock lock(fftw_planner_mutex());
  to_signal_.reset(fftw_plan_dft_c2r_1d(size, bins_.get(), signal_.get(), FFTW_ESTIMATE));
  to_bins_.reset(fftw_plan_dft_r2c_1d(size, signal_.get(), bins_.get(), FFTW_ESTIMATE));
}

void FourierTransform::to_signal(std::span<const std::complex<double>> phasors) {
  const auto bins = this->bins();
  const auto rest =
      std::ranges::transform(phasors, bins.begin(), [](auto phasor) { return 0.5 * phasor; }).out;
  std::fill(rest, bins.end(), 0.0);
  bins.front() *= 2.0;
  bins.back() *= 2.0;
  fftw_execute(to_signal_.get());
}

void FourierTransform::to_phasors(std::span<std::complex<double>> phasors) {
  fftw_execute(to_bins_.get());
  const auto bins = this->bins();
  const double scale = 2.0 / static_cast<double>(samples_);
  bins.front() *= 0.5;
  bins.back() *= 0.5;
  std::transform(bins.begin(), bins.begin() + static_cast<std::ptrdiff_t>(phasors.size()), phasors.begin(),
                 [&](auto bin) { return scale * bin; });
}

std::vector<std::complex<double>> spectrum_of(std::span<const double> signal) {
  FourierTransform transform(signal.size());
  std::ranges::copy(signal, transform.signal().begin());
  std::vector<std::complex<double>> spectrum(signal.size() / 2 + 1);
  transform.to_phasors(spectrum);
  return spectrum;
}

std::vector<double> signal_of(std::span<const std::complex<double>> spectrum) {
  FourierTransform transform(2 * (spectrum.size() - 1));
  transform.to_signal(spectrum);
  return {transform.signal().begin(), transform.signal().end()};
}

}  // namespace combforce
