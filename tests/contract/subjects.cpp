#include "tests/contract/subjects.hpp"

#include "drivers/replay/replay_digitizer.hpp"
#include "drivers/simulated/simulated_digitizer.hpp"
#include "tests/support/temporary_directory.hpp"

namespace combforce::test {
namespace {

SimulationSettings simulation(bool paced) {
  SimulationSettings settings;
  settings.sample_rate_hz = 1e6;
  settings.cantilever.modes = {{50e3, 50.0, 4.0, 1.0}};
  settings.comb = {1000, {{50, true}}};
  settings.drive.total_amplitude_nm = 20.0;
  settings.model = "hertz";
  settings.scene.materials = {{{1.0}}};
  settings.feedback.start_z_nm = 15.0;
  settings.layout.lines = 4;
  settings.layout.columns = 4;
  settings.layout.pixel_samples = 2000;
  settings.block_frames = 4096;
  settings.paced = paced;
  settings.faults = {{FaultSettings::Kind::lost_block, 10'000, 5'000, 0.0},
                     {FaultSettings::Kind::unknown_loss, 30'000, 2'000, 0.0},
                     {FaultSettings::Kind::lost_block, 40'000, 1, 0.0}};
  return settings;
}

Subject simulated(bool paced) {
  Subject subject;
  subject.name = paced ? "simulated_paced" : "simulated_free_running";
  subject.make = [paced](const std::string&) {
    const SimulationSettings settings = simulation(paced);
    auto digitizer = std::make_unique<SimulatedDigitizer>(settings);
    digitizer->start_scan(settings.layout, 1);
    return digitizer;
  };
  subject.frames = 60'000;
  subject.lost_frames = 5'001;
  subject.epochs = 2;
  subject.lines = 4;
  const auto refuse = [&](auto spoil, std::vector<std::string> names) {
    subject.refusals.push_back({[paced, spoil](const std::string&) {
                                  SimulationSettings settings = simulation(paced);
                                  spoil(settings);
                                  const SimulatedDigitizer digitizer(settings);
                                },
                                std::move(names)});
  };
  refuse([](SimulationSettings& s) { s.sample_rate_hz = -1.0; }, {"sample_rate_hz", "-1", "> 0"});
  refuse([](SimulationSettings& s) { s.block_frames = 0; }, {"block_frames", "0", "1.."});
  refuse([](SimulationSettings& s) { s.comb.tones[0].bin = 500; }, {"bin", "500"});
  refuse([](SimulationSettings& s) { s.cantilever.modes[0].quality_factor = 0.0; },
         {"quality_factor", "0", "positive"});
  refuse([](SimulationSettings& s) { s.model = "lennard"; }, {"lennard", "hertz"});
  refuse([](SimulationSettings& s) { s.model = "jkr"; }, {"model", "jkr", "history"});
  return subject;
}

// 3000 frames in three captures: 500 lost before the second, a new epoch with the third.
constexpr const char* metadata = R"({
  "global": {"core:datatype": "ri16_le", "core:version": "1.2.5", "core:sample_rate": 1e6, "core:num_channels": 1},
  "captures": [
    {"core:sample_start": 0, "core:global_index": 100, "afm:steps": [120]},
    {"core:sample_start": 1000, "core:global_index": 1600},
    {"core:sample_start": 2000, "core:global_index": 2600, "afm:epoch": 1, "afm:epoch_reason": "clock_change"}],
  "annotations": [
    {"core:sample_start": 100, "core:sample_count": 900, "core:label": "line", "afm:line": 0,
     "afm:first_sample": 200, "afm:line_samples": 1000},
    {"core:sample_start": 1000, "core:sample_count": 500, "core:label": "line", "afm:line": 1,
     "afm:first_sample": 1300, "afm:line_samples": 800},
    {"core:sample_start": 2500, "core:sample_count": 100, "core:label": "line", "afm:line": 2,
     "afm:first_sample": 3100, "afm:line_samples": 100}]})";

std::string write_recording(const std::string& directory) {
  write_file(directory + "/r.sigmf-meta", metadata);
  write_file(directory + "/r.sigmf-data", std::string(6000, '\x11'));
  return directory + "/r";
}

Subject replay(bool realtime) {
  Subject subject;
  subject.name = realtime ? "replay_realtime" : "replay";
  subject.make = [realtime](const std::string& directory) {
    return std::make_unique<ReplayDigitizer>(write_recording(directory),
                                             ReplayOptions{.realtime = realtime, .block_frames = 128});
  };
  subject.frames = 3000;
  subject.lost_frames = 500;
  subject.epochs = 2;
  subject.lines = 3;
  subject.refusals = {
      {[](const std::string& directory) {
         const ReplayDigitizer digitizer(write_recording(directory), {.block_frames = 0});
       },
       {"block_frames", "0", "1.."}},
      {[](const std::string& directory) { const ReplayDigitizer digitizer(directory + "/none"); },
       {"none.sigmf-meta"}},
      {[](const std::string& directory) {
         write_recording(directory);
         std::string spoilt = metadata;
         spoilt.replace(spoilt.find("1e6"), 3, "0.5");
         write_file(directory + "/r.sigmf-meta", spoilt);
         const ReplayDigitizer digitizer(directory + "/r");
       },
       {"r.sigmf-meta", "/global/core:sample_rate", "0.5", "1"}}};
  return subject;
}

}  // namespace

std::vector<Subject> contract_subjects() {
  return {simulated(false), simulated(true), replay(false), replay(true)};
}

}  // namespace combforce::test
