// FFTW executes plans on any thread, but makes and destroys them with process-wide state.
#pragma once

#include <mutex>

namespace combforce {

// To be held while any FFTW plan of the program is made or destroyed.
std::mutex& fftw_planner_mutex();

}  // namespace combforce
