#include "daemon/serve/session.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/write.hpp>
#include <utility>
#include <vector>

namespace combforce {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr const char* hung_up = "it hung up";
constexpr std::size_t lines_a_write = 64;
constexpr std::chrono::seconds patience{2};

// How a TCP client that only listens is probed: its side forgets a closed connection after a minute, and
// answers from then on that there is none.
constexpr int probe_after_s = 15, probe_every_s = 5, silent_probes = 4;

std::string line_too_long() {
  return fmt::format(
      R"({{"jsonrpc":"2.0","id":null,"error":{{"code":{},"message":"a line has at most {} bytes"}}}})"
      "\n",
      rpc_invalid_request, Session::max_line_bytes);
}

}  // namespace

Session::Session(StreamSocket socket, const RpcTable& table, std::uint64_t client_bytes, Hooks hooks)
    : socket_(std::move(socket)),
      table_(table),
      hooks_(std::move(hooks)),
      outbox_(client_bytes),
      deadline_(socket_.get_executor()) {}

void Session::start() {
  read();
}

void Session::read() {
  socket_.async_read_some(asio::buffer(input_),
                          [self = shared_from_this()](error_code error, std::size_t bytes) {
                            if (self->state_ == State::closed) return;
                            if (error == asio::error::eof) {
                              self->end_input();
                            } else if (error) {
                              self->close(hung_up);
                            } else {
                              self->received(bytes);
                              if (self->state_ != State::closed) self->read();
                            }
                          });
}

void Session::end_input() {
  input_ended_ = true;
  watch_for_hang_up();
  finish_when_idle();
  close_when_sent();
}

void Session::watch_for_hang_up() {
  error_code ignored;
  socket_.set_option(asio::socket_base::keep_alive(true), ignored);
  // On a Unix socket these fail, and are not needed.
  const int descriptor = socket_.native_handle();
  ::setsockopt(descriptor, IPPROTO_TCP, TCP_KEEPIDLE, &probe_after_s, sizeof probe_after_s);
  ::setsockopt(descriptor, IPPROTO_TCP, TCP_KEEPINTVL, &probe_every_s, sizeof probe_every_s);
  ::setsockopt(descriptor, IPPROTO_TCP, TCP_KEEPCNT, &silent_probes, sizeof silent_probes);
  socket_.async_wait(StreamSocket::wait_error, [self = shared_from_this()](error_code error) {
    if (!error) self->close(hung_up);
  });
}

void Session::finish_when_idle() {
  if (state_ != State::open || !input_ended_ || answers_due() || subscriptions_.any()) return;
  finish(hung_up, patience);
}

void Session::received(std::size_t bytes) {
  if (state_ != State::open || deaf_) return;
  const bool fits = framer_.feed({input_.data(), bytes}, [this](std::string_view line) {
    if (state_ == State::open) handle(line);
  });
  if (fits || state_ != State::open) return;
  reply(line_too_long());
  finish("it sent too long a line", patience);
}

void Session::handle(std::string_view line) {
  if (line.empty()) return;
  const auto due = std::make_shared<std::shared_ptr<int>>(answer_token_);
  table_.handle(line, subscriptions_, [weak = weak_from_this(), due](std::string answer) {
    due->reset();
    if (const auto self = weak.lock()) self->reply(std::move(answer));
  });
  hooks_.subscribed();  // a notification has no reply
}

void Session::reply(std::string line) {
  if (state_ == State::closed) return;
  hooks_.subscribed();  // before the client learns of it: from then on nothing may be missed
  if (!outbox_.push_reply(std::move(line))) {
    close("it does not take its replies");
    return;
  }
  write();
  finish_when_idle();
}

void Session::deliver(const Notification& notification) {
  if (state_ != State::open || !subscriptions_.has(notification.topic)) return;
  if (notification.topic == Topic::pixel && due_pixels(1) == 0) return;
  if (notification.topic == Topic::spectrum && !spectrum_due()) return;
  const bool brief = notification.topic == Topic::pixel && !subscriptions_.tones;
  const SharedLine& line = brief ? notification.brief : notification.line;
  if (line == nullptr) return;  // published before this client asked for it
  outbox_.push_notification(notification.topic, notification.sample, line);
  write();
}

void Session::deliver_loss(Topic topic, const Skipped& lost) {
  if (state_ != State::open || !subscriptions_.has(topic)) return;
  const std::uint64_t due = topic == Topic::pixel ? due_pixels(lost.count) : lost.count;
  outbox_.skip(topic, due, lost.first_sample, lost.last_sample);
  write();
}

// How many of the next `seen` pixels are due by `every`.
std::uint64_t Session::due_pixels(std::uint64_t seen) {
  const std::uint64_t every = subscriptions_.every;
  const std::uint64_t before = (pixels_seen_ + every - 1) / every;
  pixels_seen_ += seen;
  return (pixels_seen_ + every - 1) / every - before;
}

// Spectra come as often as the most eager client wants them; a tenth of this client's period may be missing.
bool Session::spectrum_due() {
  using std::chrono::steady_clock;
  const std::chrono::duration<double> seconds(1.0 / subscriptions_.spectrum_hz);
  const auto period = std::chrono::duration_cast<steady_clock::duration>(seconds);
  const auto now = steady_clock::now();
  if (now < next_spectrum_ - period / 10) return false;
  next_spectrum_ = now > next_spectrum_ + period ? now + period : next_spectrum_ + period;
  return true;
}

void Session::write() {
  if (writing_ != 0 || outbox_.empty()) return;
  writing_ = std::min(outbox_.lines().size(), lines_a_write);
  std::vector<asio::const_buffer> buffers;
  buffers.reserve(writing_);
  for (std::size_t i = 0; i < writing_; ++i) buffers.push_back(asio::buffer(*outbox_.lines()[i]));
  asio::async_write(socket_, buffers, [self = shared_from_this()](error_code error, std::size_t) {
    if (self->state_ == State::closed) return;
    if (error) {
      self->close(error.message());
    } else {
      self->written(std::exchange(self->writing_, 0));
    }
  });
}

void Session::written(std::size_t lines) {
  outbox_.pop(lines);
  write();
  close_when_sent();
}

void Session::finish(std::string why, std::chrono::milliseconds at_most) {
  if (state_ == State::closed) return;
  state_ = State::finishing;
  why_ = std::move(why);
  deadline_.expires_after(at_most);
  deadline_.async_wait([self = shared_from_this()](error_code error) {
    if (!error) self->close(self->why_);
  });
  close_when_sent();
}

void Session::close_when_sent() {
  if (state_ != State::finishing || writing_ != 0 || answers_due()) return;
  if (input_ended_) {
    close(why_);
    return;
  }
  // Closing with input unread would reset the connection, and the last lines might never arrive: the client
  // closes.
  error_code ignored;
  socket_.shutdown(StreamSocket::shutdown_send, ignored);
}

void Session::close(const std::string& why) {
  if (std::exchange(state_, State::closed) == State::closed) return;
  error_code ignored;
  socket_.close(ignored);
  deadline_.cancel();
  hooks_.closed(*this, why);
}

}  // namespace combforce
