#include "daemon/recorded_description.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <complex>
#include <optional>
#include <utility>
#include <vector>

namespace combforce {
namespace {

using Complex = std::complex<double>;

constexpr double sample_rate_hz = 1e6;

// Modes of different sensitivities: (chi/chi_V) is complex, and not the same at two tones.
Cantilever cantilever(double first, double second) {
  return {.modes = {{100e3, 20.0, 2.0, first}, {300e3, 30.0, 40.0, second}}};
}

FreeResponse free_response(std::vector<Complex> mean_nm) {
  FreeResponse response;
  response.windows = 4;
  response.mean_nm = std::move(mean_nm);
  return response;
}

Description recorded() {
  Description description;
  description.cantilever = cantilever(10.0, 25.0);
  description.comb = Comb{1000, {{100}, {200}, {300}}};
  description.free_response = free_response({{1.0, 2.0}, {0.1, -0.3}, {-2.0, 0.5}});
  description.noise = Noise{300.0, {1e-3}};
  return description;
}

Complex turn(double frequency_hz, const Cantilever& from, const Cantilever& to) {
  return tip_per_volt(to, frequency_hz) / tip_per_volt(from, frequency_hz);
}

TEST(RecordedDescription, StaysAsItIsUnderTheSame) {
  EXPECT_EQ(under_configuration(recorded(), {}, sample_rate_hz), recorded());
  Description same;
  same.cantilever = recorded().cantilever;
  same.comb = recorded().comb;
  EXPECT_EQ(under_configuration(recorded(), same, sample_rate_hz), recorded());
}

TEST(RecordedDescription, TurnsWhatWasVoltsIntoOtherNanometres) {
  Description configured;
  configured.cantilever = cantilever(12.0, 20.0);
  configured.comb = Comb{2000, {{600}, {200}}};  // of 300 and 100 kHz
  const Description under = under_configuration(recorded(), configured, sample_rate_hz);
  const Complex first = turn(300e3, *recorded().cantilever, *configured.cantilever),
                second = turn(100e3, *recorded().cantilever, *configured.cantilever);
  ASSERT_GT(std::abs(first.imag()), 1e-3);
  ASSERT_EQ(under.free_response->mean_nm.size(), 2U);
  EXPECT_NEAR(std::abs(under.free_response->mean_nm[0] - first * Complex(-2.0, 0.5)), 0.0, 1e-14);
  EXPECT_EQ(under.free_response->windows, 2U);  // as long as four of the recording's
  EXPECT_NEAR(std::abs(under.free_response->mean_nm[1] - second * Complex(1.0, 2.0)), 0.0, 1e-14);
  EXPECT_THAT(under.noise->detector_nm_per_sqrt_hz,
              testing::ElementsAre(testing::DoubleNear(1e-3 * std::abs(first), 1e-16),
                                   testing::DoubleNear(1e-3 * std::abs(second), 1e-16)));
}

// The covariance of a few motions is that of the same motions turned one by one.
TEST(RecordedDescription, TurnsCovariancesAsMotions) {
  const std::vector<std::vector<Complex>> motions{{{0.3, -0.1}, {0.2, 0.7}, {-0.4, 0.5}},
                                                  {{-0.6, 0.2}, {0.1, 0.1}, {0.9, 0.3}}};
  const auto covariance = [](const std::vector<std::vector<Complex>>& all) {
    const std::size_t size = 2 * all.front().size();
    std::vector<double> sum(size * size);
    for (const auto& motion : all) {
      const auto* values = reinterpret_cast<const double*>(motion.data());
      for (std::size_t i = 0; i < size; ++i)
        for (std::size_t j = 0; j < size; ++j) sum[i * size + j] += values[i] * values[j];
    }
    return sum;
  };
  Description description = recorded(), configured;
  description.free_response->covariance = covariance(motions);
  description.free_response->lifted_nm = motions[0];
  configured.cantilever = cantilever(12.0, 20.0);
  configured.comb = Comb{1000, {{300}, {200}}};
  std::vector<std::vector<Complex>> turned;
  for (const auto& motion : motions)
    turned.push_back({turn(300e3, *description.cantilever, *configured.cantilever) * motion[2],
                      turn(200e3, *description.cantilever, *configured.cantilever) * motion[1]});
  const Description under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_THAT(*under.free_response->covariance,
              testing::Pointwise(testing::DoubleNear(1e-14), covariance(turned)));
  ASSERT_EQ(under.free_response->lifted_nm->size(), 2U);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(std::abs((*under.free_response->lifted_nm)[i] - turned[0][i]), 0.0, 1e-14);
}

TEST(RecordedDescription, HasNoFreeResponseOfToneNeverCaptured) {
  Description description = recorded(), configured;
  description.noise->detector_nm_per_sqrt_hz = {1e-3, 2e-3, 3e-3};
  configured.comb = Comb{1000, {{280}, {100}}};
  const Description under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_FALSE(under.free_response);
  EXPECT_THAT(under.noise->detector_nm_per_sqrt_hz, testing::ElementsAre(3e-3, 1e-3));
}

// A preamplifier of another gain, described afterwards.
TEST(RecordedDescription, KnowsChannelsByTheirVolts) {
  Description description = recorded(), configured;
  const auto channel = [](double scale, std::optional<double> nm_per_v) {
    Channel deflection;
    deflection.name = "deflection";
    deflection.scale = scale;
    deflection.nm_per_v = nm_per_v;
    return Channels{deflection};
  };
  description.channels = channel(1.0, 10.0);
  configured.channels = channel(-2.0, 15.0);
  const Complex mean_nm = description.free_response->mean_nm[1];
  // With a cantilever its sensitivities hold, without one the channel's.
  Description under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_NEAR(std::abs(under.free_response->mean_nm[1] + 2.0 * mean_nm), 0.0, 1e-15);
  EXPECT_NEAR(under.noise->detector_nm_per_sqrt_hz[1], 2e-3, 1e-15);
  description.cantilever.reset();
  under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_NEAR(std::abs(under.free_response->mean_nm[1] + 3.0 * mean_nm), 0.0, 1e-15);
  // Of a channel to a cantilever.
  configured.cantilever = cantilever(30.0, 30.0);
  under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_NEAR(std::abs(under.free_response->mean_nm[1] + 6.0 * mean_nm), 0.0, 1e-15);
  // Nothing was told of volts: nm they are.
  description.channels.reset();
  under = under_configuration(description, configured, sample_rate_hz);
  EXPECT_EQ(under.free_response->mean_nm[1], mean_nm);
}

// Each capture with what the recording says from there on.
TEST(RecordedDescription, CarriesWhatChangesAlongTheStream) {
  SigmfMeta meta;
  meta.sample_rate_hz = sample_rate_hz;
  meta.description = recorded();
  SigmfCapture first, second;
  second.global_index = 5000;
  second.changes.free_response = free_response({1.0, {0.0, 2.0}, 3.0});
  meta.captures = {first, second};
  Description configured;
  configured.comb = Comb{1000, {{200}}};
  const auto changes = changes_of(meta, configured);
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].first_sample, 5000U);
  EXPECT_THAT(changes[0].description.free_response->mean_nm, testing::ElementsAre(Complex(0.0, 2.0)));
}

TEST(RecordedDescription, LeavesAloneWhatIsConfigured) {
  Description configured;
  configured.cantilever = cantilever(12.0, 20.0);
  configured.free_response = free_response({1.0, 2.0, 3.0});
  configured.noise = Noise{290.0, {2e-3}};
  const Description under = under_configuration(recorded(), configured, sample_rate_hz);
  EXPECT_EQ(under.free_response, configured.free_response);
  EXPECT_EQ(under.noise, configured.noise);
}

}  // namespace
}  // namespace combforce
