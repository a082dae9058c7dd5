// The socket side of the server: listeners and sessions on one I/O thread. What is said is not known here.
//
// Thread rule: run() owns the calling thread (the I/O thread); stop(), finish(), post(), publish() and
// wanted() from any.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "daemon/serve/notification_queue.hpp"
#include "daemon/serve/rpc.hpp"

namespace combforce {

// What at least one client has subscribed to.
struct Wanted {
  bool pixel = false, pixel_brief = false;  // with, and without tones
  bool line = false, frame = false, status = false, event = false;
};

class SocketServer {
 public:
  static constexpr std::size_t max_clients = 64;  // more are turned away, unless one has ended its input

  struct Addresses {
    std::string unix_socket;            // "": none
    std::string address = "127.0.0.1";  // of TCP
    std::optional<std::uint16_t> port;  // absent: no TCP; 0: any free one
  };

  // Binds: std::runtime_error naming the address.
  SocketServer(const Addresses& addresses, std::uint64_t client_bytes);
  ~SocketServer();
  SocketServer(const SocketServer&) = delete;
  SocketServer& operator=(const SocketServer&) = delete;

  // Until stop(); once. `every_second` and `spectrum_rate`, when the greatest rate of spectra that a client
  // wants changes (0: none does), are called on the I/O thread. Both sockets are gone when it returns.
  //
  // From stop() on no client and no request is taken. `wind_down` is then called on the I/O thread: what is
  // published until it, or what it began, calls finish() still goes out. Without it that is at once.
  void run(const RpcTable& table, std::function<void()> every_second,
           std::function<void(double hz)> spectrum_rate, std::function<void()> wind_down = {});
  void stop();
  // Sends what was published and is due, for half a second at most, and closes the connections.
  void finish();
  // On SIGTERM and SIGINT, also before run(). More of them change nothing while this object lives: what is
  // being closed after run() is closed in peace.
  void stop_on_signals();
  void post(std::function<void()> task);

  void publish(Notification notification);
  Wanted wanted() const;

  std::string tcp_endpoint() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
