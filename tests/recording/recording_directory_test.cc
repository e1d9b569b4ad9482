#include "server/recording/recording_directory.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "server/errors.h"
#include "tests/recording/recording_files.h"
#include "tests/server/fake_engine.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

class RecordingDirectoryTest : public testing::Test {
 protected:
  RecordingDirectoryTest() : path_(test::TempPath("directory")) {
    fs::remove_all(path_);
    auto opened = RecordingDirectory::Open(path_, {}, "1", "test");
    EXPECT_TRUE(opened.ok()) << opened.status();
    directory_ = *opened;
  }
  ~RecordingDirectoryTest() override { fs::remove_all(path_); }

  const std::string path_;
  std::shared_ptr<RecordingDirectory> directory_;
};

TEST_F(RecordingDirectoryTest, ListsWhatGrowsAndWhatIsFinished) {
  FakeEngine engine(FakeModel("fake"));
  auto recorder = directory_->Record("s1-abc", {}, engine);
  ASSERT_TRUE(recorder.ok()) << recorder.status();
  v1::ListRecordingsResponse list = directory_->List();
  ASSERT_EQ(list.recordings_size(), 1);
  EXPECT_EQ(list.recordings(0).name(), "fake-s1-abc.mcap");
  EXPECT_EQ(list.recordings(0).session(), "s1-abc");
  EXPECT_TRUE(list.recordings(0).open());
  (*recorder)->OnEnd();
  test::WriteFile(path_ + "/another.mcap", "12345");
  test::WriteFile(path_ + "/notes.txt", "not a recording");
  list = directory_->List();
  ASSERT_EQ(list.recordings_size(), 2);
  EXPECT_EQ(list.recordings(0).name(), "another.mcap");
  EXPECT_EQ(list.recordings(0).bytes(), 5u);
  EXPECT_FALSE(list.recordings(1).open());
  EXPECT_EQ(list.recordings(1).session(), "");
  EXPECT_EQ(list.recordings(1).bytes(), fs::file_size(path_ + "/fake-s1-abc.mcap"));
}

TEST_F(RecordingDirectoryTest, NeverOverwritesARecording) {
  FakeEngine engine(FakeModel("fake"));
  ASSERT_TRUE(directory_->Record("s1", {}, engine).ok());
  EXPECT_FALSE(directory_->Record("s1", {}, engine).ok());
}

TEST_F(RecordingDirectoryTest, FindsOnlyPlainNamesOfItsOwnFiles) {
  test::WriteFile(path_ + "/a-1_b.mcap", "x");
  test::WriteFile(path_ + ".mcap", "outside");
  fs::create_directory(path_ + "/folder.mcap");
  fs::create_symlink(path_ + ".mcap", path_ + "/link.mcap");
  EXPECT_EQ(*directory_->Find("a-1_b.mcap"), path_ + "/a-1_b.mcap");
  for (const std::string& name :
       {std::string("../") + fs::path(path_).filename().string() + ".mcap",
        std::string("/etc/passwd"), std::string("..mcap"), std::string(".mcap"), std::string(),
        std::string("a\0.mcap", 7), std::string("a/b.mcap"), std::string("notes.txt"),
        std::string(1000, 'a') + ".mcap"}) {
    EXPECT_EQ(ReasonOf(directory_->Find(name).status()), "ARGUMENT_INVALID") << name;
  }
  for (const char* name : {"none.mcap", "folder.mcap", "link.mcap"}) {
    EXPECT_EQ(ReasonOf(directory_->Find(name).status()), "RECORDING_NOT_FOUND") << name;
  }
  fs::remove(path_ + ".mcap");
}

TEST(FileNamePart, IsAlwaysOnePlainName) {
  EXPECT_EQ(FileNamePart("liver_press"), "liver_press");
  EXPECT_EQ(FileNamePart("../../etc/passwd"), "_.._.._etc_passwd");
  EXPECT_EQ(FileNamePart(""), "_");
  EXPECT_EQ(FileNamePart("a b/c\n"), "a_b_c_");
  EXPECT_EQ(FileNamePart(std::string(1000, 'x')).size(), 64u);
}

TEST(RecordingDirectory, RefusesAPlaceThatCannotBe) {
  const std::string file = test::TempPath("file");
  test::WriteFile(file, "x");
  EXPECT_FALSE(RecordingDirectory::Open(file, {}, "1", "test").ok());
  EXPECT_FALSE(RecordingDirectory::Open(file + "/below", {}, "1", "test").ok());
}

}  // namespace
}  // namespace adhesim
