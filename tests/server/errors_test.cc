#include "server/errors.h"

#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace adhesim {
namespace {

google::rpc::Status Decode(const absl::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(ErrorDetails(status)));
  return details;
}

TEST(Errors, CarryExactlyOneErrorInfo) {
  const google::rpc::Status details = Decode(Error(Reason::kToolTaken, "no"));
  EXPECT_EQ(details.code(), static_cast<int>(absl::StatusCode::kAlreadyExists));
  EXPECT_EQ(details.message(), "no");
  ASSERT_EQ(details.details_size(), 1);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(details.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "TOOL_TAKEN");
  EXPECT_EQ(info.domain(), "adhesim");
}

TEST(Errors, ListEveryWrongField) {
  const google::rpc::Status details =
      Decode(Error(Reason::kSceneInvalid, "two", {{"a", "is 1"}, {"b[2].c", "is missing"}}));
  ASSERT_EQ(details.details_size(), 2);
  google::rpc::BadRequest request;
  ASSERT_TRUE(details.details(1).UnpackTo(&request));
  ASSERT_EQ(request.field_violations_size(), 2);
  EXPECT_EQ(request.field_violations(1).field(), "b[2].c");
  EXPECT_EQ(request.field_violations(1).description(), "is missing");
}

TEST(Errors, SayWhenToTryADrainingServerAgain) {
  const google::rpc::Status details = Decode(Error(Reason::kDraining, "going"));
  ASSERT_EQ(details.details_size(), 2);
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(details.details(1).UnpackTo(&retry));
  EXPECT_GT(retry.retry_delay().seconds(), 0);
}

TEST(Errors, OfOtherOriginAreInternal) {
  EXPECT_EQ(ReasonOf(absl::UnknownError("what")), "INTERNAL");
  EXPECT_EQ(ErrorDetails(absl::OkStatus()), "");
}

}  // namespace
}  // namespace adhesim
