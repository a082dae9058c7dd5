// JSON-RPC 2.0, one message a line, on a Unix socket and on TCP (message contract).
//
// One table of methods drives dispatch, validation of parameters and rpc.discover. A client holds at most
// client_bytes of unsent messages. Its notifications are skipped beyond three quarters of that, and an event
// {kind: "skipped", topic, count, first_sample, last_sample} precedes the next one it gets; a reply that does
// not fit disconnects it.
//
// Thread rule: run() owns the calling thread (the I/O thread) until stop(); publish…() and stop() from any
// thread.
#pragma once

#include <memory>
#include <string>

#include "config/configuration.hpp"
#include "daemon/instrument.hpp"
#include "daemon/pipeline/pipeline.hpp"

namespace combforce {

class Server {
 public:
  // Binds the sockets: throws std::runtime_error naming the address. A stale Unix socket is replaced, a live
  // one refused.
  explicit Server(const ServerSettings& settings);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Serves `instrument` until stop(), and stops it then; once. Clients that connect earlier wait. The sockets
  // are removed when it returns.
  void run(Instrument& instrument);
  // Takes no more clients and requests, stops the instrument, sends the clients what it still puts out and
  // what is due, the latter for half a second at most.
  void stop();
  // As stop() on SIGTERM and SIGINT from now on; further ones change nothing while the server lives.
  void stop_on_signals();

  // The address bound for TCP ("127.0.0.1:8720"), "" without.
  std::string tcp_endpoint() const;

  // Notifications; serialised once, shared by all clients, and only when somebody has subscribed. They never
  // wait.
  void publish_pixel(const RetiredPixel& pixel);
  void publish_line(const LineDone& line);
  void publish_frame(const FrameDone& frame);
  void publish_spectrum(const Spectrum& spectrum);
  void publish_event(const Event& event);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace combforce
