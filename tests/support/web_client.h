#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "adhesim/v1/connection.pb.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace adhesim::test {

// A client's end of the HTTP port on plain sockets: it can do what no library would. Every wait has
// an end, so that a test fails rather than hangs.
class RawConnection {
 public:
  // `address`: "127.0.0.1:PORT".
  explicit RawConnection(const std::string& address) : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const std::size_t colon = address.rfind(':');
    sockaddr_in where{};
    where.sin_family = AF_INET;
    where.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1))));
    ::inet_pton(AF_INET, address.substr(0, colon).c_str(), &where.sin_addr);
    const timeval patience{30, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    ::setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
    const int on = 1;
    ::setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    connected_ = ::connect(fd_, reinterpret_cast<sockaddr*>(&where), sizeof(where)) == 0;
  }
  ~RawConnection() { Close(); }
  RawConnection(const RawConnection&) = delete;
  RawConnection& operator=(const RawConnection&) = delete;

  bool connected() const { return connected_; }
  int fd() const { return fd_; }

  void Close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

  // False when the other end is closed.
  bool Send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      bytes.remove_prefix(sent);
    }
    return true;
  }

  // Exactly so many bytes; nothing when the connection ends before.
  std::optional<std::string> Read(std::size_t count) {
    while (unread_.size() < count) {
      if (!Fill()) return std::nullopt;
    }
    std::string bytes = unread_.substr(0, count);
    unread_.erase(0, count);
    return bytes;
  }

  // Up to and with the mark; what there is when the connection ends before.
  std::string ReadTo(std::string_view mark) {
    while (unread_.find(mark) == std::string::npos) {
      if (!Fill()) return std::exchange(unread_, "");
    }
    return *Read(unread_.find(mark) + mark.size());
  }

  // Everything until the other end closes.
  std::string ReadAll() {
    while (Fill()) {
    }
    return std::exchange(unread_, "");
  }

 private:
  bool Fill() {
    char piece[1 << 16];
    const ssize_t count = ::recv(fd_, piece, sizeof(piece), 0);
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      ADD_FAILURE() << "nothing came within 30 s";
    }
    if (count <= 0) return false;
    unread_.append(piece, count);
    return true;
  }

  int fd_;
  bool connected_ = false;
  std::string unread_;
};

struct HttpReply {
  int status = 0;
  std::map<std::string, std::string> fields;
  std::string body;
};

// The next reply of a connection.
inline HttpReply ReadReply(RawConnection* connection, bool head_only = false) {
  HttpReply reply;
  const std::string head = connection->ReadTo("\r\n\r\n");
  if (!head.starts_with("HTTP/1.1 ")) return reply;
  reply.status = std::stoi(head.substr(9, 3));
  for (std::size_t at = head.find("\r\n") + 2; at + 2 < head.size();) {
    const std::size_t end = head.find("\r\n", at);
    const std::size_t colon = head.find(": ", at);
    if (colon < end)
      reply.fields[head.substr(at, colon - at)] = head.substr(colon + 2, end - colon - 2);
    at = end + 2;
  }
  const auto length = reply.fields.find("Content-Length");
  if (length != reply.fields.end() && !head_only) {
    reply.body = connection->Read(std::stoul(length->second)).value_or("");
  }
  return reply;
}

// "GET target" with further header lines ("Range: bytes=0-1\r\n").
inline HttpReply Get(const std::string& address, const std::string& target,
                     const std::string& more = "", const std::string& method = "GET") {
  RawConnection connection(address);
  const std::string host =
      more.find("Host:") == std::string::npos ? "Host: " + address + "\r\n" : "";
  connection.Send(method + " " + target + " HTTP/1.1\r\n" + host + more + "\r\n");
  return ReadReply(&connection, method == "HEAD");
}

// A WebSocket client.
class WebSocketClient {
 public:
  enum Opcode { kContinuation = 0, kText = 1, kBinary = 2, kCloseFrame = 8, kPing = 9, kPong = 10 };
  struct Frame {
    int opcode = 0;
    bool last = true;
    std::string payload;
  };

  explicit WebSocketClient(const std::string& address, const std::string& more = "")
      : raw(address) {
    // Key and answer are those of RFC 6455, 1.3.
    raw.Send("GET /v1/ws HTTP/1.1\r\nHost: " + address +
             "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
             more + "\r\n");
    reply = ReadReply(&raw);
    EXPECT_TRUE(reply.status != 101 ||
                reply.fields["Sec-WebSocket-Accept"] == "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
  }

  bool SendFrame(int opcode, std::string_view payload, bool last = true) {
    std::string frame(1, static_cast<char>((last ? 0x80 : 0) | opcode));
    const std::uint64_t size = payload.size();
    if (size < 126) {
      frame += static_cast<char>(0x80 | size);
    } else {
      const int bytes = size < 65536 ? 2 : 8;
      frame += static_cast<char>(0x80 | (bytes == 2 ? 126 : 127));
      for (int i = bytes - 1; i >= 0; --i) frame += static_cast<char>(size >> (8 * i));
    }
    constexpr std::string_view kMask = "mask";
    frame += kMask;
    for (std::size_t i = 0; i < size; ++i) frame += static_cast<char>(payload[i] ^ kMask[i % 4]);
    return raw.Send(frame);
  }
  bool Send(const v1::ClientMessage& message) {
    return SendFrame(kBinary, message.SerializeAsString());
  }

  // The next frame, answering pings; nothing when the connection has ended.
  std::optional<Frame> ReadFrame() {
    while (true) {
      const std::optional<std::string> start = raw.Read(2);
      if (!start) return std::nullopt;
      Frame frame;
      frame.opcode = (*start)[0] & 0x0f;
      frame.last = ((*start)[0] & 0x80) != 0;
      std::uint64_t size = (*start)[1] & 0x7f;
      if (size >= 126) {
        const std::optional<std::string> more = raw.Read(size == 126 ? 2 : 8);
        if (!more) return std::nullopt;
        size = 0;
        for (const char byte : *more) size = size << 8 | static_cast<std::uint8_t>(byte);
      }
      std::optional<std::string> payload = raw.Read(size);
      if (!payload) return std::nullopt;
      frame.payload = *std::move(payload);
      if (frame.opcode == kCloseFrame && frame.payload.size() >= 2) {
        close_code = static_cast<std::uint8_t>(frame.payload[0]) << 8 |
                     static_cast<std::uint8_t>(frame.payload[1]);
        close_reason = frame.payload.substr(2);
      }
      if (frame.opcode != kPing) return frame;
      SendFrame(kPong, frame.payload);
    }
  }

  // The next message; nothing when the connection has ended or is closed.
  std::optional<v1::ServerMessage> Read() {
    std::optional<Frame> frame = ReadFrame();
    while (frame && frame->opcode == kPong) frame = ReadFrame();
    if (!frame || frame->opcode == kCloseFrame) return std::nullopt;
    EXPECT_EQ(frame->opcode, kBinary);
    EXPECT_TRUE(frame->last);
    v1::ServerMessage message;
    EXPECT_TRUE(message.ParseFromString(frame->payload));
    return message;
  }

  // The next message that fits; a default one, and a failure, when the connection ends.
  template <typename Condition>
  v1::ServerMessage ReadUntil(const Condition& condition) {
    while (const std::optional<v1::ServerMessage> message = Read()) {
      if (condition(*message)) return *message;
    }
    ADD_FAILURE() << "the connection has ended: " << close_code << " " << close_reason;
    return {};
  }
  // The answer, or the end, of a stream.
  v1::ServerMessage ReadAnswer(std::uint32_t stream) {
    return ReadUntil([stream](const v1::ServerMessage& message) {
      return message.stream() == stream && !message.has_watch() && !message.has_interact();
    });
  }
  // Reads to the end; the status of the whole connection, if one was said.
  google::rpc::Status ReadFarewell() {
    google::rpc::Status status;
    while (const std::optional<v1::ServerMessage> message = Read()) {
      if (message->stream() == 0) status = message->ended();
    }
    return status;
  }

  RawConnection raw;
  HttpReply reply;  // to the handshake
  int close_code = 0;
  std::string close_reason;
};

// The reason of a stream's end; "" for OK.
inline std::string ReasonIn(const google::rpc::Status& status) {
  google::rpc::ErrorInfo info;
  if (status.details_size() == 0 || !status.details(0).UnpackTo(&info)) return "";
  EXPECT_EQ(info.domain(), "adhesim");
  return info.reason();
}

}  // namespace adhesim::test
