#include "daemon/serve/listener.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <boost/asio/ip/address.hpp>
#include <boost/system/system_error.hpp>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace combforce {

namespace asio = boost::asio;

namespace {

constexpr mode_t socket_mode = 0660;

void remove_stale(asio::io_context& io, const std::string& path) {
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0) return;
  if (!S_ISSOCK(found.st_mode)) throw std::runtime_error(fmt::format("{}: exists and is no socket", path));
  asio::local::stream_protocol::socket probe(io);
  boost::system::error_code error;
  probe.connect(asio::local::stream_protocol::endpoint(path), error);
  if (!error) throw std::runtime_error(fmt::format("{}: another program listens there", path));
  if (error != asio::error::connection_refused) {
    throw std::runtime_error(fmt::format("{}: {}", path, error.message()));
  }
  ::unlink(path.c_str());
}

}  // namespace

TcpListener::TcpListener(asio::io_context& io, const std::string& address, std::uint16_t port)
    : acceptor_(io) {
  try {
    const asio::ip::tcp::endpoint endpoint(asio::ip::make_address(address), port);
    acceptor_.open(endpoint.protocol());
    acceptor_.set_option(Acceptor::reuse_address(true));
    acceptor_.bind(endpoint);
    acceptor_.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error(fmt::format("{}:{}: {}", address, port, error.code().message()));
  }
}

std::string TcpListener::endpoint() const {
  const auto local = acceptor_.local_endpoint();
  const std::string address = local.address().to_string();
  return local.address().is_v6() ? fmt::format("[{}]:{}", address, local.port())
                                 : fmt::format("{}:{}", address, local.port());
}

UnixListener::UnixListener(asio::io_context& io, std::string path) : acceptor_(io), path_(std::move(path)) {
  remove_stale(io, path_);
  try {
    const asio::local::stream_protocol::endpoint endpoint(path_);
    acceptor_.open(endpoint.protocol());
    // Before bind(): the file must never be open to more than it is meant for.
    ::fchmod(acceptor_.native_handle(), socket_mode);
    acceptor_.bind(endpoint);
    acceptor_.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", path_, error.code().message()));
  }
  struct stat made {};
  if (::chmod(path_.c_str(), socket_mode) != 0 || ::lstat(path_.c_str(), &made) != 0) {
    throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(errno)));
  }
  device_ = made.st_dev;
  inode_ = made.st_ino;
}

UnixListener::~UnixListener() {
  struct stat found {};
  if (::lstat(path_.c_str(), &found) == 0 && found.st_dev == device_ && found.st_ino == inode_) {
    ::unlink(path_.c_str());
  }
}

}  // namespace combforce
