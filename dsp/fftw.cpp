#include "dsp/fftw.hpp"

namespace combforce {

std::mutex& fftw_planner_mutex() {
  static std::mutex mutex;
  return mutex;
}

void FreeFftw::operator()(std::remove_pointer_t<fftw_plan>* plan) const {
  const std::scoped_lock lock(fftw_planner_mutex());
  fftw_destroy_plan(plan);
}

}  // namespace combforce
