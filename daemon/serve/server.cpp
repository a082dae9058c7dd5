#include "daemon/serve/server.hpp"

#include <spdlog/spdlog.h>

#include <atomic>
#include <future>
#include <utility>

#include "daemon/serve/messages.hpp"
#include "daemon/serve/methods.hpp"
#include "daemon/serve/socket_server.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {

namespace {

SocketServer::Addresses addresses(const ServerSettings& settings) {
  SocketServer::Addresses result{settings.unix_socket, settings.address, {}};
  if (settings.port != 0) result.port = settings.port;
  return result;
}

SharedLine pixel_line(const RetiredPixel& pixel, PixelFields fields) {
  const Description& description = pixel.analysis.description;
  std::string line;
  append_pixel_line(line,
                    {pixel.pixel, *description.comb, *description.channels, pixel.tip_nm,
                     pixel.analysis.model, pixel.fit, pixel.analysis.tip()},
                    fields);
  return std::make_shared<const std::string>(std::move(line));
}

SharedLine shared_line(Topic topic, const Json& params) {
  return std::make_shared<const std::string>(notification_line(to_string(topic), params));
}

}  // namespace

class Server::Impl {
 public:
  explicit Impl(const ServerSettings& settings) : sockets(addresses(settings), settings.client_bytes) {}

  SocketServer sockets;
  std::atomic<std::uint64_t> pixel_sample{0};  // of the last pixel: frames have no sample of their own
};

Server::Server(const ServerSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
Server::~Server() = default;

void Server::run(Instrument& instrument) {
  RpcTable table("Combforce", COMBFORCE_VERSION);
  add_methods(table, instrument,
              [this](std::function<void()> task) { impl_->sockets.post(std::move(task)); });
  const auto every_second = [this, &instrument] {
    if (!impl_->sockets.wanted().status) return;
    const InstrumentStatus status = instrument.status();
    impl_->sockets.publish(
        {Topic::status, status.sample, shared_line(Topic::status, encode(status)), nullptr});
  };
  std::future<void> stopped;
  const auto wind_down = [this, &instrument, &stopped] {
    spdlog::info("stopping");
    stopped = std::async(std::launch::async, [this, &instrument] {
      const std::shared_ptr<void> in_any_case(nullptr, [this](void*) { impl_->sockets.finish(); });
      instrument.stop();
    });
  };
  impl_->sockets.run(
      table, every_second, [&instrument](double hz) { instrument.set_spectrum_rate(hz); }, wind_down);
  stopped.get();
}

void Server::stop() {
  impl_->sockets.stop();
}
void Server::stop_on_signals() {
  impl_->sockets.stop_on_signals();
}
std::string Server::tcp_endpoint() const {
  return impl_->sockets.tcp_endpoint();
}

void Server::publish_pixel(const RetiredPixel& pixel) {
  const std::uint64_t sample = pixel.pixel.span.first_sample;
  impl_->pixel_sample.store(sample, std::memory_order_relaxed);
  const Wanted wanted = impl_->sockets.wanted();
  if (!wanted.pixel && !wanted.pixel_brief) return;
  impl_->sockets.publish({Topic::pixel, sample, wanted.pixel ? pixel_line(pixel, PixelFields::all) : nullptr,
                          wanted.pixel_brief ? pixel_line(pixel, PixelFields::fit) : nullptr});
}

void Server::publish_line(const LineDone& line) {
  if (!impl_->sockets.wanted().line) return;
  impl_->sockets.publish(
      {Topic::line, line.mark.first_sample, shared_line(Topic::line, encode(line)), nullptr});
}

void Server::publish_frame(const FrameDone& frame) {
  if (!impl_->sockets.wanted().frame) return;
  const std::uint64_t sample = impl_->pixel_sample.load(std::memory_order_relaxed);
  impl_->sockets.publish({Topic::frame, sample, shared_line(Topic::frame, encode(frame)), nullptr});
}

void Server::publish_spectrum(const Spectrum& spectrum) {
  impl_->sockets.publish(
      {Topic::spectrum, spectrum.first_sample, shared_line(Topic::spectrum, encode(spectrum)), nullptr});
}

void Server::publish_event(const Event& event) {
  if (!impl_->sockets.wanted().event) return;
  impl_->sockets.publish(
      {Topic::event, event.first_sample, shared_line(Topic::event, encode(event)), nullptr});
}

}  // namespace combforce
