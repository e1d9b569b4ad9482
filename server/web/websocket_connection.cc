#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <array>
#include <boost/asio/post.hpp>
#include <utility>

#include "server/errors.h"
#include "server/realtime.h"
#include "server/web/beast_connections.h"

namespace adhesim {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;

constexpr char kSubprotocol[] = "adhesim.v1.pb";
constexpr std::size_t kReadBytes = 64 << 10;  // at a time
constexpr std::uint32_t kLargeMessages = 4;

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1e3));
}

bool Exceeds(std::int64_t since_ns, std::int64_t now_ns, double limit_s) {
  return now_ns - since_ns > static_cast<std::int64_t>(limit_s * 1e9);
}

// The close code that goes with an error of a whole connection.
websocket::close_code CodeOf(const absl::Status& why) {
  const std::string reason = ReasonOf(why);
  if (reason == ReasonName(Reason::kMessageTooLarge)) return websocket::close_code::too_big;
  if (reason == ReasonName(Reason::kTooManyRequests)) return websocket::close_code::try_again_later;
  if (reason == ReasonName(Reason::kDraining)) return websocket::close_code::going_away;
  return websocket::close_code::policy_error;
}

}  // namespace

WebSocketConnection::WebSocketConnection(WebContext* context, beast::tcp_stream stream,
                                         WebPeer peer)
    : WebConnection(context), socket_(std::move(stream)), peer_(std::move(peer)) {}

WebSocketConnection::~WebSocketConnection() {
  if (client_ != nullptr) client_->Leave();
}

void WebSocketConnection::Accept(const http::request<http::empty_body>& upgrade) {
  client_ = std::make_shared<ClientConnection>(context_->service, context_->calls, peer_.name,
                                               [this] { Wake(); });
  socket_.next_layer().expires_never();  // the WebSocket has timeouts of its own
  const WebServer::Patience& patience = context_->options.patience;
  socket_.set_option(websocket::stream_base::timeout{Milliseconds(patience.handshake_s),
                                                     Milliseconds(patience.idle_s), true});
  // Beast's default would cut a frame into 4 KiB pieces (2.5 times the time for 360 KB).
  socket_.auto_fragment(false);
  socket_.binary(true);
  socket_.read_message_max(0);  // CheckIncoming() says why a message is too large, Beast would not
  const bool offered =
      absl::StrContains(absl::string_view(upgrade[http::field::sec_websocket_protocol].data(),
                                          upgrade[http::field::sec_websocket_protocol].size()),
                        kSubprotocol);
  socket_.set_option(websocket::stream_base::decorator([offered](websocket::response_type& answer) {
    answer.set(http::field::server, "adhesim");
    if (offered) answer.set(http::field::sec_websocket_protocol, kSubprotocol);
  }));
  socket_.async_accept(upgrade, [this, self = shared_from_this()](beast::error_code error) {
    if (error) return Abort();
    Read();
    Pump();
  });
}

// Many wakes before the server's thread gets round to it are one. Only that thread holds a
// shared_ptr to this, so that the last one goes there; nobody calls Wake() after Leave().
void WebSocketConnection::Wake() {
  if (wake_posted_.exchange(true)) return;
  asio::post(socket_.get_executor(), [this, weak = weak_from_this()] {
    const std::shared_ptr<WebConnection> self = weak.lock();
    if (self == nullptr) return;
    wake_posted_.store(false);
    Pump();
  });
}

void WebSocketConnection::Read() {
  socket_.async_read_some(
      incoming_, kReadBytes,
      [this, self = shared_from_this()](beast::error_code error, std::size_t) { OnRead(error); });
}

void WebSocketConnection::OnRead(beast::error_code error) {
  if (error) return Abort();  // the client is gone, or Beast has told it what it did wrong
  if (closing_) return;
  absl::Status status = CheckIncoming();
  if (status.ok() && socket_.is_message_done()) {
    const auto bytes = incoming_.data();
    status = client_->Receive({static_cast<const char*>(bytes.data()), bytes.size()},
                              std::exchange(large_message_, nullptr));
    message_since_ns_ = 0;
    const bool was_large = incoming_.size() > kReadBytes;
    incoming_.clear();
    if (was_large) incoming_.shrink_to_fit();
  }
  if (!status.ok()) return CloseWith(CodeOf(status), status);
  Read();
}

absl::Status WebSocketConnection::CheckIncoming() {
  const Limits& limits = context_->service->sessions.limits();
  if (socket_.got_text()) {
    return Error(Reason::kArgumentInvalid,
                 "a text message; permitted are binary ones, each an adhesim.v1.ClientMessage");
  }
  if (incoming_.size() > limits.request_bytes) {
    return Error(
        Reason::kMessageTooLarge,
        absl::StrCat("a message of more than ", limits.request_bytes, " bytes is not permitted"));
  }
  if (incoming_.size() > limits.stream_message_bytes && large_message_ == nullptr) {
    large_message_ = context_->large_messages.Take("", kLargeMessages);
    if (large_message_ == nullptr) {
      return Error(Reason::kTooManyRequests,
                   absl::StrCat(kLargeMessages, " messages of more than ",
                                limits.stream_message_bytes, " bytes are under way already"));
    }
  }
  if (message_since_ns_ == 0) message_since_ns_ = MonotonicNs();
  return absl::OkStatus();
}

// Starts a write when none is under way; when there is nothing more to write and the connection is
// closing, closes it.
void WebSocketConnection::Pump() {
  if (writing_ || !socket_.is_open()) return;
  if (!client_->Next(&outgoing_)) {
    if (!closing_) return;
    if (farewell_.empty()) {
      writing_ = true;  // nothing after it
      socket_.async_close(close_reason_,
                          [this, self = shared_from_this()](beast::error_code) { Abort(); });
      return;
    }
    outgoing_ = {std::exchange(farewell_, {}), nullptr, ""};
  }
  writing_ = true;
  writing_since_ns_ = MonotonicNs();
  std::array<asio::const_buffer, 3> pieces{asio::buffer(outgoing_.head), asio::const_buffer(),
                                           asio::buffer(outgoing_.tail)};
  if (outgoing_.shared != nullptr) pieces[1] = asio::buffer(*outgoing_.shared);
  socket_.async_write(pieces, [this, self = shared_from_this()](beast::error_code error,
                                                                std::size_t) { OnWrite(error); });
}

void WebSocketConnection::OnWrite(beast::error_code error) {
  writing_ = false;
  outgoing_ = {};
  if (error) return Abort();
  Pump();
}

void WebSocketConnection::CloseWith(CloseCode code, const absl::Status& why) {
  if (closing_) return;
  client_->Leave();
  closing_ = true;
  closing_since_ns_ = MonotonicNs();
  close_reason_ = {code, ReasonOf(why)};
  farewell_ = ClientConnection::Farewell(why);
  Pump();
}

void WebSocketConnection::Close(const absl::Status& why) {
  if (closing_) return;
  // Streams have ended by now; how, the client shall still be told.
  closing_ = true;
  closing_since_ns_ = MonotonicNs();
  close_reason_ = {CodeOf(why), ReasonOf(why)};
  farewell_ = ClientConnection::Farewell(why);
  Pump();
}

void WebSocketConnection::Sweep(std::int64_t now_ns) {
  const WebServer::Patience& patience = context_->options.patience;
  if (closing_ && Exceeds(closing_since_ns_, now_ns, patience.write_s)) return Abort();
  if (writing_ && !closing_ && Exceeds(writing_since_ns_, now_ns, patience.write_s)) {
    return Abort();
  }
  if (message_since_ns_ != 0 && Exceeds(message_since_ns_, now_ns, patience.message_s)) {
    message_since_ns_ = 0;
    CloseWith(CloseCode::policy_error,
              Error(Reason::kMessageTooSlow, absl::StrCat("a message took more than ",
                                                          patience.message_s, " s to come in")));
  }
}

void WebSocketConnection::Abort() {
  client_->Leave();
  beast::get_lowest_layer(socket_).close();
}

}  // namespace adhesim
