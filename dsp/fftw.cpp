#include "dsp/fftw.hpp"

namespace combforce {

std::mutex& fftw_planner_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::size_t quick_fft_size(std::size_t least) {
  for (std::size_t size = least + least % 2;; size += 2) {
    std::size_t rest = size;
    for (const std::size_t factor : {2U, 3U, 5U})
      while (rest % factor == 0) rest /= factor;
    if (rest == 1) return size;
  }
}

void FreeFftw::operator()(std::remove_pointer_t<fftw_plan>* plan) const {
  const std::scoped_lock lock(fftw_planner_mutex());
  fftw_destroy_plan(plan);
}

}  // namespace combforce
