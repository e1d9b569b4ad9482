#include <gtest/gtest.h>

#include <filesystem>

#include "adhesim/v1/recording_service.grpc.pb.h"
#include "server/recording/recording_directory.h"
#include "tests/recording/recording_files.h"
#include "tests/server/test_server.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

class RecordingServiceTest : public testing::Test {
 protected:
  RecordingServiceTest() : path_(test::TempPath("served")) { fs::remove_all(path_); }
  ~RecordingServiceTest() override { fs::remove_all(path_); }

  void Start(bool recording) {
    Server::Options options;
    options.listen = "127.0.0.1:0";
    options.realtime = false;
    options.version = "test";
    if (recording) {
      auto directory = RecordingDirectory::Open(path_, {}, "test", "test");
      ASSERT_TRUE(directory.ok());
      options.recordings = SourceOf(*directory);
    }
    auto server = Server::Start(options, FakeScenes());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    sessions_ = v1::SessionService::NewStub(channel_);
    recordings_ = v1::RecordingService::NewStub(channel_);
  }

  static void SetDeadline(grpc::ClientContext* context) {
    context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  }

  v1::ListRecordingsResponse List() {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ListRecordingsResponse response;
    const grpc::Status status = recordings_->ListRecordings(&context, {}, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }

  grpc::Status Read(const std::string& name, std::string* bytes) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ReadRecordingRequest request;
    request.set_name(name);
    const auto reader = recordings_->ReadRecording(&context, request);
    v1::ReadRecordingResponse response;
    while (reader->Read(&response)) {
      EXPECT_LE(response.data().size(), std::size_t{256} << 10);
      bytes->append(response.data());
    }
    return reader->Finish();
  }

  const std::string path_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
  std::unique_ptr<v1::RecordingService::Stub> recordings_;
};

TEST_F(RecordingServiceTest, RecordsEverySessionAndHandsItOut) {
  Start(true);
  v1::CreateSessionRequest create;
  create.set_scene_name("fake");
  v1::CreateSessionResponse created;
  grpc::ClientContext create_context;
  SetDeadline(&create_context);
  ASSERT_TRUE(sessions_->CreateSession(&create_context, create, &created).ok());
  EXPECT_TRUE(created.warnings().empty());
  const std::string session = created.session().session();

  const v1::ListRecordingsResponse during = List();
  ASSERT_EQ(during.recordings_size(), 1);
  EXPECT_EQ(during.recordings(0).name(), "fake-" + session + ".mcap");
  EXPECT_EQ(during.recordings(0).session(), session);
  EXPECT_TRUE(during.recordings(0).open());

  v1::DeleteSessionRequest remove;
  remove.set_session(session);
  v1::DeleteSessionResponse removed;
  grpc::ClientContext delete_context;
  SetDeadline(&delete_context);
  ASSERT_TRUE(sessions_->DeleteSession(&delete_context, remove, &removed).ok());
  const v1::ListRecordingsResponse after = List();
  ASSERT_EQ(after.recordings_size(), 1);
  EXPECT_FALSE(after.recordings(0).open());

  std::string bytes;
  EXPECT_TRUE(Read(after.recordings(0).name(), &bytes).ok());
  EXPECT_EQ(bytes.size(), after.recordings(0).bytes());
  EXPECT_EQ(bytes, test::ReadWholeFile(path_ + "/" + after.recordings(0).name()));
  const auto reader = McapReader::Open(path_ + "/" + after.recordings(0).name());
  ASSERT_TRUE(reader.ok());
  EXPECT_FALSE((*reader)->truncated_at());
}

TEST_F(RecordingServiceTest, ReadsLargeFilesInPieces) {
  Start(true);
  const std::string bytes(700'000, 'x');
  test::WriteFile(path_ + "/large.mcap", bytes);
  std::string read;
  EXPECT_TRUE(Read("large.mcap", &read).ok());
  EXPECT_EQ(read, bytes);
}

TEST_F(RecordingServiceTest, RefusesOtherNames) {
  Start(true);
  std::string bytes;
  EXPECT_EQ(ReasonIn(Read("../secret.mcap", &bytes)), "ARGUMENT_INVALID");
  EXPECT_EQ(ReasonIn(Read("none.mcap", &bytes)), "RECORDING_NOT_FOUND");
  EXPECT_EQ(bytes, "");
}

TEST_F(RecordingServiceTest, HasNoneWithoutADirectory) {
  Start(false);
  EXPECT_EQ(List().recordings_size(), 0);
  std::string bytes;
  EXPECT_EQ(ReasonIn(Read("a.mcap", &bytes)), "RECORDING_NOT_FOUND");
}

}  // namespace
}  // namespace adhesim
