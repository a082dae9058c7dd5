#include "drivers/simulated/sample_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/drivers/simulated_instrument.hpp"

namespace combforce::test {

using ::testing::HasSubstr;

struct Produced {
  std::vector<std::int16_t> codes;
  std::vector<StreamMark> marks;
};

// Calls append() with `stretch` frames at a time, a new block each time.
Produced produce(SampleSource& source, std::uint64_t frames, std::uint32_t stretch) {
  Produced produced;
  const std::uint64_t end = source.next_sample() + frames;
  while (source.next_sample() < end) {
    BlockHeader header;
    header.first_sample = source.next_sample();
    source.append(static_cast<std::uint32_t>(std::min<std::uint64_t>(stretch, end - source.next_sample())),
                  header, produced.codes);
    EXPECT_EQ(header.first_sample + header.frames, source.next_sample());
    for (const StreamMark& mark : header.valid_marks()) {
      EXPECT_GE(mark.sample, header.first_sample);
      EXPECT_LT(mark.sample, header.first_sample + header.frames);
      produced.marks.push_back(mark);
    }
  }
  return produced;
}

void start_scan(SampleSource& source, const SimulationSettings& settings, const ScanLayout& layout,
                std::uint32_t frames) {
  source.start_scan(layout, frames, make_scene(settings.scene, source.model(), layout));
}

TEST(SampleSource, FreeMotionIsTheExactFreeResponse) {
  const SimulationSettings settings = small_instrument();
  SampleSource source(settings);
  const Produced free = produce(source, 2000, 2000);
  CombExtractor extractor(settings.comb, 2, SampleFormat::i16, -32768, 32767);
  extractor.begin(0, 1);
  extractor.add(free.codes.data(), 2000);
  std::complex<double> phasor;
  std::vector<double> means(2);
  extractor.finish({&phasor, 1}, means);
  const double scale = simulated_channels(settings)[0].scale;
  // Twice the free motion of 50 nm is full scale; 20 samples a period repeat, so that rounding to codes is
  // systematic: up to 2/pi of half a code.
  EXPECT_NEAR(scale, 100.0 / 32767.0, 1e-12);
  EXPECT_LT(std::abs(phasor * scale - exact_free_response(settings)[0]), scale);
  EXPECT_NEAR(std::abs(exact_free_response(settings)[0]), 50.0, 1e-9);
  EXPECT_EQ(extractor.clipped(), 0U);
  EXPECT_DOUBLE_EQ(means[1], 4200.0);  // z in 0.01 nm
}

TEST(SampleSource, SamplesAndMarksDoNotDependOnTheBlocks) {
  SimulationSettings settings = small_instrument();
  settings.temperature_k = 300.0;
  settings.detector_nm_per_sqrt_hz = 1e-3;
  SampleSource coarse(settings), fine(settings);
  std::vector<Produced> produced;
  for (const std::uint32_t stretch : {16384U, 377U}) {
    SampleSource source(settings);
    start_scan(source, settings, small_layout(), 2);
    produced.push_back(produce(source, 200000, stretch));
  }
  EXPECT_EQ(produced[0].codes, produced[1].codes);
  ASSERT_EQ(produced[0].marks.size(), produced[1].marks.size());
  for (std::size_t i = 0; i < produced[0].marks.size(); ++i) {
    EXPECT_EQ(produced[0].marks[i].sample, produced[1].marks[i].sample);
    EXPECT_EQ(produced[0].marks[i].line, produced[1].marks[i].line);
  }
}

TEST(SampleSource, LinesTileTheScanAfterTheApproach) {
  const SimulationSettings settings = small_instrument();
  SampleSource source(settings);
  ScanLayout layout = small_layout();
  layout.bidirectional = true;
  start_scan(source, settings, layout, 2);
  const std::uint64_t line_samples = 5UL * 4000;
  const Produced scan = produce(source, 8UL * 4000 + 12 * line_samples + 10, 1000);
  ASSERT_EQ(scan.marks.size(), 12U + 1);
  std::uint64_t expected = 4000UL * Raster::approach_pixels;
  for (std::size_t i = 0; i + 1 < scan.marks.size(); ++i, expected += line_samples) {
    const StreamMark& mark = scan.marks[i];
    EXPECT_EQ(mark.kind, StreamMark::Kind::line);
    EXPECT_EQ(mark.sample, expected);
    const Direction direction = i % 2 == 0 ? Direction::trace : Direction::retrace;
    EXPECT_EQ(mark.line, (LineMark{static_cast<std::uint32_t>(i / 6), static_cast<std::uint32_t>(i / 2 % 3),
                                   direction, expected, line_samples}));
  }
  EXPECT_EQ(scan.marks.back().kind, StreamMark::Kind::scan_ended);
  EXPECT_EQ(scan.marks.back().sample, expected);
  EXPECT_FALSE(source.scanning());
}

// More marks than a block can carry: it is cut short, none is lost.
TEST(SampleSource, BlocksEndBeforeTheyRunOutOfMarks) {
  SimulationSettings settings = small_instrument();
  SampleSource source(settings);
  ScanLayout layout = small_layout();
  layout.lines = 40;
  layout.columns = 1;
  start_scan(source, settings, layout, 1);
  BlockHeader header;
  std::vector<std::int16_t> codes;
  source.append(40 * 4000, header, codes);
  EXPECT_LT(header.frames, 40U * 4000);
  EXPECT_GE(header.mark_count, BlockHeader::max_marks - 2);
  EXPECT_EQ(codes.size(), 2U * header.frames);
  const Produced rest = produce(source, 60UL * 4000, 200000);
  EXPECT_EQ(header.mark_count + rest.marks.size(), 41U);
}

// The feedback sees the amplitude over the analysed window; with gain 0.5 the error halves a pixel or better.
TEST(SampleSource, FeedbackFindsTheSetPoint) {
  SimulationSettings settings = small_instrument();
  settings.feedback.set_point = 0.7;
  SampleSource source(settings);
  std::vector<double> surface;
  source.truth = [&](const PixelTruth& truth) { surface.push_back(truth.parameters[0]); };
  ScanLayout layout = small_layout();
  layout.columns = 20;
  start_scan(source, settings, layout, 1);
  const std::uint64_t last_window = 8 * 4000 + 60 * 4000 - 2000;
  const Produced scan = produce(source, last_window + 2000, 4096);
  CombExtractor extractor(settings.comb, 2, SampleFormat::i16, -32768, 32767);
  extractor.begin(last_window, 1);
  extractor.add(scan.codes.data() + 2 * last_window, 2000);
  std::complex<double> phasor;
  std::vector<double> means(2);
  extractor.finish({&phasor, 1}, means);
  // After 60 pixels what is left is the rounding of codes, 3 pm each.
  EXPECT_NEAR(std::abs(phasor) * simulated_channels(settings)[0].scale, 0.7 * 50.0, 0.01);
  ASSERT_EQ(surface.size(), 60U);
  EXPECT_NEAR(surface.back(), -means[1] * 0.01,
              0.005);                 // height 0: the surface stands at -z, z in codes of 0.01 nm
  EXPECT_NE(surface.front(), -42.0);  // the approach has moved z already
}

TEST(SampleSource, TruthNamesEveryPixelOnceInTime) {
  SimulationSettings settings = small_instrument();
  settings.scene.kind = SceneSettings::Kind::blend;
  settings.scene.materials = {{{1.0}}, {{2.0}}};
  settings.scene.step_nm = 1.0;
  settings.scene.domain_nm = 20.0;
  settings.feedback.enabled = false;
  SampleSource source(settings);
  ScanLayout layout = small_layout();
  layout.bidirectional = true;
  const SceneMaps maps = make_scene(settings.scene, source.model(), layout);
  std::vector<PixelTruth> truths;
  source.truth = [&](const PixelTruth& truth) { truths.push_back(truth); };
  start_scan(source, settings, layout, 1);
  produce(source, 8 * 4000 + 30 * 4000 + 1, 5000);
  ASSERT_EQ(truths.size(), 30U);
  for (std::uint32_t i = 0; i < 30; ++i) {
    const PixelTruth& truth = truths[i];
    EXPECT_EQ(truth.line, i / 10);
    const bool trace = i / 5 % 2 == 0;
    EXPECT_EQ(truth.direction, trace ? Direction::trace : Direction::retrace);
    EXPECT_EQ(truth.column, trace ? i % 5 : 4 - i % 5);
    EXPECT_EQ(truth.first_sample, (8 + i) * 4000U);
    const std::size_t pixel = maps.index(truth.line, truth.column);
    EXPECT_EQ(truth.parameters,
              (std::vector<double>{maps.height_nm[pixel] - 42.0, maps.parameters[0][pixel]}));
  }
}

TEST(SampleSource, DriveChangesAtThePixelBoundary) {
  const SimulationSettings settings = small_instrument();
  SampleSource source(settings);
  start_scan(source, settings, small_layout(), 1);
  Produced scan = produce(source, 8 * 4000 + 1234, 1000);
  Drive weaker = settings.drive;
  weaker.total_amplitude_nm = 40.0;
  source.set_drive(weaker);
  scan = produce(source, 8000, 1000);
  ASSERT_EQ(scan.marks.size(), 1U);
  EXPECT_EQ(scan.marks[0].kind, StreamMark::Kind::step);
  EXPECT_EQ(scan.marks[0].sample, 9 * 4000U);
  // Free again, with the new drive, after 20 ring-down times.
  source.stop_scan();
  produce(source, 20000, 1000);
  scan = produce(source, 2000, 1000);
  double peak = 0.0;
  for (std::size_t i = 0; i < scan.codes.size(); i += 2)
    peak = std::max(peak, std::abs(static_cast<double>(scan.codes[i])));
  EXPECT_NEAR(peak * simulated_channels(settings)[0].scale, 40.0, 0.01);
}

TEST(SampleSource, ScanStopsAtThePixelBoundary) {
  const SimulationSettings settings = small_instrument();
  SampleSource source(settings);
  start_scan(source, settings, small_layout(), 0);
  produce(source, 8 * 4000 + 100, 1000);
  source.stop_scan();
  EXPECT_TRUE(source.scanning());
  const Produced rest = produce(source, 8000, 1000);
  ASSERT_EQ(rest.marks.size(), 1U);
  EXPECT_EQ(rest.marks[0].kind, StreamMark::Kind::scan_ended);
  EXPECT_EQ(rest.marks[0].sample, 9 * 4000U);
  EXPECT_FALSE(source.scanning());
}

// White noise of one-sided density a^2 has the variance a^2 fs/2. 200000 samples: 0.3 % scatter; 5 of them.
TEST(SampleSource, DetectorNoiseHasItsDensity) {
  SimulationSettings settings = small_instrument();
  settings.cantilever.modes[0].sensitivity_nm_per_v = 20.0;
  settings.drive.total_amplitude_nm = 1e-6;
  settings.volts_per_code = 1e-5;
  settings.detector_nm_per_sqrt_hz = 1e-3;
  SampleSource source(settings);
  const Produced free = produce(source, 200000, 4096);
  double square = 0.0;
  for (std::size_t i = 0; i < free.codes.size(); i += 2)
    square += std::pow(free.codes[i] * 1e-5 * 20.0, 2) / 200000.0;
  EXPECT_NEAR(square / (1e-6 * 1e6), 1.0, 0.016);
}

TEST(SampleSource, ConverterClips) {
  SimulationSettings settings = small_instrument();
  settings.volts_per_code = 40.0 / 32767.0;  // for a motion of 50
  SampleSource source(settings);
  const Produced free = produce(source, 2000, 1000);
  std::vector<std::int16_t> deflection;
  for (std::size_t i = 0; i < free.codes.size(); i += 2) deflection.push_back(free.codes[i]);
  EXPECT_EQ(*std::ranges::max_element(deflection), 32767);
  EXPECT_EQ(*std::ranges::min_element(deflection), -32768);
}

TEST(SampleSource, ClippedSpanReadsFullScaleAndLeavesZ) {
  SimulationSettings settings = small_instrument();
  settings.feedback.set_point = 0.5;
  const std::uint64_t start = 10 * 4000 + 3000;
  settings.faults = {{FaultSettings::Kind::clipped, start, 50, 0.0}};
  SampleSource source(settings);
  start_scan(source, settings, small_layout(), 1);
  const Produced scan = produce(source, 12UL * 4000, 777);
  for (std::uint64_t n = start - 50; n < start + 100; ++n) {
    EXPECT_EQ(scan.codes[2 * n] == 32767, n >= start && n < start + 50) << n;
  }
  const auto z = [&](std::uint64_t pixel) { return scan.codes[2 * (pixel * 4000) + 1]; };
  EXPECT_NE(z(9), z(10));   // the feedback works
  EXPECT_EQ(z(10), z(11));  // the clipped pixel is no measurement
}

TEST(SampleSource, WithoutZThereIsOneChannel) {
  SimulationSettings settings = small_instrument();
  settings.z_nm_per_code = 0.0;
  ASSERT_EQ(simulated_channels(settings).size(), 1U);
  SampleSource source(settings);
  EXPECT_EQ(produce(source, 1000, 100).codes.size(), 1000U);
}

TEST(SimulationSettings, BadValuesAreNamed) {
  const auto refused = [](auto change, const std::string& why) {
    SimulationSettings settings = small_instrument();
    change(settings);
    try {
      SampleSource source(settings);
      ADD_FAILURE() << "accepted; expected: " << why;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(why));
    }
  };
  refused([](auto& s) { s.sample_rate_hz = 0.0; }, "sample_rate_hz: 0");
  refused([](auto& s) { s.cantilever.modes.clear(); }, "modes");
  refused([](auto& s) { s.cantilever.modes[0].quality_factor = 0.5; },
          "quality_factor is 0.5, must be > 0.5");
  refused([](auto& s) { s.comb.tones[0].bin = 1000; }, "bin");
  refused([](auto& s) { s.comb.tones[0].driven = false; }, "comb.tones[0].driven");
  refused([](auto& s) { s.model = "jkr"; }, "jkr");
  refused([](auto& s) { s.model = "polynomial"; }, "polynomial");
  refused([](auto& s) { s.feedback.set_point = 1.0; }, "feedback.set_point: 1");
  refused([](auto& s) { s.feedback.gain = 0.0; }, "feedback.gain: 0");
  refused([](auto& s) { s.temperature_k = -1.0; }, "temperature_k: -1");
  refused([](auto& s) { s.volts_per_code = NAN; }, "volts_per_code: nan");
  refused([](auto& s) { s.block_frames = 0; }, "block_frames: 0");
  refused([](auto& s) { s.faults = {{FaultSettings::Kind::lost_block, 10, 0, 0.0}}; }, "faults[0].frames: 0");
  refused(
      [](auto& s) {
        s.faults = {{FaultSettings::Kind::stall, 10, 0, -1.0}};
      },
      "faults[0].duration_s: -1");
  refused(
      [](auto& s) {
        s.faults = {{FaultSettings::Kind::detuned, 10, 0, 0.0, 1e5}};
      },
      "faults[0].detuning_ppm: 100000");
  refused([](auto& s) { s.drive.total_amplitude_nm = 1e6; }, "must be <= 100000 nm");
  refused(
      [](auto& s) {
        s.faults = {{FaultSettings::Kind::lost_block, 10, 5, 0.0},
                    {FaultSettings::Kind::clipped, 14, 5, 0.0}};
      },
      "faults[1].sample: 14, must be >= 15");
}

}  // namespace combforce::test
