// Does the free response hold still? A drive that does not share the digitizer's clock turns every tone of
// it, the higher the faster; a cantilever that warms up or a laser that moves changes it too. What counts is
// the change of a driven tone relative to that tone, since forces come from its difference to the reference.
// Tones that are not driven are noise here.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dsp/comb.hpp"
#include "fit/free_response.hpp"

namespace combforce {

// Follows the phases of the driven tones from window to window of one capture. Thread-bound; add() does not
// allocate.
class TurnMeter {
 public:
  explicit TurnMeter(const Comb& comb);

  // The next window: peak phasors, one a tone of the comb, in any unit.
  void add(std::span<const std::complex<double>> phasors);
  void begin_again();  // as if no window had come

  // "", or for people what turned: a tone that is seen in every window and whose phase moved, first window to
  // last, by more than `tolerance_rad` plus four times what its scatter from window to window explains. ""
  // with fewer than four windows: they do not tell turning from noise. A turn of pi or more from one window
  // to the next looks like a slower one.
  std::string find_turn(double tolerance_rad) const;

 private:
  struct Tone {
    std::uint64_t bin = 0;
    std::size_t index = 0;  // in the comb
    std::complex<double> last = 0.0;
    double turn_rad = 0.0, square_rad = 0.0;  // sums of the turns from window to window, and of their squares
    std::complex<double> overlap = 0.0;       // sum of last* times next
    double weight = 0.0;                      // sum of their magnitudes
  };
  std::vector<Tone> tones_;  // driven
  std::uint64_t windows_ = 0;
};

// "", or for people what changed between two references of one comb, free or lifted: the driven tone with
// the greatest |after - before|/|before|, where that is more than `tolerance` plus four standard deviations
// (of both, as far as their covariances are known).
std::string find_change(const Comb& comb, const FreeResponse& before, const FreeResponse& after,
                        double tolerance);

// "", or for people which driven tone stands out least from its noise, where its free amplitude is less than
// three standard deviations (both quadratures together): noise alone exceeds that once in 8000 times. ""
// without covariance.
std::string find_lost_tone(const Comb& comb, const FreeResponse& response);

}  // namespace combforce
