#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/write.hpp>
#include <utility>

#include "server/errors.h"
#include "server/web/beast_connections.h"
#include "server/web/http_rules.h"
#include "server/web/page_files.h"

namespace adhesim {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;

constexpr std::uint32_t kHeaderBytes = 8 << 10;
constexpr std::size_t kFilePieceBytes = 64 << 10;
constexpr std::size_t kDrainBytes = 1 << 20;
constexpr char kWebSocketPath[] = "/v1/ws";

absl::string_view View(beast::string_view text) { return {text.data(), text.size()}; }

absl::string_view FromStd(std::string_view text) { return {text.data(), text.size()}; }

// The path of a request's target, without its query.
absl::string_view PathOf(absl::string_view target) {
  const absl::string_view path = target.substr(0, target.find('?'));
  return path == "/" ? "/index.html" : path;
}

// A regular file, open for reading; null when there is none. Closes itself.
std::shared_ptr<int> OpenFile(const std::string& path, std::uint64_t* size) {
  // A link may lead out of the directory, and a pipe would make the server wait.
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (fd < 0) return nullptr;
  std::shared_ptr<int> file(new int(fd), [](int* open) {
    ::close(*open);
    delete open;
  });
  struct stat info {};
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return nullptr;
  *size = static_cast<std::uint64_t>(info.st_size);
  return file;
}

template <typename Body>
void SetCommonFields(http::response<Body>* response) {
  response->set(http::field::server, "adhesim");
  response->set("X-Content-Type-Options", "nosniff");
  response->set("Referrer-Policy", "no-referrer");
  response->set("Cross-Origin-Resource-Policy", "same-origin");
}

}  // namespace

WebConnection::~WebConnection() {
  if (context_->open.erase(this) > 0) --context_->open_count;
}

void WebConnection::Register() {
  context_->open.emplace(this, weak_from_this());
  ++context_->open_count;
}

HttpConnection::HttpConnection(WebContext* context, asio::ip::tcp::socket socket, WebPeer peer)
    : WebConnection(context), stream_(std::move(socket)), peer_(std::move(peer)) {}

void HttpConnection::Abort() { stream_.close(); }

// The time for what comes next, reading or writing.
void HttpConnection::Expire() {
  stream_.expires_after(
      std::chrono::milliseconds(static_cast<int>(context_->options.patience.request_s * 1e3)));
}

void HttpConnection::Read() {
  parser_.emplace();
  parser_->header_limit(kHeaderBytes);
  Expire();
  http::async_read_header(
      stream_, buffer_, *parser_,
      [this, self = shared_from_this()](beast::error_code error, std::size_t) { OnRead(error); });
}

void HttpConnection::OnRead(beast::error_code error) {
  if (!error && parser_->is_done()) return Route();
  if (!error) return AnswerText(http::status::bad_request, "requests here have no body");
  if (error == http::error::header_limit) {
    return AnswerText(http::status::request_header_fields_too_large,
                      absl::StrCat("the request's header has more than ", kHeaderBytes, " bytes"));
  }
  if (error == http::error::end_of_stream || error == http::error::partial_message ||
      error.category() != http::make_error_code(http::error::bad_version).category()) {
    return Abort();  // the client is gone, or took too long
  }
  AnswerText(http::status::bad_request, absl::StrCat("this is not HTTP/1: ", error.message()));
}

void HttpConnection::Route() {
  const Request& request = parser_->get();
  const absl::Status permitted =
      CheckHostAndOrigin(View(request[http::field::host]), View(request[http::field::origin]),
                         context_->options.listen, context_->options.insecure_listen);
  if (!permitted.ok()) return Refuse(http::status::forbidden, permitted);
  const absl::string_view path = PathOf(View(request.target()));
  if (path == kWebSocketPath) {
    if (!websocket::is_upgrade(request)) {
      return AnswerText(http::status::upgrade_required, "a WebSocket is served here");
    }
    auto socket =
        std::make_shared<WebSocketConnection>(context_, std::move(stream_), std::move(peer_));
    socket->Register();
    socket->Accept(request);
    return;
  }
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    return AnswerText(http::status::method_not_allowed, "only GET and HEAD are served here");
  }
  if (path == "/healthz") {
    const bool draining = context_->service->sessions.draining();
    return AnswerText(draining ? http::status::service_unavailable : http::status::ok,
                      draining ? "draining" : "ok");
  }
  if (const std::optional<std::string> name = RecordingName(path)) return AnswerRecording(*name);
  AnswerPage(path);
}

void HttpConnection::AnswerPage(absl::string_view path) {
  const std::span<const PageFile> files = PageFiles();
  const auto file = std::find_if(files.begin(), files.end(), [path](const PageFile& each) {
    return FromStd(each.path) == path;
  });
  if (file == files.end()) return AnswerText(http::status::not_found, "there is no such page");
  const Request& request = parser_->get();
  const bool known = MatchesEtag(View(request[http::field::if_none_match]), FromStd(file->etag));
  http::response<http::span_body<const char>> response;
  response.result(known ? http::status::not_modified : http::status::ok);
  response.set(http::field::etag, {file->etag.data(), file->etag.size()});
  const absl::string_view cache = CacheControl(path);
  response.set(http::field::cache_control, {cache.data(), cache.size()});
  if (!known) {
    response.set(http::field::content_type, {file->content_type.data(), file->content_type.size()});
    response.set("Content-Security-Policy",
                 ContentSecurityPolicy(View(request[http::field::host])));
    response.body() = {file->bytes.data(), file->bytes.size()};
  }
  Send(std::move(response));
}

void HttpConnection::AnswerText(http::status status, std::string text) {
  http::response<http::span_body<const char>> response;
  response.result(status);
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  response.set(http::field::cache_control, "no-store");
  if (status == http::status::method_not_allowed) response.set(http::field::allow, "GET, HEAD");
  if (status == http::status::upgrade_required) response.set(http::field::upgrade, "websocket");
  text_ = std::move(text);
  response.body() = {text_.data(), text_.size()};
  Send(std::move(response));
}

void HttpConnection::Refuse(http::status status, const absl::Status& why) {
  AnswerText(status, absl::StrCat(ReasonOf(why), ": ", why.message()));
}

void HttpConnection::Send(http::response<http::span_body<const char>> response) {
  const Request& request = parser_->get();
  SetCommonFields(&response);
  const bool keep_alive = parser_->is_done() && request.keep_alive();
  response.version(11);
  response.keep_alive(keep_alive);
  response.prepare_payload();
  auto kept = std::make_shared<http::response<http::span_body<const char>>>(std::move(response));
  if (request.method() == http::verb::head) kept->body() = {};
  Expire();
  http::async_write(stream_, *kept,
                    [this, self = shared_from_this(), kept, keep_alive](
                        beast::error_code error, std::size_t) { Finish(error, keep_alive); });
}

void HttpConnection::Finish(beast::error_code error, bool keep_alive) {
  if (error) return Abort();
  if (keep_alive) return Read();
  stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, error);
  Expire();
  Drain(0);
}

// The client closes when it has read the answer. To close before would reset the connection when
// something of the client is unread, and could cost it the answer.
void HttpConnection::Drain(std::size_t read) {
  if (read > kDrainBytes) return Abort();
  piece_.resize(kFilePieceBytes);
  stream_.async_read_some(asio::buffer(piece_), [this, self = shared_from_this(), read](
                                                    beast::error_code error, std::size_t count) {
    error ? Abort() : Drain(read + count);
  });
}

void HttpConnection::AnswerRecording(const std::string& name) {
  std::uint64_t size = 0;
  std::shared_ptr<int> file;
  const auto& find = context_->service->sessions.recordings().find;
  const absl::StatusOr<std::string> path = find ? find(name) : absl::NotFoundError("");
  if (path.ok()) file = OpenFile(*path, &size);
  if (file == nullptr) return AnswerText(http::status::not_found, "there is no such recording");
  const Request& request = parser_->get();
  ByteRange range;
  // If-Range asks for the rest of a version that it has; recordings have no versions.
  const bool may_be_part =
      request.method() == http::verb::get && request.find(http::field::if_range) == request.end();
  const RangeKind kind =
      ParseRange(may_be_part ? View(request[http::field::range]) : "", size, &range);
  auto response = std::make_shared<http::response<http::empty_body>>();
  SetCommonFields(response.get());
  response->version(11);
  response->keep_alive(request.keep_alive());
  response->set(http::field::accept_ranges, "bytes");
  response->set(http::field::cache_control, "no-cache");  // it may still grow
  response->set(http::field::content_type, "application/octet-stream");
  std::uint64_t end = size == 0 ? 0 : range.last + 1;
  response->result(http::status::ok);
  if (kind == RangeKind::kPart) {
    response->result(http::status::partial_content);
    response->set(http::field::content_range,
                  absl::StrCat("bytes ", range.first, "-", range.last, "/", size));
  } else if (kind == RangeKind::kUnsatisfiable) {
    response->result(http::status::range_not_satisfiable);
    response->set(http::field::content_range, absl::StrCat("bytes */", size));
    range.first = end = 0;
  }
  response->content_length(end - range.first);
  if (request.method() == http::verb::head) end = range.first;
  auto header = std::make_shared<http::response_serializer<http::empty_body>>(*response);
  Expire();
  http::async_write_header(stream_, *header,
                           [this, self = shared_from_this(), response, header, file, range, end](
                               beast::error_code error, std::size_t) {
                             if (error) return Abort();
                             SendFile(file, range.first, end);
                           });
}

// Piece by piece, as the client takes them. Read on this thread: a piece of a file that was written
// lately comes from memory in some 20 us.
void HttpConnection::SendFile(std::shared_ptr<int> file, std::uint64_t from, std::uint64_t to) {
  if (from >= to) return Finish({}, parser_->get().keep_alive());
  piece_.resize(kFilePieceBytes);
  const ssize_t count =
      ::pread(*file, piece_.data(), std::min<std::uint64_t>(piece_.size(), to - from),
              static_cast<off_t>(from));
  if (count <= 0) return Abort();  // it has become shorter: less than was promised
  Expire();
  asio::async_write(stream_, asio::buffer(piece_.data(), count),
                    [this, self = shared_from_this(), file, from, to, count](
                        beast::error_code error, std::size_t) {
                      if (error) return Abort();
                      SendFile(file, from + count, to);
                    });
}

}  // namespace adhesim
