// How far down the tip has been since it was last above where it is: a contact that lasts up to some height
// has been made on the way, or not.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace combforce {

// Thread-bound. Only the constructor allocates.
class Excursion {
 public:
  explicit Excursion(std::size_t most_turns) { peaks_.reserve(most_turns); }

  void begin(double d) {
    peaks_.clear();
    last_ = lowest_ = d;
    rising_ = false;
  }

  // The tip goes on to d. Returns the lowest since it was last above d.
  double advance(double d) {
    if (d < last_) {
      if (rising_ && peaks_.size() < peaks_.capacity()) peaks_.push_back({last_, lowest_});
      rising_ = false;
      lowest_ = d;
    } else {
      rising_ = true;
      for (; !peaks_.empty() && peaks_.back().d <= d; peaks_.pop_back())
        lowest_ = std::min(lowest_, peaks_.back().lowest_before);
    }
    last_ = d;
    return lowest_;
  }

 private:
  struct Peak {
    double d, lowest_before;  // since the peak before it
  };
  std::vector<Peak> peaks_;  // not passed again, ever lower
  double last_ = 0.0, lowest_ = 0.0;
  bool rising_ = false;
};

}  // namespace combforce
