// One connected client: its requests, its subscriptions, and what it is still to be sent.
//
// A client may end its input and go on listening: it is served while it has subscriptions or answers are due,
// until it closes its connection. On a Unix socket that is seen at once; on TCP it looks like the end of
// input until something is sent, or until a probe of the connection finds nobody (silent_probes).
//
// Thread-bound (I/O thread). Lives as long as an operation on its socket is under way; close() ends them all.
#pragma once

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "daemon/serve/line_framer.hpp"
#include "daemon/serve/listener.hpp"
#include "daemon/serve/notification_queue.hpp"
#include "daemon/serve/outbox.hpp"
#include "daemon/serve/rpc.hpp"

namespace combforce {

class Session : public std::enable_shared_from_this<Session> {
 public:
  static constexpr std::size_t max_line_bytes = 1u << 20;

  struct Hooks {
    std::function<void()> subscribed;                              // subscriptions may have changed
    std::function<void(Session&, const std::string& why)> closed;  // once, from close()
  };

  Session(StreamSocket socket, const RpcTable& table, std::uint64_t client_bytes, Hooks hooks);

  void start();
  void deliver(const Notification& notification);
  void deliver_loss(Topic topic, const Skipped& lost);
  void ignore_input() { deaf_ = true; }  // from now on; what is due is still sent
  // Takes no more requests, sends what is due, closes; after `patience` in any case.
  void finish(std::string why, std::chrono::milliseconds at_most);
  void close(const std::string& why);

  const Subscriptions& subscriptions() const { return subscriptions_; }
  bool input_ended() const { return input_ended_; }

 private:
  enum class State : std::uint8_t { open, finishing, closed };

  void read();
  void received(std::size_t bytes);
  void end_input();
  void watch_for_hang_up();
  void handle(std::string_view line);
  void reply(std::string line);
  void write();
  void written(std::size_t lines);
  void finish_when_idle();
  void close_when_sent();
  bool answers_due() const { return answer_token_.use_count() > 1; }
  std::uint64_t due_pixels(std::uint64_t seen);
  bool spectrum_due();

  StreamSocket socket_;
  const RpcTable& table_;
  Hooks hooks_;
  State state_ = State::open;
  std::string why_;
  LineFramer framer_{max_line_bytes};
  std::array<char, 16384> input_{};
  bool input_ended_ = false;
  bool deaf_ = false;
  Subscriptions subscriptions_;
  std::uint64_t pixels_seen_ = 0;  // while subscribed to them
  std::chrono::steady_clock::time_point next_spectrum_;
  std::shared_ptr<int> answer_token_ = std::make_shared<int>();  // shared by whatever will still answer
  Outbox outbox_;
  std::size_t writing_ = 0;  // lines of the outbox that are being written
  boost::asio::steady_timer deadline_;
};

}  // namespace combforce
