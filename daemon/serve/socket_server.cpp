#include "daemon/serve/socket_server.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/serve/listener.hpp"
#include "daemon/serve/session.hpp"

namespace combforce {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr std::chrono::milliseconds patience_at_stop{500};
constexpr std::chrono::milliseconds pause_after_failed_accept{100};

constexpr unsigned brief_bit = 1u << topic_names.size();
constexpr unsigned topic_bit(Topic topic) {
  return 1u << index(topic);
}

unsigned wanted_bits(const Subscriptions& subscriptions) {
  unsigned bits = 0;
  for (std::size_t i = 0; i < topic_names.size(); ++i) bits |= subscriptions.topics[i] ? 1u << i : 0u;
  if (subscriptions.has(Topic::pixel) && !subscriptions.tones)
    bits = (bits & ~topic_bit(Topic::pixel)) | brief_bit;
  return bits;
}

}  // namespace

class SocketServer::Impl {
 public:
  Impl(const Addresses& addresses, std::uint64_t client_bytes)
      : client_bytes_(client_bytes), queue_(client_bytes), signals_(io_), second_(io_), pause_(io_) {
    if (!addresses.unix_socket.empty()) unix_ = std::make_unique<UnixListener>(io_, addresses.unix_socket);
    if (addresses.port) tcp_ = std::make_unique<TcpListener>(io_, addresses.address, *addresses.port);
    if (tcp_) tcp_endpoint_ = tcp_->endpoint();
  }

  void run(const RpcTable& table, std::function<void()> every_second,
           std::function<void(double hz)> spectrum_rate, std::function<void()> wind_down) {
    table_ = &table;
    wind_down_ = std::move(wind_down);
    every_second_ = std::move(every_second);
    spectrum_rate_ = std::move(spectrum_rate);
    if (unix_) accept(*unix_);
    if (tcp_) accept(*tcp_);
    tick();
    io_.run();
  }

  void stop_on_signals() {
    signals_.add(SIGTERM);
    signals_.add(SIGINT);
    signals_.async_wait([this](error_code error, int) {
      if (!error) stop_here();
    });
  }

  void stop() {
    asio::post(io_, [this] { stop_here(); });
  }

  void finish() {
    asio::post(io_, [this] { finish_here(); });
  }

  void post(std::function<void()> task) { asio::post(io_, std::move(task)); }

  void publish(Notification notification) {
    if (queue_.push(std::move(notification))) asio::post(io_, [this] { deliver(queue_.take()); });
  }

  unsigned wanted() const { return wanted_.load(std::memory_order_relaxed); }
  const std::string& tcp_endpoint() const { return tcp_endpoint_; }

 private:
  template <class Listener>
  void accept(Listener& listener) {
    listener.acceptor().async_accept([this, &listener](error_code error, auto socket) {
      if (stopping_) return;
      if (error) {  // out of descriptors, say
        spdlog::warn("accepting a client: {}", error.message());
        pause_.expires_after(pause_after_failed_accept);
        pause_.async_wait([this, &listener](error_code) {
          if (!stopping_) accept(listener);
        });
        return;
      }
      if constexpr (std::is_same_v<Listener, TcpListener>) {
        socket.set_option(asio::ip::tcp::no_delay(true), error);
      }
      admit(StreamSocket(std::move(socket)));
      accept(listener);
    });
  }

  void admit(StreamSocket socket) {
    if (sessions_.size() >= max_clients) make_room();
    if (sessions_.size() >= max_clients) {
      spdlog::warn("a client was turned away: there are {} already", sessions_.size());
      return;
    }
    Session::Hooks hooks{[this] { refresh_wanted(); },
                         [this](Session& session, const std::string& why) { closed(session, why); }};
    auto session = std::make_shared<Session>(std::move(socket), *table_, client_bytes_, std::move(hooks));
    sessions_.emplace(session.get(), session);
    spdlog::debug("client connected, {} now", sessions_.size());
    session->start();
  }

  // A client that only listens may be gone without our knowing it yet; one that comes has precedence.
  void make_room() {
    const auto listener =
        std::ranges::find_if(sessions_, [](const auto& entry) { return entry.second->input_ended(); });
    if (listener == sessions_.end()) return;
    const std::shared_ptr<Session> session = listener->second;
    spdlog::warn("a client that had ended its input was disconnected: there are {}", sessions_.size());
    session->close("another client came");
  }

  void closed(Session& session, const std::string& why) {
    table_->gone(session.subscriptions());
    sessions_.erase(&session);
    spdlog::debug("client disconnected: {}; {} left", why, sessions_.size());
    refresh_wanted();
    if (finishing_ && sessions_.empty()) io_.stop();
  }

  void refresh_wanted() {
    unsigned bits = 0;
    double spectrum_hz = 0.0;
    for (const auto& [key, session] : sessions_) {
      const Subscriptions& subscriptions = session->subscriptions();
      bits |= wanted_bits(subscriptions);
      if (subscriptions.has(Topic::spectrum)) spectrum_hz = std::max(spectrum_hz, subscriptions.spectrum_hz);
    }
    wanted_.store(bits, std::memory_order_relaxed);
    if (std::exchange(spectrum_hz_, spectrum_hz) != spectrum_hz) spectrum_rate_(spectrum_hz);
  }

  void deliver(const NotificationBatch& batch) {
    for (const Notification& notification : batch.notifications) {
      for (const auto& [key, session] : sessions_) session->deliver(notification);
    }
    for (std::size_t i = 0; i < batch.lost.size(); ++i) {
      if (batch.lost[i].count == 0) continue;
      for (const auto& [key, session] : sessions_)
        session->deliver_loss(static_cast<Topic>(i), batch.lost[i]);
    }
  }

  void tick() {
    second_.expires_after(std::chrono::seconds(1));
    second_.async_wait([this](error_code error) {
      if (error || stopping_) return;
      every_second_();
      tick();
    });
  }

  void stop_here() {
    if (std::exchange(stopping_, true)) return;
    unix_.reset();
    tcp_.reset();
    for (const auto& [key, session] : sessions_) session->ignore_input();
    if (wind_down_) {
      wind_down_();
    } else {
      finish_here();
    }
  }

  void finish_here() {
    if (std::exchange(finishing_, true)) return;
    deliver(queue_.take());
    std::vector<std::shared_ptr<Session>> sessions;
    for (const auto& [key, session] : sessions_) sessions.push_back(session);
    for (const auto& session : sessions) session->finish("the server stops", patience_at_stop);
    if (sessions_.empty()) io_.stop();
  }

  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> work_ = asio::make_work_guard(io_);
  std::uint64_t client_bytes_;
  NotificationQueue queue_;
  std::atomic<unsigned> wanted_{0};
  const RpcTable* table_ = nullptr;
  std::function<void()> every_second_;
  std::function<void(double hz)> spectrum_rate_;
  double spectrum_hz_ = 0.0;
  std::unique_ptr<UnixListener> unix_;
  std::unique_ptr<TcpListener> tcp_;
  std::string tcp_endpoint_;
  asio::signal_set signals_;
  asio::steady_timer second_, pause_;
  std::unordered_map<Session*, std::shared_ptr<Session>> sessions_;
  std::function<void()> wind_down_;
  bool stopping_ = false, finishing_ = false;
};

SocketServer::SocketServer(const Addresses& addresses, std::uint64_t client_bytes)
    : impl_(std::make_unique<Impl>(addresses, client_bytes)) {}
SocketServer::~SocketServer() = default;

void SocketServer::run(const RpcTable& table, std::function<void()> every_second,
                       std::function<void(double hz)> spectrum_rate, std::function<void()> wind_down) {
  impl_->run(table, std::move(every_second), std::move(spectrum_rate), std::move(wind_down));
}
void SocketServer::stop() {
  impl_->stop();
}
void SocketServer::finish() {
  impl_->finish();
}
void SocketServer::stop_on_signals() {
  impl_->stop_on_signals();
}
void SocketServer::post(std::function<void()> task) {
  impl_->post(std::move(task));
}
void SocketServer::publish(Notification notification) {
  impl_->publish(std::move(notification));
}

Wanted SocketServer::wanted() const {
  const unsigned bits = impl_->wanted();
  const auto has = [bits](Topic topic) { return (bits & topic_bit(topic)) != 0; };
  return {has(Topic::pixel), (bits & brief_bit) != 0, has(Topic::line),
          has(Topic::frame), has(Topic::status),      has(Topic::event)};
}

std::string SocketServer::tcp_endpoint() const {
  return impl_->tcp_endpoint();
}

}  // namespace combforce
