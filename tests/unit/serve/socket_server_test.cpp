#include "daemon/serve/socket_server.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "raw_client.hpp"

namespace combforce {
namespace {

constexpr std::uint64_t client_bytes = std::uint64_t{64} * 1024;

std::string socket_path() {
  static std::atomic<int> number{0};
  return (std::filesystem::temp_directory_path() /
          ("combforce-test-" + std::to_string(::getpid()) + "-" + std::to_string(number++) + ".sock"))
      .string();
}

std::string request(int id, const std::string& method, const std::string& params = "{}") {
  return R"({"jsonrpc":"2.0","id":)" + std::to_string(id) + R"(,"method":")" + method + R"(","params":)" +
         params + "}";
}

// A server with trivial methods on both kinds of socket, running while this lives.
class Running {
 public:
  Running() {
    const Json anything{{"type", "object"}};
    table.add({"ping", "", anything, {}, RpcHandler([](const JsonView&, Subscriptions&) -> Json {
                 return "pong";
               })});
    table.add({"big", "", anything, {}, RpcHandler([](const JsonView&, Subscriptions&) -> Json {
                 return std::string(8192, 'b');
               })});
    table.add({"later",
               "",
               anything,
               {},
               RpcDeferredHandler([this](const JsonView&, const Subscriptions&, RpcRespond respond) {
                 const std::lock_guard lock(mutex);
                 deferred.push_back(std::move(respond));
               })});
    table.add(
        {"subscribe", "", anything, {}, RpcHandler([](const JsonView& params, Subscriptions& caller) -> Json {
           caller.topics[index(Topic::pixel)] = true;
           caller.tones = params.json().value("tones", true);
           caller.every = params.json().value("every", std::uint64_t{1});
           caller.topics[index(Topic::spectrum)] = params.json().contains("spectrum_hz");
           caller.spectrum_hz = params.json().value("spectrum_hz", 1.0);
           return true;
         })});
    thread = std::thread([this] {
      server.run(
          table, [this] { ++seconds; }, [this](double hz) { spectrum_hz = hz; });
    });
  }
  ~Running() {
    server.stop();
    thread.join();
  }

  RawClient unix_client() const { return RawClient::to_unix(path); }
  RawClient tcp_client() const { return RawClient::to_tcp(server.tcp_endpoint()); }

  // A pixel of about `bytes` that says its sample.
  void publish(std::uint64_t sample, std::size_t bytes = 1000) {
    const std::string text =
        "{\"sample\":" + std::to_string(sample) + ",\"pad\":\"" + std::string(bytes, 'p') + "\"}\n";
    server.publish({Topic::pixel, sample, std::make_shared<const std::string>(text),
                    std::make_shared<const std::string>("{\"brief\":" + std::to_string(sample) + "}\n")});
  }

  void answer_deferred(const Json& result) {
    server.post([this, result] {
      const std::lock_guard lock(mutex);
      for (const RpcRespond& respond : deferred) respond(result);
    });
  }
  std::size_t deferred_count() {
    const std::lock_guard lock(mutex);
    return deferred.size();
  }

  const std::string path = socket_path();
  SocketServer server{{path, "127.0.0.1", 0}, client_bytes};
  RpcTable table{"Test", "1"};
  std::atomic<int> seconds{0};
  std::atomic<double> spectrum_hz{0.0};
  std::mutex mutex;
  std::vector<RpcRespond> deferred;
  std::thread thread;
};

class OnEitherSocket : public testing::TestWithParam<bool> {
 protected:
  RawClient client() const { return GetParam() ? running.unix_client() : running.tcp_client(); }
  Running running;
};
INSTANTIATE_TEST_SUITE_P(Sockets, OnEitherSocket, testing::Bool(),
                         [](const auto& p) { return p.param ? "Unix" : "Tcp"; });

constexpr const char* pong = R"({"jsonrpc":"2.0","id":1,"result":"pong"})";

TEST_P(OnEitherSocket, AnswersLinesHoweverTheyCome) {
  RawClient c = client();
  EXPECT_EQ(c.ask(request(1, "ping")), pong);
  EXPECT_EQ(c.ask(request(1, "ping") + "\r"), pong);
  EXPECT_EQ(c.ask("\n\r\n" + request(1, "ping")), pong) << "empty lines are nothing";
  EXPECT_TRUE(c.send(request(1, "ping").substr(0, 7)));
  EXPECT_TRUE(c.send(request(1, "ping").substr(7) + "\n" + request(1, "ping") + "\n"));
  EXPECT_EQ(c.line(), pong);
  EXPECT_EQ(c.line(), pong);
}

TEST_P(OnEitherSocket, DisconnectsAfterTooLongALine) {
  RawClient c = client();
  EXPECT_EQ(c.ask(request(1, "ping")), pong);
  c.send(std::string((1U << 20) + 1, ' '));
  const Json reply = parse_json(c.line().value_or("null"), "");
  ASSERT_TRUE(reply.is_object());
  EXPECT_EQ(reply.at("error").at("code"), -32600);
  EXPECT_EQ(reply.at("id"), nullptr);
  EXPECT_EQ(c.line(), std::nullopt);
}

TEST_P(OnEitherSocket, TakesALineOfTheLimit) {
  RawClient c = client();
  const std::string ping = request(1, "ping");
  EXPECT_EQ(c.ask(std::string((1U << 20) - ping.size(), ' ') + ping), pong);
}

TEST_P(OnEitherSocket, AnswersWhatIsDueAfterTheEndOfInput) {
  RawClient c = client();
  c.send(request(1, "ping") + "\n" + request(2, "later") + "\n");
  c.end_of_input();
  EXPECT_EQ(c.line(), pong);
  while (running.deferred_count() == 0) std::this_thread::yield();
  running.answer_deferred(42);
  EXPECT_EQ(c.line(), R"({"jsonrpc":"2.0","id":2,"result":42})");
  EXPECT_EQ(c.line(), std::nullopt);
}

// As `echo REQUEST | socat -t 600 - UNIX:…` does it.
TEST_P(OnEitherSocket, ServesASubscriberAfterTheEndOfItsInput) {
  RawClient c = client();
  c.send(request(1, "subscribe") + "\n" + request(2, "later") + "\n");
  c.end_of_input();
  EXPECT_EQ(c.line(), R"({"jsonrpc":"2.0","id":1,"result":true})");
  while (running.deferred_count() == 0) std::this_thread::yield();
  running.answer_deferred(42);
  EXPECT_EQ(c.line(), R"({"jsonrpc":"2.0","id":2,"result":42})");
  for (std::uint64_t sample = 0; sample < 100; ++sample) {
    running.publish(sample, 1);
    EXPECT_EQ(c.line(), "{\"sample\":" + std::to_string(sample) + ",\"pad\":\"p\"}");
  }
}

// Nothing is published: only the connection itself can tell.
TEST_P(OnEitherSocket, ForgetsASubscriberThatHangsUpAfterTheEndOfItsInput) {
  {
    RawClient gone = client();
    gone.ask(request(1, "subscribe"));
    gone.end_of_input();
    RawClient other = client();
    EXPECT_EQ(other.ask(request(1, "ping")), pong);
    EXPECT_TRUE(running.server.wanted().pixel);
    gone.reset_on_close();
  }
  while (running.server.wanted().pixel) std::this_thread::yield();
}

TEST_P(OnEitherSocket, ForgetsASubscriberThatIsGoneWhenAPixelDoesNotReachIt) {
  client().ask(request(1, "subscribe"));
  for (std::uint64_t sample = 0; running.server.wanted().pixel; ++sample) {
    running.publish(sample);
    std::this_thread::yield();
  }
}

TEST_P(OnEitherSocket, AClientThatIsGoneIsNotMissed) {
  {
    RawClient gone = client();
    gone.send(request(1, "later") + "\n");
    while (running.deferred_count() == 0) std::this_thread::yield();
  }
  running.answer_deferred(1);
  RawClient c = client();
  EXPECT_EQ(c.ask(request(1, "ping")), pong);
}

TEST_P(OnEitherSocket, SendsSubscribersWhatTheyAskedFor) {
  RawClient all = client(), brief = client(), third = client(), none = client();
  all.ask(request(1, "subscribe"));
  EXPECT_TRUE(running.server.wanted().pixel);
  EXPECT_FALSE(running.server.wanted().pixel_brief);
  brief.ask(request(1, "subscribe", R"({"tones":false})"));
  third.ask(request(1, "subscribe", R"({"tones":false,"every":3})"));
  EXPECT_TRUE(running.server.wanted().pixel_brief);
  EXPECT_EQ(none.ask(request(1, "ping")), pong);
  for (std::uint64_t sample = 0; sample < 7; ++sample) running.publish(sample, 1);
  for (std::uint64_t sample = 0; sample < 7; ++sample) {
    EXPECT_EQ(all.line(), "{\"sample\":" + std::to_string(sample) + ",\"pad\":\"p\"}");
    EXPECT_EQ(brief.line(), "{\"brief\":" + std::to_string(sample) + "}");
    if (sample % 3 == 0) {
      EXPECT_EQ(third.line(), "{\"brief\":" + std::to_string(sample) + "}");
    }
  }
  EXPECT_EQ(none.ask(request(1, "ping")), pong) << "and nothing before it";
}

// Spectra come at the greatest rate that a client wants; one that wants fewer gets fewer of them.
TEST(SocketServer, AsksForSpectraAsOftenAsTheMostEagerClientWantsThem) {
  Running running;
  RawClient calm = running.unix_client();
  calm.ask(request(1, "subscribe", R"({"spectrum_hz":0.001})"));
  EXPECT_EQ(running.spectrum_hz.load(), 0.001);
  {
    RawClient eager = running.unix_client();
    eager.ask(request(1, "subscribe", R"({"spectrum_hz":1e9})"));
    EXPECT_EQ(running.spectrum_hz.load(), 1e9);
    for (int i = 0; i < 3; ++i) {
      const std::string text = std::to_string(i);
      running.server.publish({Topic::spectrum, 0, std::make_shared<const std::string>(text + "\n"), nullptr});
      EXPECT_EQ(eager.line(), text);
    }
  }
  while (running.spectrum_hz.load() != 0.001) std::this_thread::yield();
  EXPECT_EQ(calm.line(), std::string("0"));
  EXPECT_EQ(calm.ask(request(1, "ping")), pong) << "and nothing before it: 1000 s have not passed";
}

TEST(SocketServer, IsNotWantedOnceSubscribersAreGone) {
  Running running;
  {
    RawClient client = running.unix_client();
    client.ask(request(1, "subscribe"));
    EXPECT_TRUE(running.server.wanted().pixel);
  }
  while (running.server.wanted().pixel) std::this_thread::yield();
}

// One client stops reading while another keeps up. What the slow one gets when it reads again must account
// for every pixel: delivered in order, or within exactly one skipped event at its place.
TEST(SocketServer, AClientThatStopsReadingLosesACountAndHarmsNobody) {
  constexpr std::uint64_t published = 3000;
  Running running;
  RawClient slow = running.unix_client(), healthy = running.unix_client();
  slow.ask(request(1, "subscribe"));
  healthy.ask(request(1, "subscribe"));
  const auto sample_of = [](const std::string& line) {
    return parse_json(line, "").at("sample").get<std::uint64_t>();
  };
  for (std::uint64_t sample = 0; sample < published; ++sample) {
    running.publish(sample);
    const auto line = healthy.line();  // in step: the healthy client is never more than one behind
    ASSERT_TRUE(line);
    ASSERT_EQ(sample_of(*line), sample);
  }
  EXPECT_EQ(healthy.ask(request(1, "ping")), pong);

  std::uint64_t next = 0, skipped = 0;
  while (next < published) {
    const auto line = slow.line();
    ASSERT_TRUE(line);
    const Json message = parse_json(*line, "");
    if (message.contains("sample")) {
      ASSERT_EQ(message.at("sample"), next++);
      continue;
    }
    const Json& params = message.at("params");
    ASSERT_EQ(params.at("kind"), "skipped");
    ASSERT_EQ(params.at("topic"), "pixel");
    ASSERT_EQ(params.at("first_sample"), next);
    const auto count = params.at("count").get<std::uint64_t>();
    next += count;
    skipped += count;
    ASSERT_EQ(params.at("last_sample"), next - 1);
  }
  EXPECT_EQ(next, published);
  // The slow client's 64 KiB and the kernel's socket buffer (0.2 MB by default) cannot hold 3 MB.
  EXPECT_GT(skipped, published / 2);
  running.publish(published);
  EXPECT_EQ(sample_of(slow.line().value_or("{}")), published) << "it is served again";
}

TEST(SocketServer, DisconnectsAClientThatTakesNoReplies) {
  Running running;
  RawClient greedy = running.unix_client(), healthy = running.unix_client();
  std::size_t asked = 0;
  while (asked < 10000 && greedy.send(request(1, "big") + "\n")) ++asked;
  EXPECT_LT(asked, 10000U) << "80 MB of replies would have been kept for it";
  EXPECT_EQ(healthy.ask(request(1, "ping")), pong);
  std::size_t lines = 0;
  while (greedy.line()) ++lines;
  EXPECT_LT(lines, asked);
}

// Nobody reads the queue while the I/O thread is held up: it must stay bounded, and what was lost be told.
TEST(SocketServer, TellsWhatWasLostOnTheWayToTheIoThread) {
  constexpr std::uint64_t published = 500;
  Running running;
  RawClient client = running.unix_client();
  client.ask(request(1, "subscribe"));
  std::mutex hold;
  hold.lock();
  running.server.post([&hold] { const std::lock_guard wait(hold); });
  for (std::uint64_t sample = 0; sample < published; ++sample) running.publish(sample);
  hold.unlock();
  std::uint64_t accounted = 0, delivered = 0;
  while (accounted < published) {
    const Json message = parse_json(client.line().value_or("{}"), "");
    if (message.contains("sample")) {
      ASSERT_EQ(message.at("sample"), accounted);
      ++delivered;
      ++accounted;
    } else {
      accounted += message.at("params").at("count").get<std::uint64_t>();
    }
  }
  EXPECT_EQ(accounted, published);
  EXPECT_GT(delivered, 0U);
  EXPECT_LT(delivered, published);
}

TEST(SocketServer, TurnsAwayTooManyClients) {
  Running running;
  std::vector<RawClient> clients;
  for (std::size_t i = 0; i < SocketServer::max_clients; ++i) {
    clients.push_back(running.unix_client());
    ASSERT_EQ(clients.back().ask(request(1, "ping")), pong);
  }
  RawClient one_more = running.unix_client();
  EXPECT_EQ(one_more.line(), std::nullopt);
  clients.pop_back();
  for (;;) {  // its place becomes free as soon as the server has seen it go
    RawClient next = running.unix_client();
    if (next.send(request(1, "ping") + "\n") && next.line() == pong) break;
  }
}

TEST(SocketServer, AClientThatOnlyListensMakesRoomForOneThatComes) {
  Running running;
  std::vector<RawClient> clients;
  for (std::size_t i = 0; i < SocketServer::max_clients; ++i) {
    clients.push_back(running.unix_client());
    clients.back().ask(request(1, "subscribe"));
  }
  clients.front().end_of_input();
  for (;;) {  // as soon as the server has seen the end of its input
    RawClient next = running.unix_client();
    if (next.send(request(1, "ping") + "\n") && next.line() == pong) break;
  }
  EXPECT_EQ(clients.front().line(), std::nullopt);
  EXPECT_EQ(clients.back().ask(request(1, "ping")), pong);
}

TEST(SocketServer, TicksOnceASecond) {
  Running running;
  while (running.seconds.load() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

TEST(SocketServer, StopSendsWhatIsDueAndClosesEverything) {
  const std::string path = socket_path();
  SocketServer server({path, "127.0.0.1", 0}, client_bytes);
  const RpcTable table("Test", "1");
  std::thread thread([&] {
    server.run(
        table, [] {}, [](double) {});
  });
  RawClient client = RawClient::to_unix(path);
  const std::string reply = client.ask(request(1, "rpc.discover"));
  EXPECT_NE(reply.find("openrpc"), std::string::npos);
  server.stop();
  thread.join();
  EXPECT_EQ(client.line(), std::nullopt);
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_FALSE(RawClient::to_tcp(server.tcp_endpoint()).connected());
}

TEST(UnixSocket, IsForOwnerAndGroup) {
  const std::string path = socket_path();
  const SocketServer server({path, "", {}}, client_bytes);
  struct stat found {};
  ASSERT_EQ(::stat(path.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777U, 0660U);
  EXPECT_EQ(server.tcp_endpoint(), "");
}

TEST(UnixSocket, ReplacesAStaleFileAndRemovesItsOwn) {
  const std::string path = socket_path();
  {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
    ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::close(dead);  // the file stays, as after kill -9
  }
  ASSERT_TRUE(std::filesystem::exists(path));
  { const SocketServer server({path, "", {}}, client_bytes); }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(UnixSocket, RefusesALiveOneAndLeavesItAlone) {
  const std::string path = socket_path();
  const SocketServer first({path, "", {}}, client_bytes);
  try {
    const SocketServer second({path, "", {}}, client_bytes);
    FAIL() << "bound twice";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
  }
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(UnixSocket, RefusesWhatIsNoSocket) {
  const std::string path = socket_path();
  std::ofstream(path) << "precious";
  EXPECT_THROW(SocketServer({path, "", {}}, client_bytes), std::runtime_error);
  EXPECT_TRUE(std::filesystem::exists(path));
  std::filesystem::remove(path);
}

TEST(TcpSocket, NamesTheAddressThatCannotBeBound) {
  const SocketServer first({"", "127.0.0.1", 0}, client_bytes);
  const std::string endpoint = first.tcp_endpoint();
  const auto port = static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1)));
  try {
    const SocketServer second({"", "127.0.0.1", port}, client_bytes);
    FAIL() << "bound twice";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(endpoint), std::string::npos) << error.what();
  }
  EXPECT_THROW(SocketServer({"", "no address", 0}, client_bytes), std::runtime_error);
}

}  // namespace
}  // namespace combforce
