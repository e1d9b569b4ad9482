#include "server/web/web_server.h"

#include <absl/strings/str_cat.h>

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <thread>
#include <utility>

#include "server/errors.h"
#include "server/listen.h"
#include "server/realtime.h"
#include "server/web/beast_connections.h"

namespace adhesim {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr auto kSweepEvery = std::chrono::seconds(1);
constexpr auto kStopWithin = std::chrono::seconds(1);
// When the process has no file descriptor left, accepting fails at once and for ever.
constexpr auto kAcceptAgainAfter = std::chrono::milliseconds(100);

// As gRPC writes it, so that a host's connections of both kinds count as one peer's.
std::string PeerName(const tcp::endpoint& peer) {
  asio::ip::address address = peer.address();
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    address = asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
  }
  if (address.is_v4()) return absl::StrCat("ipv4:", address.to_string(), ":", peer.port());
  return absl::StrCat("ipv6:%5B", address.to_string(), "%5D:", peer.port());
}

// One attempt, which fits into the empty buffer of a new connection.
void RefuseConnection(tcp::socket socket, const absl::Status& why) {
  const std::string text = absl::StrCat(ReasonOf(why), ": ", why.message(), "\n");
  const std::string answer = absl::StrCat(
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain; charset=utf-8\r\n"
      "Connection: close\r\nContent-Length: ",
      text.size(), "\r\n\r\n", text);
  error_code error;
  socket.non_blocking(true, error);
  socket.write_some(asio::buffer(answer), error);
  socket.shutdown(tcp::socket::shutdown_send, error);
}

}  // namespace

// In the order of construction; destroyed the other way round.
struct WebServer::Parts {
  Parts(const Options& options, ServiceContext* service, SessionCalls* calls)
      : context{options, service, calls, {}, {}, {}, {}},
        io(1),
        acceptor(io),
        accept_again(io),
        sweep(io) {}

  error_code Listen(const std::string& listen);
  void Accept();
  void OnAccept(tcp::socket socket);
  void Sweep();
  void Run();

  WebContext context;
  asio::io_context io;
  tcp::acceptor acceptor;
  asio::steady_timer accept_again;
  asio::steady_timer sweep;
  std::thread thread;
};

error_code WebServer::Parts::Listen(const std::string& listen) {
  error_code error;
  std::string host = HostOf(listen);
  if (host.starts_with("[") && host.ends_with("]")) host = host.substr(1, host.size() - 2);
  tcp::resolver resolver(io);
  const auto found =
      resolver.resolve(host, listen.substr(listen.rfind(':') + 1), tcp::resolver::passive, error);
  if (error) return error;
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor.open(endpoint.protocol(), error);
  // A restarted server has its port at once; a port that is listened on stays taken.
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  return error;
}

void WebServer::Parts::Accept() {
  acceptor.async_accept([this](error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted || !acceptor.is_open()) return;
    if (!error) {
      OnAccept(std::move(socket));
      return Accept();
    }
    accept_again.expires_after(kAcceptAgainAfter);
    accept_again.async_wait([this](error_code aborted) {
      if (!aborted && acceptor.is_open()) Accept();
    });
  });
}

void WebServer::Parts::OnAccept(tcp::socket socket) {
  error_code error;
  const tcp::endpoint endpoint = socket.remote_endpoint(error);
  if (error) return;  // gone already
  socket.set_option(tcp::no_delay(true), error);
  WebPeer peer;
  peer.name = PeerName(endpoint);
  const std::uint32_t limit = context.service->sessions.limits().connections_per_peer;
  peer.share = context.connections.Take(PeerHost(peer.name), limit);
  if (peer.share == nullptr) {
    return RefuseConnection(
        std::move(socket),
        Error(Reason::kTooManyConnections,
              absl::StrCat("this peer has ", limit, " connections, more are not permitted")));
  }
  auto connection = std::make_shared<HttpConnection>(&context, std::move(socket), std::move(peer));
  connection->Register();
  connection->Read();
}

void WebServer::Parts::Sweep() {
  sweep.expires_after(kSweepEvery);
  sweep.async_wait([this](error_code aborted) {
    if (aborted) return;
    const std::int64_t now_ns = MonotonicNs();
    // A connection that is ended here leaves the map later, when its handlers are done.
    std::vector<std::shared_ptr<WebConnection>> all;
    for (const auto& [key, weak] : context.open) all.push_back(weak.lock());
    for (const auto& connection : all) {
      if (connection != nullptr) connection->Sweep(now_ns);
    }
    Sweep();
  });
}

void WebServer::Parts::Run() {
  while (true) {
    try {
      io.run();
      return;
    } catch (const std::exception& error) {
      // Out of memory, in all likelihood: that connection's turn is over, the others go on.
      std::fprintf(stderr, "warning: a connection failed: %s\n", error.what());
    }
  }
}

WebServer::WebServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

WebServer::~WebServer() { Stop(); }

absl::StatusOr<std::unique_ptr<WebServer>> WebServer::Start(const Options& options,
                                                            ServiceContext* context,
                                                            SessionCalls* calls) {
  absl::Status status = CheckListen("--http", options.listen, options.insecure_listen);
  if (!status.ok()) return status;
  if (options.listen.starts_with("unix:")) {
    return absl::InvalidArgumentError("--http takes HOST:PORT, browsers know no unix sockets");
  }
  std::unique_ptr<WebServer> server(
      new WebServer(std::make_unique<Parts>(options, context, calls)));
  Parts& parts = *server->parts_;
  if (const error_code error = parts.Listen(options.listen)) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", options.listen, " for HTTP: ", error.message()));
  }
  server->address_ =
      absl::StrCat(HostOf(options.listen), ":", parts.acceptor.local_endpoint().port());
  parts.Accept();
  parts.Sweep();
  parts.thread = std::thread([&parts] { parts.Run(); });
  return server;
}

void WebServer::Stop() {
  if (!parts_->thread.joinable()) return;
  Parts& parts = *parts_;
  asio::post(parts.io, [&parts] {
    error_code ignored;
    parts.acceptor.close(ignored);
    parts.accept_again.cancel();
    std::vector<std::shared_ptr<WebConnection>> all;
    for (const auto& [key, weak] : parts.context.open) all.push_back(weak.lock());
    for (const auto& connection : all) {
      if (connection == nullptr) continue;
      connection->Close(Error(Reason::kDraining, "the server is going away; try another"));
    }
  });
  const auto until = std::chrono::steady_clock::now() + kStopWithin;
  while (parts.context.open_count > 0 && std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  parts.io.stop();
  parts.thread.join();
  // Nobody may call into the io_context any more: not the sessions, not the workers.
  for (const auto& [key, weak] : parts.context.open) {
    if (const auto connection = weak.lock()) connection->Abort();
  }
}

}  // namespace adhesim
