#include "fake_instrument.hpp"

#include <stdexcept>
#include <utility>

namespace combforce {

FakeInstrument& fake_instrument() {
  static FakeInstrument fake;
  return fake;
}

namespace {

FakeInstrument& willing() {
  if (!fake_instrument().refuse.empty()) throw std::logic_error(fake_instrument().refuse);
  return fake_instrument();
}

}  // namespace

class Instrument::Impl {};

// NOLINTNEXTLINE(performance-unnecessary-value-param): the real one keeps them
Instrument::Instrument(const Configuration&, PipelineOutputs) {}
Instrument::~Instrument() = default;
void Instrument::start() {}
void Instrument::wait() {}
void Instrument::stop() {
  if (fake_instrument().on_stop) fake_instrument().on_stop();
}
const StreamInfo& Instrument::info() const {
  return fake_instrument().info;
}
InstrumentStatus Instrument::status() const {
  return fake_instrument().status;
}
Description Instrument::description() const {
  return fake_instrument().description;
}
std::optional<ScanLayout> Instrument::configured_scan() const {
  return fake_instrument().configured_scan;
}

void Instrument::start_scan(std::optional<ScanLayout> layout, std::uint32_t frames) {
  willing().scan_layout = layout;
  fake_instrument().scan_frames = frames;
  fake_instrument().scanning = true;
}
void Instrument::stop_scan() {
  willing().scanning = false;
}
void Instrument::mark_line(const LineMark& mark) {
  willing().lines.push_back(mark);
}

std::string Instrument::start_recording(const std::string& name) {
  willing().recordings.push_back(name);
  return name + ".sigmf-meta";
}
RecordingSummary Instrument::stop_recording() {
  return willing().status.record;
}

void Instrument::capture_free(std::uint32_t windows, Height height,
                              std::function<void(std::optional<FreeResponse>, std::string)> done) {
  willing().free_windows = windows;
  willing().free_height = height;
  fake_instrument().free_done = std::move(done);
}
void Instrument::cancel_free() {
  ++fake_instrument().free_cancelled;
}

Drive Instrument::drive() const {
  return fake_instrument().drive;
}
void Instrument::set_drive(const Drive& drive) {
  willing().drive = drive;
}
void Instrument::set_fit(const FitSettings& fit) {
  willing().fit = fit;
}
void Instrument::set_spectrum_rate(double hz) {
  fake_instrument().spectrum_hz = hz;
}

}  // namespace combforce
