// A bound, listening socket: TCP or Unix.
#pragma once

#include <sys/types.h>

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <cstdint>
#include <string>

namespace combforce {

using StreamSocket = boost::asio::generic::stream_protocol::socket;

// Throw std::runtime_error naming the address and what failed. Thread-bound.
class TcpListener {
 public:
  using Acceptor = boost::asio::ip::tcp::acceptor;

  // `address` in numbers (IPv4 or IPv6); port 0: any free one.
  TcpListener(boost::asio::io_context& io, const std::string& address, std::uint16_t port);

  Acceptor& acceptor() { return acceptor_; }
  std::string endpoint() const;  // "127.0.0.1:8720", "[::1]:8720"

 private:
  Acceptor acceptor_;
};

// A socket file of mode 0660. A stale one (nobody listens) is replaced; a live one, or anything that is no
// socket, is refused. The destructor removes the file if it is still this one.
class UnixListener {
 public:
  using Acceptor = boost::asio::local::stream_protocol::acceptor;

  UnixListener(boost::asio::io_context& io, std::string path);
  ~UnixListener();
  UnixListener(const UnixListener&) = delete;
  UnixListener& operator=(const UnixListener&) = delete;

  Acceptor& acceptor() { return acceptor_; }

 private:
  Acceptor acceptor_;
  std::string path_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace combforce
