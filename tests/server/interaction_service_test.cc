#include <gtest/gtest.h>

#include <limits>

#include "test_server.h"

namespace adhesim {
namespace {

using InteractionServiceTest = ServerTest;

bool IsRefusal(const v1::InteractResponse& response) { return response.has_pose_refused(); }

TEST_F(InteractionServiceTest, AnswersAPoseWithTheForceOfTheStepThatUsedIt) {
  const std::string id = Create(false);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  ASSERT_TRUE(client.Send(41, 1e-5));
  const v1::InteractResponse response = client.ReadUntil([](const v1::InteractResponse& r) {
    return r.has_feedback() && r.feedback().sequence() == 41;
  });
  EXPECT_EQ(response.session(), id);
  EXPECT_GT(response.step(), 0u);
  EXPECT_GT(response.time_s(), 0);
  const v1::ToolFeedback& feedback = response.feedback();
  EXPECT_EQ(feedback.client_time_ns(), 1041);
  EXPECT_EQ(feedback.tool().pose().x_m(), 1e-5);
  EXPECT_EQ(feedback.tool().tissue().fz_n(), 1);
  EXPECT_EQ(feedback.tool().colliding_particles(), 3u);
  EXPECT_LE(feedback.server_received_ns(), feedback.server_sent_ns());
  client.stream->WritesDone();
  EXPECT_TRUE(client.Finish().ok());
}

TEST_F(InteractionServiceTest, RefusesBadPosesOneByOneAndKeepsTheTarget) {
  const std::string id = Create(false);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  client.Send(1, 2e-5);
  client.ReadUntil([](const v1::InteractResponse& r) {
    return r.has_feedback() && r.feedback().sequence() == 1;
  });
  const auto refusal = [&client](std::uint64_t sequence, double x_m, double qw) {
    client.Send(sequence, x_m, qw);
    const v1::InteractResponse response = client.ReadUntil(IsRefusal);
    EXPECT_EQ(response.pose_refused().sequence(), sequence);
    EXPECT_EQ(response.pose_refused().poses_refused(), sequence - 1);
    return response.pose_refused().reason();
  };
  EXPECT_EQ(refusal(2, std::numeric_limits<double>::quiet_NaN(), 1), "POSE_NOT_FINITE");
  EXPECT_EQ(refusal(3, std::numeric_limits<double>::infinity(), 1), "POSE_NOT_FINITE");
  EXPECT_EQ(refusal(4, 0, 0.5), "POSE_NOT_A_ROTATION");
  EXPECT_EQ(refusal(5, 2000, 1), "POSE_OUT_OF_RANGE");
  v1::InteractRequest empty;
  empty.mutable_pose()->set_sequence(6);
  client.stream->Write(empty);
  EXPECT_EQ(client.ReadUntil(IsRefusal).pose_refused().reason(), "POSE_MISSING");
  const v1::InteractResponse after = client.ReadUntil([](const v1::InteractResponse& r) {
    return r.has_feedback() && r.feedback().poses_refused() == 5;
  });
  EXPECT_EQ(after.feedback().sequence(), 1u);
  EXPECT_EQ(after.feedback().tool().target().x_m(), 2e-5);
  // A good one is used again.
  client.Send(7, 3e-5);
  client.ReadUntil([](const v1::InteractResponse& r) {
    return r.has_feedback() && r.feedback().sequence() == 7;
  });
}

TEST_F(InteractionServiceTest, PassesAJumpOnAndReportsItOnce) {
  const std::string id = Create(true);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  client.Send(1, 0.5);
  // The pose has arrived when a step says so.
  const auto used = [](const v1::InteractResponse& r) {
    return r.has_feedback() && r.feedback().sequence() == 1;
  };
  v1::InteractResponse response;
  for (int i = 0; i < 1000 && !used(response); ++i) {
    ASSERT_TRUE(Step(id, 1).ok());
    response = client.ReadUntil([](const v1::InteractResponse& r) { return r.has_feedback(); });
  }
  EXPECT_TRUE(used(response));
  const std::uint64_t step = Get(id).step() + 5;
  ASSERT_TRUE(Step(id, 5).ok());
  response = client.ReadUntil(
      [step](const v1::InteractResponse& r) { return r.has_feedback() && r.step() == step; });
  EXPECT_EQ(response.feedback().tool().target_jumps(), 1u);
  EXPECT_FALSE(response.feedback().tool().target_jumped());
  EXPECT_EQ(response.feedback().tool().target().x_m(), 0.5);
}

TEST_F(InteractionServiceTest, KnowsNoOtherSessionsAndTools) {
  const std::string id = Create(true);
  OperatorClient nowhere(interaction_.get());
  EXPECT_FALSE(nowhere.Take("s9-none", "needle"));
  grpc::Status status = nowhere.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ReasonIn(status), "SESSION_NOT_FOUND");
  OperatorClient nothing(interaction_.get());
  EXPECT_FALSE(nothing.Take(id, "spoon"));
  status = nothing.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ReasonIn(status), "TOOL_NOT_FOUND");
}

TEST_F(InteractionServiceTest, RefusesASecondOperatorOfATool) {
  const std::string id = Create(true);
  OperatorClient first(interaction_.get()), second(interaction_.get()), other(interaction_.get());
  ASSERT_TRUE(first.Take(id, "needle"));
  EXPECT_FALSE(second.Take(id, "needle"));
  const grpc::Status status = second.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(ReasonIn(status), "TOOL_TAKEN");
  EXPECT_TRUE(other.Take(id, "lancet"));
  EXPECT_EQ(Get(id).operated_tools_size(), 2);
  // The first goes, and the tool is free.
  first.stream->WritesDone();
  EXPECT_TRUE(first.Finish().ok());
  OperatorClient third(interaction_.get());
  EXPECT_TRUE(third.Take(id, "needle"));
}

TEST_F(InteractionServiceTest, EndsAStreamThatBreaksItsProtocol) {
  const std::string id = Create(true);
  OperatorClient hasty(interaction_.get());
  hasty.Send(1, 0);
  EXPECT_EQ(ReasonIn(hasty.Finish()), "STREAM_NOT_STARTED");
  OperatorClient twice(interaction_.get());
  ASSERT_TRUE(twice.Take(id, "needle"));
  twice.Take(id, "lancet");
  EXPECT_EQ(ReasonIn(twice.Finish()), "STREAM_STARTED_TWICE");
  WaitFor(id, [](const v1::Session& now) { return now.operated_tools_size() == 0; });
}

TEST_F(InteractionServiceTest, RefusesAnOversizedMessage) {
  const std::string id = Create(true);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  v1::InteractRequest request;
  request.mutable_take_control()->set_tool(std::string(70'000, 'x'));
  client.stream->Write(request);
  const grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(status), "MESSAGE_TOO_LARGE");
}

TEST_F(InteractionServiceTest, HoldsThenRetractsTheToolOfAClientThatIsGone) {
  const std::string id = Create(true);
  const std::string other = Create(false);
  {
    OperatorClient client(interaction_.get());
    ASSERT_TRUE(client.Take(id, "needle"));
    client.Send(1, 1e-5);
    v1::InteractResponse response;
    while (response.feedback().sequence() != 1) {
      ASSERT_TRUE(Step(id, 1).ok());
      response = client.ReadUntil([](const v1::InteractResponse& r) { return r.has_feedback(); });
    }
    client.context.TryCancel();
    EXPECT_EQ(client.stream->Finish().error_code(), grpc::StatusCode::CANCELLED);
  }
  WaitFor(id, [](const v1::Session& now) { return now.operated_tools_size() == 0; });
  const std::uint64_t others_step = Get(other).step();

  // A viewer sees it: lost within 250 steps, retracted within 2500, by count.
  ViewerClient viewer(view_.get());
  ASSERT_TRUE(viewer.Start(id));
  viewer.ReadFrame();
  const auto needle_at = [&](std::uint64_t step) {
    viewer.Acknowledge();
    while (true) {
      const v1::WatchResponse response = viewer.ReadFrame();
      viewer.Acknowledge();
      if (response.step() >= step || response.step() == 0) return response.frame().tools(0);
    }
  };
  std::uint64_t step = Get(id).step();
  ASSERT_TRUE(Step(id, 300).ok());
  v1::ToolState needle = needle_at(step + 300);
  EXPECT_TRUE(needle.operator_lost());
  EXPECT_FALSE(needle.retracted());
  EXPECT_EQ(needle.tissue().fz_n(), 1);
  EXPECT_EQ(needle.target().x_m(), 1e-5);  // it holds
  step = Get(id).step();
  ASSERT_TRUE(Step(id, 2300).ok());
  needle = needle_at(step + 2300);
  EXPECT_TRUE(needle.operator_lost());
  EXPECT_TRUE(needle.retracted());
  EXPECT_EQ(needle.colliding_particles(), 0u);

  // The other session did not notice.
  WaitFor(other, [&](const v1::Session& now) { return now.step() > others_step + 100; });

  // A new operator has the tool back.
  OperatorClient again(interaction_.get());
  ASSERT_TRUE(again.Take(id, "needle"));
  again.Send(1, 2e-5);
  v1::InteractResponse response;
  while (response.feedback().sequence() != 1) {
    ASSERT_TRUE(Step(id, 1).ok());
    response = again.ReadUntil([](const v1::InteractResponse& r) { return r.has_feedback(); });
  }
  EXPECT_FALSE(response.feedback().tool().operator_lost());
  EXPECT_FALSE(response.feedback().tool().retracted());
}

TEST_F(InteractionServiceTest, EndsWhenItsSessionFreezesOrIsDeleted) {
  const std::string freezing = Create(true, "freezes");
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(freezing, "needle"));
  ASSERT_TRUE(Step(freezing, 10).ok());
  grpc::Status status = client.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(ReasonIn(status), "SESSION_FROZEN");

  const std::string deleted = Create(true);
  OperatorClient other(interaction_.get());
  ASSERT_TRUE(other.Take(deleted, "needle"));
  v1::DeleteSessionRequest request;
  request.set_session(deleted);
  v1::DeleteSessionResponse response;
  ASSERT_TRUE(Call(&v1::SessionService::Stub::DeleteSession, request, &response).ok());
  EXPECT_EQ(ReasonIn(other.Finish()), "SESSION_DELETED");
}

TEST_F(InteractionServiceTest, SendsHeartbeatsWhilePaused) {
  const std::string id = Create(true);
  OperatorClient client(interaction_.get());
  ASSERT_TRUE(client.Take(id, "needle"));
  for (int i = 0; i < 2; ++i) {
    const v1::InteractResponse response =
        client.ReadUntil([](const v1::InteractResponse& r) { return r.has_heartbeat(); });
    EXPECT_EQ(response.session(), id);
    EXPECT_EQ(response.heartbeat().state(), v1::SESSION_STATE_PAUSED);
    EXPECT_GT(response.heartbeat().server_time_ns(), 0);
  }
}

class FewStreamsTest : public ServerTest {
 protected:
  static Limits Few() {
    Limits limits;
    limits.streams_per_peer = 2;
    return limits;
  }
  FewStreamsTest() : ServerTest(Few()) {}
};

TEST_F(FewStreamsTest, LimitsTheStreamsOfAPeer) {
  const std::string id = Create(true);
  OperatorClient first(interaction_.get());
  ASSERT_TRUE(first.Take(id, "needle"));
  ViewerClient second(view_.get());
  ASSERT_TRUE(second.Start(id));
  second.ReadFrame();
  OperatorClient third(interaction_.get());
  EXPECT_FALSE(third.Take(id, "lancet"));
  grpc::Status status = third.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(status), "TOO_MANY_STREAMS");
  ViewerClient fourth(view_.get());
  EXPECT_EQ(ReasonIn(fourth.Finish()), "TOO_MANY_STREAMS");
}

}  // namespace
}  // namespace adhesim
