#include "daemon/cli/client.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>
#include <utility>

#include "daemon/cli/interrupt_flag.hpp"

namespace combforce {

namespace {

constexpr std::size_t max_line_bytes = std::size_t{64} << 20;
constexpr unsigned most_port = 65535;
constexpr int rpc_invalid_params = -32602;
constexpr std::string_view unix_prefix = "unix:";

struct HostPort {
  std::string host, port;
};

std::optional<HostPort> split(const std::string& where) {
  const std::size_t colon = where.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == where.size()) return std::nullopt;
  std::string host = where.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  return HostPort{host, where.substr(colon + 1)};
}

bool is_port(const std::string& text) {
  unsigned port = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, port);
  return error == std::errc{} && stop == end && port >= 1 && port <= most_port;
}

std::string why_not(const std::string& where) {
  if (where.starts_with(unix_prefix)) {
    return where.size() > unix_prefix.size() ? "" : "unix: needs a path";
  }
  const auto parts = split(where);
  if (!parts) return where + ": is neither unix:PATH nor HOST:PORT";
  return is_port(parts->port) ? "" : fmt::format("{}: port {}, must be 1..{}", where, parts->port, most_port);
}

[[noreturn]] void fail(const std::string& where, const std::string& why) {
  throw std::runtime_error(fmt::format("{}: {}", where, why));
}

int connect_unix(const std::string& where) {
  const std::string path = where.substr(unix_prefix.size());
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) fail(where, "the path is too long");
  path.copy(address.sun_path, path.size());
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) fail(where, std::strerror(errno));
  if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    ::close(descriptor);
    fail(where, std::strerror(error));
  }
  return descriptor;
}

int connect_tcp(const std::string& where) {
  const auto [host, port] = *split(where);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0) {
    fail(where, ::gai_strerror(error));
  }
  int error = 0;
  int descriptor = -1;
  for (const addrinfo* a = found; a != nullptr && descriptor < 0; a = a->ai_next) {
    const int candidate = ::socket(a->ai_family, a->ai_socktype | SOCK_CLOEXEC, a->ai_protocol);
    if (candidate >= 0 && ::connect(candidate, a->ai_addr, a->ai_addrlen) == 0) {
      descriptor = candidate;
    } else {
      error = errno;
      if (candidate >= 0) ::close(candidate);
    }
  }
  ::freeaddrinfo(found);
  if (descriptor < 0) fail(where, std::strerror(error));
  return descriptor;
}

int connect_to(const std::string& where) {
  if (const std::string why = why_not(where); !why.empty()) throw std::invalid_argument(why);
  return where.starts_with(unix_prefix) ? connect_unix(where) : connect_tcp(where);
}

[[noreturn]] void throw_failure(const std::string& method, const Json& error) {
  const std::string message = error.value("message", "");
  if (error.value("code", 0) != rpc_invalid_params) throw std::runtime_error(method + ": " + message);
  throw InputError(method, error.value("data", Json::object()).value("pointer", ""), message);
}

}  // namespace

Client::Client(const std::string& where)
    : where_(where), socket_(connect_to(where)), framer_(max_line_bytes) {}

Client::~Client() {
  ::close(socket_);
}

void Client::send(const std::string& line) {
  std::size_t sent = 0;
  while (sent < line.size()) {
    const ssize_t bytes = ::send(socket_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (bytes >= 0) {
      sent += static_cast<std::size_t>(bytes);
    } else if (errno != EINTR) {
      fail(where_, std::strerror(errno));
    }
  }
}

bool Client::receive(std::chrono::milliseconds timeout) {
  pollfd wanted{socket_, POLLIN, 0};
  const int ready = ::poll(&wanted, 1, static_cast<int>(timeout.count()));
  if (ready == 0 || (ready < 0 && errno == EINTR)) return false;
  std::array<char, 65536> buffer{};
  const ssize_t bytes = ready < 0 ? -1 : ::recv(socket_, buffer.data(), buffer.size(), 0);
  if (bytes < 0) fail(where_, std::strerror(errno));
  if (bytes == 0) fail(where_, "the daemon closed the connection");
  const bool fits = framer_.feed({buffer.data(), static_cast<std::size_t>(bytes)},
                                 [this](std::string_view line) { received_.emplace_back(line); });
  if (!fits) fail(where_, fmt::format("a line has more than {} bytes", max_line_bytes));
  return true;
}

Json Client::call(const std::string& method, const Json& params) {
  const std::uint64_t id = ++last_id_;
  send(Json{{"jsonrpc", "2.0"}, {"id", id}, {"method", method}, {"params", params}}.dump() + '\n');
  return take_answer(id, method);
}

Json Client::take_answer(std::uint64_t id, const std::string& method) {
  for (;;) {
    while (!received_.empty()) {
      std::string line = std::move(received_.front());
      received_.pop_front();
      const Json message = parse_json(line, where_);
      if (!message.is_object() || !message.contains("id")) {
        notifications_.push_back(std::move(line));
        continue;
      }
      if (message.contains("error")) {
        throw_failure(method, message["error"]);
      }
      if (message["id"] == id) return message.value("result", Json());
    }
    if (!receive(std::chrono::milliseconds(-1)) && InterruptFlag::raised()) fail(where_, "interrupted");
  }
}

std::optional<std::string> Client::next(std::chrono::milliseconds timeout) {
  std::deque<std::string>& from = notifications_.empty() ? received_ : notifications_;
  if (from.empty()) receive(timeout);
  if (from.empty()) return std::nullopt;
  std::string line = std::move(from.front());
  from.pop_front();
  return line;
}

void add_connect(CLI::App& command, std::string& where) {
  where = "127.0.0.1:8720";
  command.add_option("--connect", where, "Where the daemon listens")
      ->type_name("unix:PATH|HOST:PORT")
      ->capture_default_str()
      ->check([](const std::string& text) { return why_not(text); });
}

}  // namespace combforce
