#include "daemon/serve/rpc.hpp"

#include <gmock/gmock.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace combforce {
namespace {

Json object_of(Json properties) {
  return {{"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
}

class Rpc : public testing::Test {
 protected:
  Rpc() {
    table.add({"add",
               "a + b",
               object_of({{"a", {{"type", "integer"}}}, {"b", {{"type", "integer"}, {"maximum", 9}}}}),
               {{"type", "integer"}},
               RpcHandler([this](const JsonView& params, Subscriptions&) -> Json {
                 ++calls;
                 return params.get("a").integer() + params.get("b").integer();
               })});
    table.add({"fail",
               "throws",
               object_of(Json::object()),
               {},
               RpcHandler([](const JsonView&, Subscriptions&) -> Json {
                 throw std::runtime_error("the disk is full");
               })});
    table.add({"refuse",
               "throws",
               object_of(Json::object()),
               {},
               RpcHandler([](const JsonView&, Subscriptions&) -> Json {
                 throw std::invalid_argument("gain: 3 is above 2");
               })});
    table.add({"later",
               "answers later",
               object_of(Json::object()),
               {},
               RpcDeferredHandler([this](const JsonView&, const Subscriptions&, RpcRespond respond) {
                 later.push_back(std::move(respond));
               })});
  }

  void send(const std::string& line) {
    table.handle(line, caller, [this](std::string reply) { replies.push_back(std::move(reply)); });
  }
  // The one reply to `line`, parsed.
  Json ask(const std::string& line) {
    replies.clear();
    send(line);
    EXPECT_EQ(replies.size(), 1U) << line;
    if (replies.size() != 1) return nullptr;
    EXPECT_EQ(replies[0].back(), '\n');
    EXPECT_EQ(replies[0].find('\n'), replies[0].size() - 1) << "one line a message";
    return parse_json(replies[0], "");
  }
  void expect_error(const std::string& line, int code, const Json& id) {
    const Json reply = ask(line);
    EXPECT_EQ(reply.value("jsonrpc", ""), "2.0") << line;
    EXPECT_EQ(reply.at("error").at("code"), code) << reply.dump();
    EXPECT_EQ(reply.at("id"), id) << reply.dump();
    EXPECT_FALSE(reply.contains("result"));
  }

  RpcTable table{"Test", "1"};
  Subscriptions caller;
  std::vector<std::string> replies;
  std::vector<RpcRespond> later;
  int calls = 0;
};

TEST_F(Rpc, AnswersWithTheIdAsItCame) {
  for (const char* id : {"1", "-7", "2.5", "\"x\"", "null"}) {
    const Json reply =
        ask(std::string(R"({"jsonrpc":"2.0","id":)") + id + R"(,"method":"add","params":{"a":1,"b":2}})");
    EXPECT_EQ(reply.at("result"), 3);
    EXPECT_EQ(reply.at("id").dump(), id);
  }
}

TEST_F(Rpc, SaysNothingToNotificationsWhateverHappens) {
  send(R"({"jsonrpc":"2.0","method":"add","params":{"a":1,"b":2}})");
  EXPECT_EQ(calls, 1);
  send(R"({"jsonrpc":"2.0","method":"add","params":{"a":"x"}})");
  send(R"({"jsonrpc":"2.0","method":"nowhere"})");
  send(R"({"jsonrpc":"2.0","method":"fail"})");
  send(R"([{"jsonrpc":"2.0","method":"fail"},{"jsonrpc":"2.0","method":"add","params":{"a":1,"b":2}}])");
  EXPECT_EQ(calls, 2);
  EXPECT_TRUE(replies.empty());
}

TEST_F(Rpc, ParseErrors) {
  expect_error("{\"jsonrpc\":", rpc_parse_error, nullptr);
  expect_error("hello", rpc_parse_error, nullptr);
  expect_error("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"\xff\"}", rpc_parse_error, nullptr);
  expect_error(std::string(100000, '['), rpc_parse_error, nullptr);
  // A duplicate key is refused rather than decided.
  expect_error(R"({"jsonrpc":"2.0","id":1,"method":"add","params":{"a":1,"b":2,"a":3}})", rpc_parse_error,
               nullptr);
  EXPECT_EQ(calls, 0);
}

TEST_F(Rpc, InvalidRequests) {
  expect_error("1", rpc_invalid_request, nullptr);
  expect_error("{}", rpc_invalid_request, nullptr);
  expect_error(R"({"id":1,"method":"add"})", rpc_invalid_request, 1);
  expect_error(R"({"jsonrpc":"1.0","id":1,"method":"add"})", rpc_invalid_request, 1);
  expect_error(R"({"jsonrpc":"2.0","id":1})", rpc_invalid_request, 1);
  expect_error(R"({"jsonrpc":"2.0","id":1,"method":3})", rpc_invalid_request, 1);
  expect_error(R"({"jsonrpc":"2.0","id":[1],"method":"add"})", rpc_invalid_request, nullptr);
  expect_error(R"({"jsonrpc":"2.0","id":true,"method":"add"})", rpc_invalid_request, nullptr);
  expect_error(R"({"jsonrpc":"2.0","id":1,"method":"add","params":3})", rpc_invalid_request, 1);
  expect_error(R"({"jsonrpc":"2.0","id":1,"method":"add","parms":{}})", rpc_invalid_request, 1);
}

TEST_F(Rpc, UnknownMethods) {
  expect_error(R"({"jsonrpc":"2.0","id":1,"method":"nowhere"})", rpc_method_not_found, 1);
}

TEST_F(Rpc, InvalidParametersCarryThePointer) {
  const auto pointer_of = [this](const std::string& params) {
    const Json reply = ask(R"({"jsonrpc":"2.0","id":1,"method":"add","params":)" + params + "}");
    EXPECT_EQ(reply.at("error").at("code"), rpc_invalid_params);
    return reply.at("error").at("data").at("pointer");
  };
  EXPECT_EQ(pointer_of(R"({"a":"x","b":1})"), "/a");
  EXPECT_EQ(pointer_of(R"({"a":1,"b":10})"), "/b");
  EXPECT_EQ(pointer_of(R"({"a":1,"b":1,"c":1})"), "/c");
  EXPECT_EQ(pointer_of("[1,2]"), "");                // by name only
  EXPECT_EQ(pointer_of(R"({"a":-1,"b":1})"), "/a");  // found by the handler
  EXPECT_EQ(calls, 1) << "only the last one passed the schema";

  const Json reply = ask(R"({"jsonrpc":"2.0","id":1,"method":"refuse"})");
  EXPECT_EQ(reply.at("error").at("code"), rpc_invalid_params);
  EXPECT_EQ(reply.at("error").at("message"), "gain: 3 is above 2");
}

TEST_F(Rpc, InstrumentErrorsCarryTheirMessage) {
  const Json reply = ask(R"({"jsonrpc":"2.0","id":1,"method":"fail"})");
  EXPECT_EQ(reply.at("error").at("code"), rpc_instrument_error);
  EXPECT_EQ(reply.at("error").at("message"), "the disk is full");
}

TEST_F(Rpc, AnswersABatchInOneLineInItsOrder) {
  const Json reply = ask(R"([{"jsonrpc":"2.0","id":"a","method":"add","params":{"a":1,"b":1}},)"
                         R"({"jsonrpc":"2.0","method":"add","params":{"a":1,"b":1}},)"
                         R"(7,)"
                         R"({"jsonrpc":"2.0","id":"b","method":"nowhere"}])");
  ASSERT_EQ(reply.size(), 3U);
  EXPECT_EQ(reply[0].at("result"), 2);
  EXPECT_EQ(reply[0].at("id"), "a");
  EXPECT_EQ(reply[1].at("error").at("code"), rpc_invalid_request);
  EXPECT_EQ(reply[1].at("id"), nullptr);
  EXPECT_EQ(reply[2].at("error").at("code"), rpc_method_not_found);
  EXPECT_EQ(calls, 2);
}

TEST_F(Rpc, RefusesEmptyAndEndlessBatches) {
  expect_error("[]", rpc_invalid_request, nullptr);
  std::string batch = "[1";
  for (std::size_t i = 0; i < RpcTable::max_batch; ++i) batch += ",1";
  expect_error(batch + "]", rpc_invalid_request, nullptr);
}

TEST_F(Rpc, AnswersLaterAndABatchWithItsLastAnswer) {
  send(R"({"jsonrpc":"2.0","id":1,"method":"later"})");
  send(
      R"([{"jsonrpc":"2.0","id":2,"method":"later"},{"jsonrpc":"2.0","id":3,"method":"add","params":{"a":1,"b":1}}])");
  EXPECT_TRUE(replies.empty());
  ASSERT_EQ(later.size(), 2U);
  later[1](Json(5));
  ASSERT_EQ(replies.size(), 1U);
  const Json batch = parse_json(replies[0], "");
  EXPECT_EQ(batch[0].at("result"), 5);
  EXPECT_EQ(batch[1].at("result"), 2);
  later[0](RpcError{rpc_instrument_error, "a gap", nullptr});
  ASSERT_EQ(replies.size(), 2U);
  EXPECT_EQ(parse_json(replies[1], "").at("error").at("message"), "a gap");
}

TEST_F(Rpc, DiscoverListsExactlyTheTable) {
  const Json document = ask(R"({"jsonrpc":"2.0","id":1,"method":"rpc.discover"})").at("result");
  EXPECT_EQ(document.at("openrpc"), "1.2.6");
  std::vector<std::string> names;
  for (const Json& method : document.at("methods")) names.push_back(method.at("name"));
  EXPECT_THAT(names, testing::ElementsAre("rpc.discover", "add", "fail", "refuse", "later"));
  const Json& add = document.at("methods")[1];
  EXPECT_EQ(add.at("params")[1].at("name"), "b");
  EXPECT_EQ(add.at("params")[1].at("schema").at("maximum"), 9);
  EXPECT_EQ(add.at("paramStructure"), "by-name");
}

TEST_F(Rpc, RefusesAMethodTwice) {
  EXPECT_THROW(table.add({"add", "", {}, {}, RpcHandler()}), std::logic_error);
}

}  // namespace
}  // namespace combforce
