#include "dsp/spectrum.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dsp/fftw.hpp"

namespace combforce {

namespace {

double sum_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum;
}

}  // namespace

class WelchSpectrum::State {
 public:
  State(std::size_t segment_samples, double sample_rate_hz, bool remove_mean);

  void push(std::span<const double> samples);
  void break_off() { filled_ = 0; }
  void reset();
  std::uint64_t segments() const { return segments_; }
  double bin_hz() const { return sample_rate_hz_ / static_cast<double>(segment_.size()); }
  std::vector<double> density() const;

 private:
  void add_segment();

  double sample_rate_hz_;
  bool remove_mean_;
  std::vector<double> segment_;  // the first filled_ are valid
  std::size_t filled_ = 0;
  std::vector<double> window_;
  double window_power_ = 0.0;  // sum of the squared window
  std::vector<double> power_;  // sum of |X_k|^2 over segments
  std::uint64_t segments_ = 0;
  FftwReals windowed_;
  FftwComplexes transform_;
  FftwPlan plan_;
};

WelchSpectrum::State::State(std::size_t segment_samples, double sample_rate_hz, bool remove_mean)
    : sample_rate_hz_(sample_rate_hz), remove_mean_(remove_mean) {
  constexpr auto longest = static_cast<std::size_t>(std::numeric_limits<int>::max());
  if (segment_samples < 4 || segment_samples % 2 != 0 || segment_samples > longest)
    throw std::invalid_argument(
        fmt::format("segment_samples: {} is not even, or not in 4 to 2^31 - 1", segment_samples));
  if (!(sample_rate_hz > 0.0) || !std::isfinite(sample_rate_hz))
    throw std::invalid_argument(fmt::format("sample_rate_hz: {} is not above 0 and finite", sample_rate_hz));
  segment_.resize(segment_samples);
  power_.resize(segment_samples / 2 + 1);
  for (std::size_t i = 0; i < segment_samples; ++i) {
    const double turn = static_cast<double>(i) / static_cast<double>(segment_samples);
    window_.push_back(0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * turn));
    window_power_ += window_.back() * window_.back();
  }
  windowed_.reset(fftw_alloc_real(segment_samples));
  transform_.reset(fftw_alloc_complex(segment_samples / 2 + 1));
  const std::scoped_lock lock(fftw_planner_mutex());
  plan_.reset(fftw_plan_dft_r2c_1d(static_cast<int>(segment_samples), windowed_.get(), transform_.get(),
                                   FFTW_ESTIMATE));
}

void WelchSpectrum::State::push(std::span<const double> samples) {
  while (!samples.empty()) {
    const std::size_t count = std::min(samples.size(), segment_.size() - filled_);
    std::copy_n(samples.begin(), count, segment_.begin() + static_cast<std::ptrdiff_t>(filled_));
    samples = samples.subspan(count);
    filled_ += count;
    if (filled_ == segment_.size()) add_segment();
  }
}

void WelchSpectrum::State::add_segment() {
  const std::size_t n = segment_.size();
  const double mean = remove_mean_ ? sum_of(segment_) / static_cast<double>(n) : 0.0;
  for (std::size_t i = 0; i < n; ++i) windowed_.get()[i] = window_[i] * (segment_[i] - mean);
  fftw_execute(plan_.get());
  for (std::size_t k = 0; k < power_.size(); ++k) {
    const double re = transform_.get()[k][0];
    const double im = transform_.get()[k][1];
    power_[k] += re * re + im * im;
  }
  ++segments_;
  filled_ = n / 2;
  std::copy_n(segment_.begin() + static_cast<std::ptrdiff_t>(filled_), filled_, segment_.begin());
}

void WelchSpectrum::State::reset() {
  break_off();
  segments_ = 0;
  std::ranges::fill(power_, 0.0);
}

std::vector<double> WelchSpectrum::State::density() const {
  std::vector<double> density(power_.size(), 0.0);
  if (segments_ == 0) return density;
  const double scale = 1.0 / (sample_rate_hz_ * window_power_ * static_cast<double>(segments_));
  for (std::size_t k = 0; k < density.size(); ++k) {
    const bool both_signs = k != 0 && k + 1 != density.size();
    density[k] = (both_signs ? 2.0 : 1.0) * scale * power_[k];
  }
  return density;
}

WelchSpectrum::WelchSpectrum(std::size_t segment_samples, double sample_rate_hz, bool remove_mean)
    : state_(std::make_unique<State>(segment_samples, sample_rate_hz, remove_mean)) {}
WelchSpectrum::~WelchSpectrum() = default;
WelchSpectrum::WelchSpectrum(WelchSpectrum&&) noexcept = default;
WelchSpectrum& WelchSpectrum::operator=(WelchSpectrum&&) noexcept = default;

void WelchSpectrum::push(std::span<const double> samples) {
  state_->push(samples);
}
void WelchSpectrum::break_off() {
  state_->break_off();
}
void WelchSpectrum::reset() {
  state_->reset();
}
std::uint64_t WelchSpectrum::segments() const {
  return state_->segments();
}
double WelchSpectrum::bin_hz() const {
  return state_->bin_hz();
}
std::vector<double> WelchSpectrum::density() const {
  return state_->density();
}

}  // namespace combforce
