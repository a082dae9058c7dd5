#include "daemon/serve/server.hpp"

#include <gmock/gmock.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <thread>

#include "fake_instrument.hpp"
#include "proto/pixel_message.hpp"
#include "raw_client.hpp"

namespace combforce {
namespace {

class ServerTest : public testing::Test {
 protected:
  ServerTest() {
    fake_instrument() = {};
    fake_instrument().info.has_scanner = true;
    settings.unix_socket = (std::filesystem::temp_directory_path() /
                            ("combforce-server-" + std::to_string(::getpid()) + ".sock"))
                               .string();
    settings.port = 0;
    server.emplace(settings);
  }

  void run() {
    thread = std::thread([this] { server->run(instrument); });
  }
  void TearDown() override {
    if (thread.joinable()) {
      server->stop();
      thread.join();
    }
  }

  ServerSettings settings;
  std::optional<Server> server;
  const Configuration configuration;
  Instrument instrument{configuration, {}};
  std::thread thread;
};

// Something a pixel could look like, with what it refers to.
struct SomePixel {
  SomePixel() {
    analysis.description.comb = Comb{100, {{10, true}, {20, true}}};
    analysis.description.channels = Channels{{"deflection", ChannelRole::deflection, "V", 1.0, 0.0, {}},
                                             {"z", ChannelRole::z, "nm", 1.0, 0.0, {}}};
    analysis.model = &find_model("hertz");
    pixel.span.line = 4;
    pixel.span.first_sample = 12345;
    pixel.channel_means = {0.0, 38.5};
    fit = unfitted(FitStatus::converged, 2);
    fit.parameters = {-40.0, 1.0};
  }

  RetiredPixel retired() const { return {pixel, tones, fit, analysis, 0.0}; }
  std::string line(PixelFields fields) const {
    std::string out;
    append_pixel_line(
        out, {pixel, *analysis.description.comb, *analysis.description.channels, tones, analysis.model, fit},
        fields);
    out.pop_back();
    return out;
  }

  Pixel pixel;
  FitResult fit;
  Analysis analysis;
  std::vector<std::complex<double>> tones{{1.0, 2.0}, {3.0, 4.0}};
};

constexpr const char* subscribe_all =
    R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["pixel","line","frame","status","event"]}})";

TEST_F(ServerTest, PixelsAreTheContractsBytes) {
  run();
  RawClient all = RawClient::to_unix(settings.unix_socket), fit = RawClient::to_unix(settings.unix_socket);
  all.ask(R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["pixel"]}})");
  fit.ask(R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["pixel"],"tones":false}})");
  const SomePixel pixel;
  server->publish_pixel(pixel.retired());
  EXPECT_EQ(all.line(), pixel.line(PixelFields::all));
  EXPECT_EQ(fit.line(), pixel.line(PixelFields::fit));
}

TEST_F(ServerTest, TellsOfLinesFramesEventsAndItsStatus) {
  fake_instrument().status.sample = 42;
  run();
  RawClient client = RawClient::to_unix(settings.unix_socket);
  client.ask(subscribe_all);
  LineDone line;
  line.mark = {1, 2, Direction::retrace, 300, 400};
  line.counts.pixels = 32;
  line.counts.by_status[0] = 31;
  line.counts.by_status[4] = 1;
  server->publish_line(line);
  server->publish_frame({1, line.counts, true});
  server->publish_event({"gap", 500, 600, "the source lost frames"});
  const std::string counts =
      R"("counts":{"pixels":32,"status":{"converged":31,"not_converged":0,"at_bound":0,"ill_conditioned":0,)"
      R"("no_contact":1,"no_free_response":0,"not_fitted":0,"flagged":0,"misfit":0,"ambiguous":0},"settling_residual":0.0})";
  EXPECT_EQ(client.line(),
            R"({"jsonrpc":"2.0","method":"line","params":{"frame":1,"line":2,"direction":"retrace",)"
            R"("first_sample":300,"line_samples":400,)" +
                counts + "}}");
  EXPECT_EQ(client.line(),
            R"({"jsonrpc":"2.0","method":"frame","params":{"frame":1,)" + counts + R"(,"whole":true}})");
  EXPECT_EQ(client.line(),
            R"({"jsonrpc":"2.0","method":"event","params":{"kind":"gap","first_sample":500,"count":600,)"
            R"("text":"the source lost frames"}})");
  const Json status = parse_json(client.line().value_or("{}"), "");  // within a second
  EXPECT_EQ(status.value("method", ""), "status");
  EXPECT_EQ(status["params"]["sample"], 42);
}

TEST_F(ServerTest, ListensOnTcpOnlyWhereConfigured) {
  EXPECT_EQ(server->tcp_endpoint(), "");
}

TEST_F(ServerTest, PublishingNeedsNoClient) {
  server->publish_pixel(SomePixel().retired());
  server->publish_event({"gap", 1, 1, ""});
}

TEST_F(ServerTest, WhatTheInstrumentPutsOutWhileItStopsReachesTheClients) {
  const SomePixel pixel;
  fake_instrument().on_stop = [this, &pixel] {
    server->publish_pixel(pixel.retired());
    server->publish_event({"stream_ended", 500, 0, ""});
  };
  server->stop_on_signals();
  run();
  RawClient client = RawClient::to_unix(settings.unix_socket);
  client.ask(subscribe_all);
  ::kill(::getpid(), SIGTERM);
  thread.join();
  EXPECT_EQ(client.line(), pixel.line(PixelFields::all));
  EXPECT_EQ(
      client.line(),
      R"({"jsonrpc":"2.0","method":"event","params":{"kind":"stream_ended","first_sample":500,"count":0,)"
      R"("text":""}})");
  EXPECT_EQ(client.line(), std::nullopt);
}

// One client takes nothing of what is still due: that holds up nobody for more than the half second.
TEST_F(ServerTest, AClientThatStopsReadingDoesNotHoldUpTheStop) {
  const SomePixel pixel;
  fake_instrument().on_stop = [this, &pixel] {
    for (int i = 0; i < 10000; ++i) server->publish_pixel(pixel.retired());
  };
  run();
  RawClient idle = RawClient::to_unix(settings.unix_socket);
  idle.ask(subscribe_all);
  server->stop();
  thread.join();
}

TEST_F(ServerTest, StopsOnSigterm) {
  server->stop_on_signals();
  run();
  RawClient client = RawClient::to_unix(settings.unix_socket);
  client.ask(subscribe_all);
  ::kill(::getpid(), SIGTERM);
  thread.join();
  EXPECT_EQ(client.line(), std::nullopt);
  EXPECT_FALSE(std::filesystem::exists(settings.unix_socket));
}

}  // namespace
}  // namespace combforce
