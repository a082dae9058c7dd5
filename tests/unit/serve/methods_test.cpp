#include "daemon/serve/methods.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "daemon/serve/json_schema.hpp"
#include "fake_instrument.hpp"

namespace combforce {
namespace {

class Methods : public testing::Test {
 protected:
  Methods() {
    fake_instrument() = {};
    fake.info.name = "fake";
    fake.info.sample_rate_hz = 50e6;
    fake.info.has_scanner = fake.info.has_drive = fake.info.marks_lines = true;
    ScanLayout scan;
    scan.lines = 64;
    scan.columns = 32;
    scan.pixel_samples = 100000;
    fake.description.scan = fake.configured_scan = scan;
  }

  // A table as of now: what is in it depends on what the digitizer can.
  RpcTable& table() {
    if (!table_) {
      table_.emplace("Test", "1");
      add_methods(*table_, instrument,
                  [this](std::function<void()> task) { posted.push_back(std::move(task)); });
    }
    return *table_;
  }
  Json ask(const std::string& method, const Json& params = Json::object()) {
    std::string reply = "null";
    table().handle(Json{{"jsonrpc", "2.0"}, {"id", 1}, {"method", method}, {"params", params}}.dump(), caller,
                   [&reply](std::string line) { reply = std::move(line); });
    return parse_json(reply, "");
  }
  Json result(const std::string& method, const Json& params = Json::object()) {
    const Json reply = ask(method, params);
    EXPECT_TRUE(reply.contains("result")) << reply.dump();
    return reply.value("result", Json());
  }
  void expect_pointer(const std::string& method, const Json& params, const std::string& pointer) {
    const Json reply = ask(method, params);
    ASSERT_TRUE(reply.contains("error")) << method << params.dump();
    EXPECT_EQ(reply["error"]["code"], rpc_invalid_params) << reply.dump();
    EXPECT_EQ(reply["error"]["data"]["pointer"], pointer) << reply.dump();
  }
  std::vector<std::string> names() {
    std::vector<std::string> all;
    const Json document = table().discover();
    for (const Json& method : document["methods"]) all.push_back(method["name"]);
    return all;
  }

  FakeInstrument& fake = fake_instrument();
  const Configuration configuration;
  Instrument instrument{configuration, {}};
  Subscriptions caller;
  std::vector<std::function<void()>> posted;

 private:
  std::optional<RpcTable> table_;
};

TEST_F(Methods, ListsWhatWorksHere) {
  EXPECT_THAT(names(), testing::UnorderedElementsAre("rpc.discover", "instrument.info", "instrument.status",
                                                     "scan.start", "scan.stop", "record.start", "record.stop",
                                                     "free.capture", "free.cancel", "drive.get", "drive.set",
                                                     "model.list", "model.set", "subscribe", "unsubscribe"));
}

TEST_F(Methods, ListsNoScannerAndNoDriveWhereThereIsNone) {
  fake.info.has_scanner = fake.info.has_drive = fake.info.marks_lines = false;
  EXPECT_THAT(names(), testing::UnorderedElementsAre("rpc.discover", "instrument.info", "instrument.status",
                                                     "scan.line", "record.start", "record.stop",
                                                     "free.capture", "free.cancel", "model.list", "model.set",
                                                     "subscribe", "unsubscribe"));
  EXPECT_EQ(ask("scan.start")["error"]["code"], rpc_method_not_found);
}

// Every schema shown is one that is enforced: an unknown keyword in it would throw.
TEST_F(Methods, RefusesUnknownParametersEverywhere) {
  for (const std::string& name : names()) {
    const Json reply = ask(name, {{"surprise", 1}});
    ASSERT_TRUE(reply.contains("error")) << name;
    EXPECT_EQ(reply["error"]["code"], rpc_invalid_params) << reply.dump();
  }
}

TEST_F(Methods, InfoSaysWhatIsConfigured) {
  fake.description.comb = Comb{50000, {{117, true}}};
  const Json info = result("instrument.info");
  EXPECT_EQ(info["name"], "combforced");
  EXPECT_EQ(info["protocol"], 1);
  EXPECT_EQ(info["sample_rate_hz"], 50e6);
  EXPECT_EQ(info["scan"]["lines"], 64);
  EXPECT_EQ(info["comb"]["window_samples"], 50000);
  EXPECT_EQ(info["digitizer"]["name"], "fake");
  EXPECT_EQ(info["digitizer"]["has_scanner"], true);
  EXPECT_EQ(info["models"][0]["name"], "hertz");
}

TEST_F(Methods, StatusSaysWhereItStands) {
  fake.status.sample = 123;
  fake.status.stream.state = StreamState::failed;
  fake.status.stream.reason = "unplugged";
  fake.status.dropped_extraction = 7;
  fake.status.pipeline.not_fitted = 3;
  const Json status = result("instrument.status");
  EXPECT_EQ(status["sample"], 123);
  EXPECT_EQ(status["state"], "failed");
  EXPECT_EQ(status["reason"], "unplugged");
  EXPECT_EQ(status["dropped_extraction"], 7);
  EXPECT_EQ(status["not_fitted"], 3);
  EXPECT_EQ(status["record"], nullptr);
  fake.status.record.meta_path = "a.sigmf-meta";
  EXPECT_EQ(result("instrument.status")["record"]["meta_path"], "a.sigmf-meta");
}

TEST_F(Methods, ScansAsConfiguredOrAsAsked) {
  result("scan.start");
  EXPECT_FALSE(fake.scan_layout);
  EXPECT_EQ(fake.scan_frames, 1U);
  result("scan.start", {{"frames", 0}, {"lines", 8}});
  ASSERT_TRUE(fake.scan_layout);
  EXPECT_EQ(fake.scan_layout->lines, 8U);
  EXPECT_EQ(fake.scan_layout->columns, 32U) << "the rest stays as configured";
  EXPECT_EQ(fake.scan_frames, 0U);
  EXPECT_TRUE(fake.scanning);
  result("scan.stop");
  EXPECT_FALSE(fake.scanning);
}

TEST_F(Methods, WhatAScanDoesNotSayIsAsConfiguredNotAsItLastWas) {
  fake.description.scan->columns = 7;
  result("scan.start", {{"lines", 8}});
  ASSERT_TRUE(fake.scan_layout);
  EXPECT_EQ(fake.scan_layout->columns, 32U);
}

TEST_F(Methods, ScanErrorsNameTheParameter) {
  expect_pointer("scan.start", {{"lines", 0}}, "/lines");
  expect_pointer("scan.start", {{"frames", -1}}, "/frames");
  expect_pointer("scan.start", {{"frames", 4294967296}}, "/frames");
  expect_pointer("scan.start", {{"bidirectional", "yes"}}, "/bidirectional");
  expect_pointer("scan.start", {{"size_nm", {1, "x"}}}, "/size_nm/1");
  expect_pointer("scan.start", {{"size_nm", {1}}}, "/size_nm");
  EXPECT_FALSE(fake.scanning);
}

TEST_F(Methods, MarksLines) {
  fake.info.marks_lines = false;
  result("scan.line", {{"line", 3}, {"direction", "retrace"}, {"first_sample", 1000}, {"line_samples", 500}});
  ASSERT_EQ(fake.lines.size(), 1U);
  EXPECT_EQ(fake.lines[0], (LineMark{0, 3, Direction::retrace, 1000, 500}));
  expect_pointer("scan.line", {{"line", 3}, {"first_sample", 0}, {"line_samples", 0}}, "/line_samples");
  expect_pointer("scan.line", {{"line", 3}, {"direction", "up"}, {"first_sample", 0}, {"line_samples", 9}},
                 "/direction");
  expect_pointer("scan.line", {{"line", 3}, {"line_samples", 9}}, "/first_sample");
}

TEST_F(Methods, RecordsOnlyWhereConfigured) {
  EXPECT_EQ(result("record.start", {{"name", "first_1.2"}})["meta_path"], "first_1.2.sigmf-meta");
  result("record.start");
  EXPECT_THAT(fake.recordings, testing::ElementsAre("first_1.2", ""));
  for (const char* bad : {"", "../x", "a/b", ".hidden", "-x", "a b"})
    expect_pointer("record.start", {{"name", bad}}, "/name");
  expect_pointer("record.start", {{"name", std::string(201, 'a')}}, "/name");
  fake.status.record.frames = 99;
  EXPECT_EQ(result("record.stop")["frames"], 99);
}

TEST_F(Methods, FreeCaptureAnswersOnTheIoThreadWhenItIsDone) {
  EXPECT_EQ(ask("free.capture", {{"windows", 5}}), nullptr) << "not yet";
  EXPECT_EQ(fake.free_windows, 5U);
  EXPECT_EQ(fake.free_height, Instrument::Height::far);
  FreeResponse response;
  response.first_sample = 77;
  response.windows = 5;
  response.mean_nm = {{1.0, -2.0}};
  std::string reply;
  table().handle(R"({"jsonrpc":"2.0","id":8,"method":"free.capture"})", caller,
                 [&reply](std::string line) { reply = std::move(line); });
  EXPECT_EQ(fake.free_windows, 16U);
  fake.free_done(response, "");
  EXPECT_EQ(reply, "") << "the output thread must not answer";
  ASSERT_EQ(posted.size(), 1U);
  posted[0]();
  const Json message = parse_json(reply, "");
  EXPECT_EQ(message["id"], 8);
  EXPECT_EQ(message["result"]["first_sample"], 77);
  EXPECT_EQ(message["result"]["mean_nm"], Json::parse("[[1.0,-2.0]]"));
  expect_pointer("free.capture", {{"windows", 0}}, "/windows");
}

TEST_F(Methods, FreeCaptureMayBeOfTheLiftedTip) {
  ask("free.capture", {{"lifted", true}});
  EXPECT_EQ(fake.free_height, Instrument::Height::lifted);
  expect_pointer("free.capture", {{"lifted", 1}}, "/lifted");
}

TEST_F(Methods, FreeCaptureIsGivenUpWhenItsClientIsGoneOrOnRequest) {
  ask("free.capture", {{"windows", 1000000}});
  const Subscriptions other;
  table().gone(other);
  EXPECT_EQ(fake.free_cancelled, 0) << "another client's";
  table().gone(caller);
  EXPECT_EQ(fake.free_cancelled, 1);
  table().gone(caller);
  EXPECT_EQ(fake.free_cancelled, 1);
  result("free.cancel");
  EXPECT_EQ(fake.free_cancelled, 2);
}

TEST_F(Methods, FreeCaptureSaysWhyNot) {
  std::string reply;
  table().handle(R"({"jsonrpc":"2.0","id":8,"method":"free.capture"})", caller,
                 [&reply](std::string line) { reply = std::move(line); });
  fake.free_done(std::nullopt, "a gap");
  posted.at(0)();
  EXPECT_EQ(parse_json(reply, "")["error"]["code"], rpc_instrument_error);
  EXPECT_EQ(parse_json(reply, "")["error"]["message"], "a gap");
}

TEST_F(Methods, SetsTheDrive) {
  const Json drive = result("drive.set", {{"scheme", "equal_amplitude"}, {"total_amplitude_nm", 30}});
  EXPECT_EQ(fake.drive.scheme, DriveScheme::equal_amplitude);
  EXPECT_EQ(drive["total_amplitude_nm"], 30);
  EXPECT_EQ(result("drive.get"), drive);
  expect_pointer("drive.set", {{"scheme", "loud"}}, "/scheme");
  expect_pointer("drive.set", {{"total_amplitude_nm", -1}}, "/total_amplitude_nm");
  expect_pointer("drive.set", {{"phases_rad", {0, "x"}}}, "/phases_rad/1");
  EXPECT_EQ(fake.drive.total_amplitude_nm, 30);
}

TEST_F(Methods, ListsAndSetsModels) {
  const Json list = result("model.list");
  EXPECT_EQ(list["models"][1]["name"], "dmt");
  EXPECT_EQ(list["models"][1]["parameters"][2]["name"], "adhesion_nn");
  EXPECT_EQ(list["fit"], nullptr);
  result("model.set", {{"model", "hertz"}, {"bounds", {{"surface_position_nm", {-60, 10}}}}});
  ASSERT_TRUE(fake.fit);
  EXPECT_EQ(fake.fit->model, "hertz");
  ASSERT_EQ(fake.fit->bounds.size(), 1U);
  EXPECT_EQ(fake.fit->bounds[0].lower, -60);
  expect_pointer("model.set", {{"model", "glue"}}, "/model");
  expect_pointer("model.set", {{"model", "dmt"}, {"refine", -1}}, "/refine");
  expect_pointer("model.set", {{"model", "dmt"}, {"bounds", {{"nonsense", {0, 1}}}}}, "/bounds/nonsense");
}

TEST_F(Methods, SubscriptionsAddAndGo) {
  EXPECT_EQ(result("subscribe", {{"topics", {"pixel", "event"}}}),
            Json::parse(R"({"topics":["pixel","event"],"tones":true,"every":1,"spectrum_hz":1.0})"));
  EXPECT_EQ(result("subscribe", {{"topics", {"line"}}, {"tones", false}, {"every", 4}}),
            Json::parse(R"({"topics":["pixel","line","event"],"tones":false,"every":4,"spectrum_hz":1.0})"));
  EXPECT_TRUE(caller.has(Topic::line));
  EXPECT_EQ(result("unsubscribe", {{"topics", {"pixel", "frame"}}})["topics"],
            Json::parse(R"(["line","event"])"));
  expect_pointer("subscribe", {{"topics", {"pixel", "spectra"}}}, "/topics/1");
  expect_pointer("subscribe", {{"topics", "pixel"}}, "/topics");
  expect_pointer("subscribe", {{"topics", {"pixel"}}, {"every", 0}}, "/every");
  EXPECT_FALSE(caller.has(Topic::pixel));
}

TEST_F(Methods, WhatTheInstrumentCannotIsItsError) {
  fake.refuse = "already recording";
  const Json reply = ask("record.start");
  EXPECT_EQ(reply["error"]["code"], rpc_instrument_error);
  EXPECT_EQ(reply["error"]["message"], "already recording");
}

}  // namespace
}  // namespace combforce
