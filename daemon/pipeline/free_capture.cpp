#include "daemon/pipeline/free_capture.hpp"

#include <algorithm>
#include <utility>

namespace combforce {

FreeCapture::FreeCapture(std::uint32_t windows, const Comb& comb, double drift_tolerance, Done done)
    : windows_(windows),
      drift_tolerance_(drift_tolerance),
      mean_(2 * comb.tones.size()),
      deviation_(mean_.size()),
      scatter_(mean_.size() * mean_.size()),
      turns_(comb),
      done_(std::move(done)) {}

bool FreeCapture::add(std::uint64_t first_sample, std::span<const std::complex<double>> tip_nm) {
  if (added_ == 0) first_sample_ = first_sample;
  ++added_;
  const std::size_t n = mean_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const std::complex<double> tone = tip_nm[i / 2];
    deviation_[i] = (i % 2 == 0 ? tone.real() : tone.imag()) - mean_[i];
    mean_[i] += deviation_[i] / added_;
  }
  const double weight = static_cast<double>(added_ - 1) / added_;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) scatter_[i * n + j] += weight * deviation_[i] * deviation_[j];
  turns_.add(tip_nm);
  return added_ == windows_;
}

void FreeCapture::begin_again() {
  added_ = 0;
  std::ranges::fill(mean_, 0.0);
  std::ranges::fill(scatter_, 0.0);
  turns_.begin_again();
}

void FreeCapture::finish() const {
  if (failure_ != nullptr) {
    done_(std::nullopt, failure_);
    return;
  }
  const std::string turn = turns_.find_turn(drift_tolerance_);
  FreeResponse response{.first_sample = first_sample_,
                        .windows = added_,
                        .mean_nm = {},
                        .covariance = {},
                        .coherent = turn.empty()};
  for (std::size_t i = 0; i < mean_.size(); i += 2) response.mean_nm.emplace_back(mean_[i], mean_[i + 1]);
  if (added_ > 1) {
    std::vector<double> covariance = scatter_;
    for (double& value : covariance) value /= static_cast<double>(added_) * (added_ - 1);
    response.covariance = std::move(covariance);
  }
  done_(std::move(response), turn);
}

}  // namespace combforce
