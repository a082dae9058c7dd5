// The digitizers that the contract test runs against. A new digitizer adds its subjects here.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "drivers/digitizer.hpp"

namespace combforce::test {

struct Subject {
  std::string name;
  // Makes a digitizer whose stream holds lines, known losses and a new epoch within its first `frames`
  // frames; it may keep files in `directory`. Scans are asked for already.
  std::function<std::unique_ptr<Digitizer>(const std::string& directory)> make;
  std::uint64_t frames = 0;       // that exercise everything
  std::uint64_t lost_frames = 0;  // known losses among them
  std::uint32_t epochs = 1;       // begun among them
  std::uint32_t lines = 0;        // marked among them

  // Construction that must fail, and what the message must name.
  struct Refusal {
    std::function<void(const std::string& directory)> construct;
    std::vector<std::string> names;  // field, value, bound
  };
  std::vector<Refusal> refusals;
};

std::vector<Subject> contract_subjects();

inline void PrintTo(const Subject& subject, std::ostream* out) {
  *out << subject.name;
}

}  // namespace combforce::test
