#include "fit/cell_transform.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

namespace combforce {
CellTransform::CellTransform(std::size_t highest_tone, std::size_t band)
    : band_(band), cells_(quick_fft_size(std::max({std::size_t{8}, 2 * highest_tone, 2 * band / 3 + 1}))) {
  for (std::size_t n = 0; n <= band; ++n) {
    const double theta = std::numbers::pi * static_cast<double>(n) / static_cast<double>(cells_);
    expansion_.push_back(expand_exponential(theta));
    half_step_.push_back(std::polar(1.0, theta));
  }
  in_time_.reset(fftw_alloc_real(cells_ * order));
  in_frequency_.reset(fftw_alloc_complex((cells_ / 2 + 1) * order));
  const std::scoped_lock lock(fftw_planner_mutex());
  const int size = static_cast<int>(cells_), many = static_cast<int>(order);
  inverse_.reset(fftw_plan_many_dft_c2r(1, &size, many, in_frequency_.get(), nullptr, many, 1, in_time_.get(),
                                        nullptr, many, 1, FFTW_ESTIMATE));
  forward_ = forward_plan(order);
  forward_low_ = forward_plan(low_order);
}

FftwPlan CellTransform::forward_plan(std::size_t orders) {
  const int size = static_cast<int>(cells_), many = static_cast<int>(orders);
  return FftwPlan(fftw_plan_many_dft_r2c(1, &size, many, in_time_.get(), nullptr, many, 1,
                                         in_frequency_.get(), nullptr, many, 1, FFTW_ESTIMATE));
}

void CellTransform::to_polynomials(std::span<const std::complex<double>> spectrum,
                                   std::span<Motion::Polynomial> polynomials) {
  auto* bins = reinterpret_cast<std::complex<double>*>(in_frequency_.get());
  std::fill_n(bins, (cells_ / 2 + 1) * order, 0.0);
  bins[0] = spectrum[0].real();
  for (std::size_t n = 1; n <= band_; ++n) {
    const std::size_t alias = n % cells_;
    const bool folded = 2 * alias > cells_;
    const std::complex<double> phasor =
        (alias == 0 || 2 * alias == cells_ ? 1.0 : 0.5) * spectrum[n] * half_step_[n];
    std::complex<double>* bin = bins + (folded ? cells_ - alias : alias) * order;
    const double sign = folded ? -1.0 : 1.0;
    for (std::size_t k = 0; k < order; k += 2) {
      bin[k] += expansion_[n][k] * std::complex<double>(phasor.real(), sign * phasor.imag());
      bin[k + 1] += expansion_[n][k + 1] * std::complex<double>(-phasor.imag(), sign * phasor.real());
    }
  }
  fftw_execute(inverse_.get());
  for (std::size_t cell = 0; cell < cells_; ++cell)
    std::copy_n(in_time_.get() + cell * order, order, polynomials[cell].begin());
}

void CellTransform::to_phasors(std::span<const double> moments, std::size_t orders,
                               std::span<std::complex<double>> phasors) {
  std::copy_n(moments.begin(), cells_ * orders, in_time_.get());
  fftw_execute(orders == order ? forward_.get() : forward_low_.get());
  const auto* bins = reinterpret_cast<const std::complex<double>*>(in_frequency_.get());
  const double scale = 1.0 / static_cast<double>(cells_);
  for (std::size_t n = 0; n <= band_; ++n) {
    const std::size_t alias = n % cells_;
    const bool folded = 2 * alias > cells_;
    const std::complex<double>* bin = bins + (folded ? cells_ - alias : alias) * orders;
    double re = 0.0, im = 0.0;
    for (std::size_t k = 0; k < orders; k += 2) {
      re += expansion_[n][k] * bin[k].real();
      im += expansion_[n][k] * bin[k].imag();
    }
    // -i e_k times the odd moments, which is folded to its conjugate before.
    double odd_re = 0.0, odd_im = 0.0;
    for (std::size_t k = 1; k < orders; k += 2) {
      odd_re += expansion_[n][k] * bin[k].real();
      odd_im += expansion_[n][k] * bin[k].imag();
    }
    if (folded) {
      im = -im;
      odd_im = -odd_im;
    }
    const std::complex<double> sum(re + odd_im, im - odd_re);
    phasors[n] = scale * std::conj(half_step_[n]) * sum;
  }
  phasors[0] = 0.5 * phasors[0].real();
}

}  // namespace combforce
