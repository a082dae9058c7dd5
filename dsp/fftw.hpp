// What owns FFTW's memory and plans. FFTW executes plans on any thread, but makes and destroys them with
// process-wide state.
#pragma once

#include <fftw3.h>

#include <cstddef>
#include <memory>
#include <mutex>
#include <type_traits>

namespace combforce {

// To be held while any FFTW plan of the program is made; FreeFftw takes it to destroy one.
std::mutex& fftw_planner_mutex();

// The next even number without prime factors beyond 5: sizes that FFTW is quick with.
std::size_t quick_fft_size(std::size_t least);

struct FreeFftw {
  void operator()(void* memory) const { fftw_free(memory); }
  void operator()(std::remove_pointer_t<fftw_plan>* plan) const;
};

using FftwReals = std::unique_ptr<double, FreeFftw>;
using FftwComplexes = std::unique_ptr<fftw_complex, FreeFftw>;
using FftwPlan = std::unique_ptr<std::remove_pointer_t<fftw_plan>, FreeFftw>;

}  // namespace combforce
