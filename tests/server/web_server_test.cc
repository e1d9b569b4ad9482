#include "server/web/web_server.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/web/page_files.h"
#include "tests/support/web_client.h"
#include "web_fixture.h"

namespace adhesim {
namespace {

using test::Get;
using test::HttpReply;
using test::RawConnection;
using test::ReadReply;
using WebServerTest = WebTest;

TEST_F(WebServerTest, ServesThePageWithWhatKeepsItToItself) {
  Serve();
  const HttpReply page = Get(address_, "/?session=s1");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.fields.at("Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.fields.at("X-Content-Type-Options"), "nosniff");
  EXPECT_EQ(page.fields.at("Cache-Control"), "no-cache");
  EXPECT_NE(page.fields.at("Content-Security-Policy").find("ws://" + address_), std::string::npos);
  EXPECT_NE(page.body.find("<html"), std::string::npos);
  const std::string etag = page.fields.at("ETag");
  const HttpReply again = Get(address_, "/index.html", "If-None-Match: " + etag + "\r\n");
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
  const HttpReply head = Get(address_, "/", "", "HEAD");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.fields.at("Content-Length"), page.fields.at("Content-Length"));
}

TEST_F(WebServerTest, ServesOneRequestAfterTheOtherOnAConnection) {
  Serve();
  RawConnection connection(address_);
  const std::string request = "GET /healthz HTTP/1.1\r\nHost: " + address_ + "\r\n\r\n";
  connection.Send(request + request);  // the second before the first is answered
  EXPECT_EQ(ReadReply(&connection).body, "ok");
  EXPECT_EQ(ReadReply(&connection).body, "ok");
  connection.Send("GET /healthz HTTP/1.1\r\nConnection: close\r\nHost: " + address_ + "\r\n\r\n");
  EXPECT_EQ(ReadReply(&connection).body, "ok");
  EXPECT_EQ(connection.ReadAll(), "");
}

TEST_F(WebServerTest, SaysWhenItIsGoingAway) {
  Serve();
  EXPECT_EQ(Get(address_, "/healthz").status, 200);
  sessions_.Drain();
  const HttpReply reply = Get(address_, "/healthz");
  EXPECT_EQ(reply.status, 503);
  EXPECT_EQ(reply.body, "draining");
}

TEST_F(WebServerTest, RefusesWithACodeAndASentence) {
  Serve();
  EXPECT_EQ(Get(address_, "/nowhere").status, 404);
  EXPECT_EQ(Get(address_, "/v1/recordings/x.mcap").status, 404);
  EXPECT_EQ(Get(address_, "/../etc/passwd").status, 404);
  EXPECT_EQ(Get(address_, "/v1/ws").status, 426);
  EXPECT_EQ(Get(address_, "/", "", "DELETE").status, 405);
  EXPECT_EQ(Get(address_, "/", "Content-Length: 3\r\n", "POST").status, 400);
  EXPECT_EQ(Get(address_, "/", "X: " + std::string(10'000, 'x') + "\r\n").status, 431);
  const HttpReply host = Get(address_, "/", "Host: example.org\r\n");
  EXPECT_EQ(host.status, 403);
  EXPECT_EQ(host.body.find("HOST_REFUSED: "), 0u);
  const HttpReply origin = Get(address_, "/", "Origin: http://example.org\r\n");
  EXPECT_EQ(origin.status, 403);
  EXPECT_EQ(origin.body.find("ORIGIN_REFUSED: "), 0u);
  RawConnection garbage(address_);
  garbage.Send("\x16\x03\x01\x02 this is not HTTP\r\n\r\n");
  EXPECT_EQ(ReadReply(&garbage).status, 400);
}

TEST_F(WebServerTest, KeepsItsPortToItself) {
  Serve();
  WebServer::Options same;
  same.listen = address_;
  EXPECT_TRUE(absl::IsUnavailable(WebServer::Start(same, &context_, &calls_).status()));
}

TEST_F(WebServerTest, ListensOnLoopbackOnlyUnlessTold) {
  WebServer::Options open;
  open.listen = "0.0.0.0:0";
  const absl::Status status = WebServer::Start(open, &context_, &calls_).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  open.insecure_listen = true;
  EXPECT_TRUE(WebServer::Start(open, &context_, &calls_).ok());
  for (const char* wrong : {"127.0.0.1", "127.0.0.1:99999", ":80", "unix:/x", ""}) {
    open.listen = wrong;
    EXPECT_TRUE(absl::IsInvalidArgument(WebServer::Start(open, &context_, &calls_).status()))
        << wrong;
  }
}

class RecordingsTest : public WebTest {
 protected:
  // Each test in a directory of its own: ctest runs several at a time.
  static std::string Directory() {
    return testing::TempDir() + "/adhesim_" +
           testing::UnitTest::GetInstance()->current_test_info()->name();
  }
  static RecordingSource Files() {
    RecordingSource source;
    source.find = [directory = Directory()](const std::string& name) {
      return absl::StatusOr<std::string>(directory + "/" + name);
    };
    return source;
  }
  RecordingsTest() : WebTest({}, FakeScenes(), Files()), directory_(Directory()) {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_ + "/folder.mcap");
    for (int i = 0; i < 300'000; ++i) bytes_ += static_cast<char>(i * 7 + i / 256);
    std::ofstream(directory_ + "/a.mcap", std::ios::binary) << bytes_;
    std::ofstream(directory_ + "/empty.mcap");
    std::ofstream(directory_ + "/secret.txt") << "secret";
    std::filesystem::create_symlink("secret.txt", directory_ + "/link.mcap");
    Serve();
  }
  ~RecordingsTest() override { std::filesystem::remove_all(directory_); }

  const std::string directory_;
  std::string bytes_;
};

TEST_F(RecordingsTest, AreServedWhole) {
  const HttpReply whole = Get(address_, "/v1/recordings/a.mcap");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.fields.at("Accept-Ranges"), "bytes");
  EXPECT_TRUE(whole.body == bytes_);
  const HttpReply empty = Get(address_, "/v1/recordings/empty.mcap");
  EXPECT_EQ(empty.status, 200);
  EXPECT_EQ(empty.fields.at("Content-Length"), "0");
  const HttpReply head = Get(address_, "/v1/recordings/a.mcap", "", "HEAD");
  EXPECT_EQ(head.fields.at("Content-Length"), "300000");
}

TEST_F(RecordingsTest, AreServedInRanges) {
  const auto range = [this](const std::string& wanted) {
    return Get(address_, "/v1/recordings/a.mcap", "Range: " + wanted + "\r\n");
  };
  const HttpReply middle = range("bytes=70000-199999");
  EXPECT_EQ(middle.status, 206);
  EXPECT_EQ(middle.fields.at("Content-Range"), "bytes 70000-199999/300000");
  EXPECT_TRUE(middle.body == bytes_.substr(70'000, 130'000));
  EXPECT_TRUE(range("bytes=-10").body == bytes_.substr(299'990));
  const HttpReply beyond = range("bytes=300000-");
  EXPECT_EQ(beyond.status, 416);
  EXPECT_EQ(beyond.fields.at("Content-Range"), "bytes */300000");
  EXPECT_EQ(range("bytes=0-1,5-6").status, 200);
}

TEST_F(RecordingsTest, AreAllThatIsServed) {
  for (const char* name : {"secret.txt", "link.mcap", "folder.mcap", "none.mcap", "../a.mcap",
                           "%2e%2e/a.mcap", "folder.mcap/x.mcap", ".mcap", ""}) {
    EXPECT_EQ(Get(address_, std::string("/v1/recordings/") + name).status, 404) << name;
  }
}

TEST_F(RecordingsTest, ThatAClientDoesNotReadKeepNobodyWaiting) {
  RawConnection lazy(address_);
  lazy.Send("GET /v1/recordings/a.mcap HTTP/1.1\r\nHost: " + address_ + "\r\n\r\n");
  EXPECT_TRUE(Get(address_, "/v1/recordings/a.mcap").body == bytes_);
}

class ImpatientWebTest : public WebTest {
 protected:
  ImpatientWebTest() {
    options_.patience.request_s = 0.2;
    options_.patience.idle_s = 0.2;
    Serve();
  }
};

TEST_F(ImpatientWebTest, EndsConnectionsThatDoNotGetOnWithTheirRequest) {
  RawConnection silent(address_), slow(address_);
  slow.Send("GET / HTTP/1.1\r\nHost: ");
  // Without an end of its own this would take until the client's patience is over, and fail.
  EXPECT_EQ(silent.ReadAll(), "");
  EXPECT_EQ(slow.ReadAll(), "");
}

TEST_F(ImpatientWebTest, EndsWebSocketsThatGiveNoSignOfLife) {
  const std::string id = Create(true);
  test::WebSocketClient client(address_);
  v1::ClientMessage message;
  message.set_stream(1);
  message.mutable_watch()->mutable_start()->set_session(id);
  client.Send(message);
  WaitFor([&] { return Describe(id).viewers() == 1; });
  client.raw.ReadAll();  // answers no ping; returns when the server has given it up
  WaitFor([&] { return Describe(id).viewers() == 0; });
}

}  // namespace
}  // namespace adhesim
