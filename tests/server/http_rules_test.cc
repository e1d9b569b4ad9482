#include "server/web/http_rules.h"

#include <gtest/gtest.h>

#include "server/errors.h"

namespace adhesim {
namespace {

std::string Judge(const std::string& host, const std::string& origin,
                  const std::string& listen = "127.0.0.1:8080", bool any_host = false) {
  const absl::Status status = CheckHostAndOrigin(host, origin, listen, any_host);
  return status.ok() ? "" : ReasonOf(status);
}

TEST(HttpRules, TakeRequestsForThisMachineOnly) {
  for (const char* host :
       {"127.0.0.1:8080", "127.1.2.3", "localhost", "LOCALHOST:1", "[::1]:8080", "[::1]"}) {
    EXPECT_EQ(Judge(host, ""), "") << host;
  }
  for (const char* host :
       {"", "example.org", "example.org:8080", "127.0.0.1.example.org", "localhost.example.org",
        "10.0.0.1:8080", "[::2]:8080", "a b", "localhost;x", "localhost:8080, example.org"}) {
    EXPECT_EQ(Judge(host, ""), "HOST_REFUSED") << host;
  }
  // Where it was told to listen, it may be asked for.
  EXPECT_EQ(Judge("sim.lan:8080", "", "sim.lan:8080"), "");
  EXPECT_EQ(Judge("other.lan:8080", "", "sim.lan:8080"), "HOST_REFUSED");
  EXPECT_EQ(Judge("other.lan:8080", "", "0.0.0.0:8080", true), "");
}

TEST(HttpRules, TakeRequestsOfTheirOwnPageOnly) {
  EXPECT_EQ(Judge("localhost:8080", "http://localhost:8080"), "");
  EXPECT_EQ(Judge("localhost:8080", "https://LOCALHOST:8080"), "");
  for (const char* origin : {"http://localhost:8081", "http://localhost", "http://example.org",
                             "null", "http://localhost:8080.example.org", "file://"}) {
    EXPECT_EQ(Judge("localhost:8080", origin), "ORIGIN_REFUSED") << origin;
    EXPECT_EQ(Judge("localhost:8080", origin, "0.0.0.0:8080", true), "ORIGIN_REFUSED") << origin;
  }
}

TEST(HttpRules, KnowTheNamesOfRecordings) {
  EXPECT_EQ(RecordingName("/v1/recordings/s1-ab_2.mcap"), "s1-ab_2.mcap");
  for (const char* path :
       {"/v1/recordings/", "/v1/recordings/.mcap", "/v1/recordings/.hidden.mcap",
        "/v1/recordings/../x.mcap", "/v1/recordings/a/b.mcap", "/v1/recordings/a%2fb.mcap",
        "/v1/recordings/x.txt", "/v1/recordings/x.mcap ", "/v1/recording/x.mcap", ""}) {
    EXPECT_FALSE(RecordingName(path).has_value()) << path;
  }
  EXPECT_FALSE(RecordingName("/v1/recordings/" + std::string(300, 'x') + ".mcap").has_value());
}

TEST(HttpRules, ReadSingleRanges) {
  ByteRange range;
  const auto part = [&range](const char* header, std::uint64_t size) {
    const RangeKind kind = ParseRange(header, size, &range);
    return kind == RangeKind::kPart;
  };
  EXPECT_TRUE(part("bytes=2-5", 10));
  EXPECT_EQ(range.first, 2u);
  EXPECT_EQ(range.last, 5u);
  EXPECT_TRUE(part("bytes=4-", 10));
  EXPECT_EQ(range.last, 9u);
  EXPECT_TRUE(part("bytes=-3", 10));
  EXPECT_EQ(range.first, 7u);
  EXPECT_TRUE(part("bytes=-30", 10));
  EXPECT_EQ(range.first, 0u);
  EXPECT_TRUE(part("bytes=9-18446744073709551615", 10));
  EXPECT_EQ(range.last, 9u);
  for (const char* whole :
       {"", "bytes=", "bytes=-", "bytes=5-2", "bytes=0-1,3-4", "lines=1-2", "bytes=a-b",
        "bytes=99999999999999999999-", "bytes=0x1-2", "bytes=+1-2"}) {
    EXPECT_EQ(ParseRange(whole, 10, &range), RangeKind::kWhole) << whole;
    EXPECT_EQ(range.last - range.first, 9u);
  }
  for (const char* beyond : {"bytes=10-", "bytes=10-20", "bytes=-0"}) {
    EXPECT_EQ(ParseRange(beyond, 10, &range), RangeKind::kUnsatisfiable) << beyond;
  }
  EXPECT_EQ(ParseRange("bytes=0-", 0, &range), RangeKind::kUnsatisfiable);
  EXPECT_EQ(ParseRange("bytes=-5", 0, &range), RangeKind::kUnsatisfiable);
}

TEST(HttpRules, CompareTags) {
  EXPECT_TRUE(MatchesEtag("\"a\"", "\"a\""));
  EXPECT_TRUE(MatchesEtag("\"b\", W/\"a\"", "\"a\""));
  EXPECT_TRUE(MatchesEtag("*", "\"a\""));
  EXPECT_FALSE(MatchesEtag("\"b\"", "\"a\""));
  EXPECT_FALSE(MatchesEtag("", "\"a\""));
}

TEST(HttpRules, LetThePageReachItsOwnServerOnly) {
  const std::string policy = ContentSecurityPolicy("localhost:8080");
  EXPECT_NE(policy.find("connect-src 'self' ws://localhost:8080 wss://localhost:8080;"),
            std::string::npos);
  // A host that could end the directive is left out.
  EXPECT_EQ(ContentSecurityPolicy("x; script-src *").find("x;"), std::string::npos);
}

}  // namespace
}  // namespace adhesim
