#include "drivers/digitizer.hpp"

#include <stdexcept>

namespace combforce {

void Digitizer::prepare_scan(const ScanLayout& /*layout*/) {
  throw std::logic_error(info().name + " has no scanner: prepare_scan() is not available");
}

void Digitizer::start_scan(const ScanLayout& /*layout*/, std::uint32_t /*frames*/) {
  throw std::logic_error(info().name + " has no scanner: start_scan() is not available");
}

void Digitizer::stop_scan() {
  throw std::logic_error(info().name + " has no scanner: stop_scan() is not available");
}

void Digitizer::set_drive(const Drive& /*drive*/) {
  throw std::logic_error(info().name + " has no drive: set_drive() is not available");
}

Drive Digitizer::drive() const {
  throw std::logic_error(info().name + " has no drive: drive() is not available");
}

}  // namespace combforce
