#pragma once

// The connections of a WebServer. For its sources only: Boost goes no further.

#include <absl/strings/string_view.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/web/client_connection.h"
#include "server/web/web_server.h"

namespace adhesim {

class WebConnection;

// What all connections share. Used on the server's own thread, and outlives them.
struct WebContext {
  WebServer::Options options;
  ServiceContext* service;
  SessionCalls* calls;
  PeerCounter connections;
  // Messages larger than those of streams, under way or being dealt with: few at a time, since each
  // may hold as much as a scene may have.
  PeerCounter large_messages;
  std::map<WebConnection*, std::weak_ptr<WebConnection>> open;
  std::atomic<std::size_t> open_count{0};
};

// A connection while it lives. On the server's own thread.
class WebConnection : public std::enable_shared_from_this<WebConnection> {
 public:
  explicit WebConnection(WebContext* context) : context_(context) {}
  virtual ~WebConnection();
  // To be called once, when there is a shared_ptr to it.
  void Register();

  // Once a second: ends what takes too long.
  virtual void Sweep(std::int64_t now_ns) = 0;
  // Ends politely: the server is going away.
  virtual void Close(const absl::Status& why) = 0;
  // Ends at once.
  virtual void Abort() = 0;

 protected:
  WebContext* const context_;
};

// Whose connection it is, and its share of what that peer may have.
struct WebPeer {
  std::string name;  // as in PeerHost()
  PeerCounter::Share share;
};

// Answers HTTP requests, one after the other.
class HttpConnection final : public WebConnection {
 public:
  HttpConnection(WebContext* context, boost::asio::ip::tcp::socket socket, WebPeer peer);

  void Read();
  void Sweep(std::int64_t) override {}  // the stream has timeouts of its own
  void Close(const absl::Status&) override { Abort(); }
  void Abort() override;

 private:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;

  void OnRead(boost::beast::error_code error);
  void Route();
  void AnswerPage(absl::string_view path);
  void AnswerRecording(const std::string& name);
  void SendFile(std::shared_ptr<int> file, std::uint64_t from, std::uint64_t to);
  // An answer of one line; the connection is closed after it when the request was not read to its
  // end.
  void AnswerText(boost::beast::http::status status, std::string text);
  void Refuse(boost::beast::http::status status, const absl::Status& why);
  void Send(boost::beast::http::response<boost::beast::http::span_body<const char>> response);
  void Finish(boost::beast::error_code error, bool keep_alive);
  void Drain(std::size_t read);
  void Expire();

  boost::beast::tcp_stream stream_;
  WebPeer peer_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::empty_body>> parser_;
  std::string text_;         // of the answer under way
  std::vector<char> piece_;  // of the file under way
};

// Carries a ClientConnection over a WebSocket.
class WebSocketConnection final : public WebConnection {
 public:
  WebSocketConnection(WebContext* context, boost::beast::tcp_stream stream, WebPeer peer);

  ~WebSocketConnection() override;

  // Answers the request that asks for a WebSocket, and goes on from there.
  void Accept(const boost::beast::http::request<boost::beast::http::empty_body>& upgrade);
  void Sweep(std::int64_t now_ns) override;
  void Close(const absl::Status& why) override;
  void Abort() override;

 private:
  using CloseCode = boost::beast::websocket::close_code;

  void Wake();  // any thread
  void Read();
  void OnRead(boost::beast::error_code error);
  // What is wrong with what has come in so far.
  absl::Status CheckIncoming();
  void Pump();
  void OnWrite(boost::beast::error_code error);
  void CloseWith(CloseCode code, const absl::Status& why);

  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  WebPeer peer_;
  std::shared_ptr<ClientConnection> client_;
  std::atomic<bool> wake_posted_{false};

  boost::beast::flat_buffer incoming_;
  std::int64_t message_since_ns_ = 0;  // first byte of an incomplete message; 0: there is none
  PeerCounter::Share large_message_;

  ClientConnection::Outgoing outgoing_;
  bool writing_ = false;
  std::int64_t writing_since_ns_ = 0;

  bool closing_ = false;
  std::int64_t closing_since_ns_ = 0;
  boost::beast::websocket::close_reason close_reason_;
  std::string farewell_;  // last message, until it is under way
};

}  // namespace adhesim
