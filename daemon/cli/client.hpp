// A blocking client of combforced: JSON-RPC 2.0, one message a line.
#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>

#include "daemon/serve/line_framer.hpp"
#include "proto/json.hpp"

namespace CLI {
class App;
}

namespace combforce {

// Thread-bound. A lost connection, a daemon that hangs up and a line of more than 64 MiB throw
// std::runtime_error.
class Client {
 public:
  // `where`: "unix:PATH" or "HOST:PORT". Throws std::invalid_argument on another form, std::runtime_error
  // naming the address when nobody answers there.
  explicit Client(const std::string& where);
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  // The result. Waits for as long as it takes; notifications that come meanwhile are kept for next(). An
  // error of the daemon's: InputError with the method for a file when parameters are invalid, else
  // std::runtime_error.
  Json call(const std::string& method, const Json& params = Json::object());

  // The next notification as it came, without its newline; empty when none came in time or a signal was
  // caught.
  std::optional<std::string> next(std::chrono::milliseconds timeout);

 private:
  void send(const std::string& line);
  bool receive(std::chrono::milliseconds timeout);  // false: timed out, or a signal
  Json take_answer(std::uint64_t id, const std::string& method);

  std::string where_;
  int socket_ = -1;
  std::uint64_t last_id_ = 0;
  LineFramer framer_;
  std::deque<std::string> received_;
  std::deque<std::string> notifications_;
};

// Declares --connect with its default, the daemon's own (127.0.0.1:8720); another form of it is a usage
// error.
void add_connect(CLI::App& command, std::string& where);

}  // namespace combforce
