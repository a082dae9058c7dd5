// A client that sends and reads bytes as they are; every wait ends after ten seconds, with a failed
// expectation.
#pragma once

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <arpa/inet.h>
#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace combforce {

class RawClient {
 public:
  static RawClient to_unix(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    return {AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof address};
  }

  // "127.0.0.1:PORT"
  static RawClient to_tcp(const std::string& endpoint) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return {AF_INET, reinterpret_cast<const sockaddr*>(&address), sizeof address};
  }

  RawClient(RawClient&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)), rest_(std::move(other.rest_)) {}
  RawClient& operator=(RawClient&&) = delete;
  ~RawClient() {
    if (socket_ >= 0) ::close(socket_);
  }

  bool connected() const { return socket_ >= 0; }

  // False when the server does not take it any more.
  bool send(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent < 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  void end_of_input() const { ::shutdown(socket_, SHUT_WR); }
  // What is closed then is reset: on TCP the other side learns of it at once.
  void reset_on_close() const {
    const linger at_once{1, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  }

  // The next line without its newline; empty at the end of the connection.
  std::optional<std::string> line() {
    for (;;) {
      if (const std::size_t end = rest_.find('\n'); end != std::string::npos) {
        std::string text = rest_.substr(0, end);
        rest_.erase(0, end + 1);
        return text;
      }
      if (!receive()) return std::nullopt;
    }
  }

  // True when a line can be had without waiting.
  bool ready() const {
    if (rest_.find('\n') != std::string::npos) return true;
    pollfd wanted{socket_, POLLIN, 0};
    return ::poll(&wanted, 1, 0) > 0;
  }

  std::string ask(const std::string& request) {
    EXPECT_TRUE(send(request + "\n"));
    return line().value_or("(connection closed)");
  }

 private:
  RawClient(int family, const sockaddr* address, socklen_t length)
      : socket_(::socket(family, SOCK_STREAM, 0)) {
    if (::connect(socket_, address, length) != 0) ::close(std::exchange(socket_, -1));
  }

  bool receive() {
    pollfd wanted{socket_, POLLIN, 0};
    if (::poll(&wanted, 1, 10000) <= 0) {
      ADD_FAILURE() << "nothing came within ten seconds";
      return false;
    }
    std::array<char, 65536> buffer{};
    const ssize_t bytes = ::recv(socket_, buffer.data(), buffer.size(), 0);
    if (bytes > 0) rest_.append(buffer.data(), static_cast<std::size_t>(bytes));
    return bytes > 0;
  }

  int socket_;
  std::string rest_;
};

}  // namespace combforce
