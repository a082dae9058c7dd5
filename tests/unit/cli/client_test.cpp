#include "daemon/cli/client.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "daemon/serve/socket_server.hpp"

namespace combforce {
namespace {

using std::chrono::milliseconds;

// A server with trivial methods, on both kinds of socket.
class ClientTest : public testing::Test {
 protected:
  ClientTest() {
    const Json anything{{"type", "object"}};
    table.add({"echo", "", anything, {}, RpcHandler([](const JsonView& params, Subscriptions&) {
                 return params.json();
               })});
    table.add({"small",
               "",
               {{"properties", {{"n", {{"maximum", 9}}}}}},
               {},
               RpcHandler([](const JsonView&, Subscriptions&) -> Json { return true; })});
    table.add({"fail", "", anything, {}, RpcHandler([](const JsonView&, Subscriptions&) -> Json {
                 throw std::runtime_error("already recording");
               })});
    // Its reply comes after two notifications.
    table.add({"subscribe", "", anything, {}, RpcHandler([](const JsonView&, Subscriptions& caller) -> Json {
                 caller.topics[index(Topic::event)] = true;
                 return true;
               })});
    table.add({"after_events",
               "",
               anything,
               {},
               RpcDeferredHandler([this](const JsonView&, const Subscriptions&, const RpcRespond& respond) {
                 publish(1);
                 publish(2);
                 server.post([respond] { respond(Json("done")); });
               })});
    thread = std::thread([this] {
      server.run(
          table, [] {}, [](double) {});
    });
  }
  void TearDown() override { stop(); }

  void stop() {
    server.stop();
    if (thread.joinable()) thread.join();
  }
  void publish(int number) {
    server.publish({Topic::event, 0,
                    std::make_shared<const std::string>(
                        "{\"method\":\"event\",\"params\":" + std::to_string(number) + "}\n"),
                    nullptr});
  }

  const std::string path =
      (std::filesystem::temp_directory_path() / ("combforce-client-" + std::to_string(::getpid()) + ".sock"))
          .string();
  SocketServer server{{path, "127.0.0.1", 0}, 1U << 20};
  RpcTable table{"Test", "1"};
  std::thread thread;
};

TEST_F(ClientTest, CallsOverUnixAndTcp) {
  for (const std::string& where : {"unix:" + path, server.tcp_endpoint()}) {
    Client client(where);
    EXPECT_EQ(client.call("echo", {{"a", 1}}), (Json{{"a", 1}}));
    EXPECT_EQ(client.call("echo"), Json::object());
  }
}

TEST_F(ClientTest, ErrorsSayMethodPlaceAndReason) {
  Client client("unix:" + path);
  try {
    client.call("small", {{"n", 10}});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "small: /n: 10 is above 9");
  }
  try {
    client.call("fail");
    FAIL();
  } catch (const InputError&) {
    FAIL() << "it is not the input's fault";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "fail: already recording");
  }
  EXPECT_THROW(client.call("nowhere"), std::runtime_error);
  EXPECT_EQ(client.call("echo"), Json::object()) << "it can still be used";
}

TEST_F(ClientTest, KeepsNotificationsThatComeBeforeAReply) {
  Client client("unix:" + path);
  client.call("subscribe");
  EXPECT_EQ(client.call("after_events"), "done");
  EXPECT_EQ(client.next(milliseconds(10000)), R"({"method":"event","params":1})");
  EXPECT_EQ(client.next(milliseconds(10000)), R"({"method":"event","params":2})");
  publish(3);
  EXPECT_EQ(client.next(milliseconds(10000)), R"({"method":"event","params":3})");
  EXPECT_EQ(client.next(milliseconds(1)), std::nullopt);
}

TEST_F(ClientTest, SaysWhenTheDaemonHangsUp) {
  Client client("unix:" + path);
  client.call("echo");
  stop();
  EXPECT_THROW(client.next(milliseconds(10000)), std::runtime_error);
}

TEST(ClientAddress, MustBeOfAKnownForm) {
  for (const char* bad : {"", "unix:", "localhost", ":8720", "localhost:", "localhost:0", "localhost:65536",
                          "localhost:99999", "localhost:-1", "localhost:http"}) {
    EXPECT_THROW(Client{bad}, std::invalid_argument) << bad;
  }
}

TEST(ClientAddress, IsNamedWhenNobodyAnswers) {
  for (const std::string where : {"unix:/nowhere/at/all.sock", "127.0.0.1:1"}) {
    try {
      const Client client(where);
      FAIL() << where;
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(where + ": ", 0), 0U) << error.what();
    }
  }
  EXPECT_THROW(Client("unix:" + std::string(200, 'a')), std::runtime_error);
}

}  // namespace
}  // namespace combforce
