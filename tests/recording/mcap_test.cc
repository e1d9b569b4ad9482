#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "server/recording/mcap_reader.h"
#include "server/recording/mcap_writer.h"
#include "tests/recording/recording_files.h"

namespace adhesim {
namespace {

using test::SinkInto;
using test::TempPath;
using ::testing::HasSubstr;

// Everything that a file says.
struct Content {
  absl::Status error;
  std::vector<std::string> messages;  // "channel time data"
  std::size_t schemas = 0, channels = 0, metadata = 0, attachments = 0;
  std::optional<std::uint64_t> truncated_at;
  std::vector<McapDamage> damage;
};

Content ReadPath(const std::string& path) {
  Content content;
  absl::StatusOr<std::unique_ptr<McapReader>> reader = McapReader::Open(path);
  content.error = reader.status();
  if (!reader.ok()) return content;
  McapMessage message;
  while (true) {
    const absl::StatusOr<bool> more = (*reader)->Next(&message);
    content.error = more.status();
    if (!more.ok() || !*more) break;
    content.messages.push_back(std::to_string(message.channel) + " " +
                               std::to_string(message.log_time) + " " + std::string(message.data));
  }
  content.schemas = (*reader)->schemas().size();
  content.channels = (*reader)->channels().size();
  content.metadata = (*reader)->metadata().size();
  content.attachments = (*reader)->attachments().size();
  content.truncated_at = (*reader)->truncated_at();
  content.damage = (*reader)->damage();
  return content;
}

// Through a file in memory: some tests read thousands.
Content ReadBytes(const std::string& bytes) {
  const int file = memfd_create("mcap", MFD_CLOEXEC);
  EXPECT_EQ(write(file, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  const Content content = ReadPath("/proc/self/fd/" + std::to_string(file));
  close(file);
  return content;
}

// A small file with everything in it: two chunks of three messages each.
std::string SmallFile() {
  std::string bytes;
  McapWriter writer(SinkInto(&bytes), "", "test");
  writer.AddMetadata("about", {{"key", "value"}, {"other", ""}});
  writer.AddAttachment("a.txt", "text/plain", "hello");
  const std::uint16_t schema = writer.AddSchema("Thing", "protobuf", "descriptor");
  const std::uint16_t first = writer.AddChannel(schema, "/first", "protobuf");
  const std::uint16_t second = writer.AddChannel(schema, "/second", "protobuf");
  writer.AddMessage(first, 1, "one");
  writer.AddMessage(second, 2, "two");
  writer.AddMessage(first, 2, "three");
  writer.FlushChunk();
  writer.AddMessage(first, 3, "four");
  writer.AddMessage(first, 4, "five");
  writer.AddMessage(second, 5, "");
  writer.Finish();
  EXPECT_TRUE(writer.status().ok());
  EXPECT_EQ(writer.bytes_written(), bytes.size());
  return bytes;
}

const std::vector<std::string> kMessages = {"0 1 one",  "1 2 two",  "0 2 three",
                                            "0 3 four", "0 4 five", "1 5 "};

TEST(Mcap, ReadsBackWhatWasWritten) {
  const Content content = ReadBytes(SmallFile());
  EXPECT_TRUE(content.error.ok());
  EXPECT_EQ(content.messages, kMessages);
  EXPECT_EQ(content.schemas, 1u);
  EXPECT_EQ(content.channels, 2u);
  EXPECT_EQ(content.metadata, 1u);
  EXPECT_EQ(content.attachments, 1u);
  EXPECT_FALSE(content.truncated_at);
  EXPECT_TRUE(content.damage.empty());
}

TEST(Mcap, KeepsNamesValuesAndBytes) {
  test::WriteFile(TempPath("mcap"), SmallFile());
  const auto reader = McapReader::Open(TempPath("mcap"));
  ASSERT_TRUE(reader.ok());
  EXPECT_EQ((*reader)->metadata().at("about").at("key"), "value");
  EXPECT_EQ((*reader)->attachments()[0].name, "a.txt");
  EXPECT_EQ((*reader)->attachments()[0].media_type, "text/plain");
  EXPECT_EQ((*reader)->attachments()[0].data, "hello");
  EXPECT_EQ((*reader)->schemas().at(1).data, "descriptor");
  EXPECT_EQ((*reader)->channels().at(1).topic, "/second");
  EXPECT_EQ((*reader)->channels().at(1).schema, 1);
}

// Whatever the place at which a file ends, what is read is the beginning of what was written.
TEST(Mcap, EveryTruncationReadsUpToTheLastWholeMessage) {
  const std::string whole = SmallFile();
  std::size_t before = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const Content content = ReadBytes(whole.substr(0, length));
    if (length < mcap::kMagic.size()) {
      EXPECT_FALSE(content.error.ok()) << length;
      continue;
    }
    ASSERT_TRUE(content.error.ok()) << length << " " << content.error;
    EXPECT_TRUE(content.damage.empty()) << length;
    ASSERT_TRUE(content.truncated_at) << length;
    EXPECT_LE(*content.truncated_at, length);
    ASSERT_LE(content.messages.size(), kMessages.size());
    // Never fewer with more bytes: also messages of a chunk that is not whole count.
    EXPECT_GE(content.messages.size(), before) << length;
    EXPECT_TRUE(std::equal(content.messages.begin(), content.messages.end(), kMessages.begin()));
    before = content.messages.size();
  }
  EXPECT_EQ(before, kMessages.size());
}

// A flipped bit is found by a checksum, or changes nothing that is read.
TEST(Mcap, EveryFlippedBitIsFoundOrHarmless) {
  const std::string whole = SmallFile();
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int bit : {0, 3, 7}) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << bit));
      const Content content = ReadBytes(bytes);
      const bool found = !content.error.ok() || content.truncated_at || !content.damage.empty();
      EXPECT_TRUE(found || content.messages == kMessages) << "byte " << at << " bit " << bit;
    }
  }
}

TEST(Mcap, SaysWhichTimesADamagedChunkHolds) {
  std::string bytes = SmallFile();
  bytes[bytes.find("five")] = 'x';
  const Content content = ReadBytes(bytes);
  ASSERT_EQ(content.damage.size(), 2u);  // the chunk, and the data section as a whole
  EXPECT_EQ(content.damage[0].first_time, 3u);
  EXPECT_EQ(content.damage[0].last_time, 5u);
  EXPECT_EQ(content.messages[4], "0 4 xive");  // read all the same
}

TEST(Mcap, RefusesWhatIsNotMcap) {
  EXPECT_THAT(std::string(ReadBytes("").error.message()), HasSubstr("not an MCAP file"));
  EXPECT_THAT(std::string(ReadBytes("#ROSBAG V2.0\n").error.message()),
              HasSubstr("not an MCAP file"));
  std::string later = SmallFile();
  later[mcap::kVersionAt] = '1';
  EXPECT_THAT(std::string(ReadBytes(later).error.message()), HasSubstr("version \"1"));
  EXPECT_FALSE(ReadPath("no/such/file.mcap").error.ok());
  EXPECT_THAT(std::string(ReadPath("/dev/zero").error.message()), HasSubstr("regular file"));
  EXPECT_THAT(std::string(ReadPath(::testing::TempDir()).error.message()),
              HasSubstr("regular file"));
}

TEST(Mcap, RefusesCompressedChunks) {
  std::string bytes(mcap::kMagic);
  const std::size_t begin = mcap::OpenRecord(mcap::kChunk, &bytes);
  for (int i = 0; i < 3; ++i) mcap::Put(std::uint64_t{0}, &bytes);
  mcap::Put(std::uint32_t{0}, &bytes);
  mcap::PutString("zstd", &bytes);
  mcap::Put(std::uint64_t{0}, &bytes);
  mcap::CloseRecord(begin, &bytes);
  EXPECT_THAT(std::string(ReadBytes(bytes).error.message()), HasSubstr("\"zstd\""));
}

// A length is held against the file before memory is taken: 2^63 bytes would end the program.
// Attachments that are holes of a file cost its writer nothing; they must cost its reader no
// memory.
TEST(Mcap, RefusesMoreAttachmentsThanItKeeps) {
  std::string bytes;
  McapWriter writer(test::SinkInto(&bytes), "", "");
  const std::string path = TempPath("attachments.mcap");
  test::WriteFile(path, bytes);
  constexpr std::uint64_t kEach = std::uint64_t{100} << 20;
  std::string prefix;
  mcap::OpenRecord(mcap::kAttachment, &prefix);
  std::memcpy(prefix.data() + 1, &kEach, sizeof(kEach));
  for (int i = 0; i < 3; ++i) {
    std::ofstream(path, std::ios::binary | std::ios::app) << prefix;
    std::filesystem::resize_file(path, std::filesystem::file_size(path) + kEach);
  }
  const absl::Status status = McapReader::Open(path).status();
  std::filesystem::remove(path);
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(std::string(status.message()), HasSubstr("attachments.mcap"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("268435456 bytes of attachments"));
}

TEST(Mcap, RefusesMoreMetadataThanItKeeps) {
  const std::string path = TempPath("metadata.mcap");
  const std::string half(kMaxDescriptionBytes / 2 - 100, 'x');
  const auto open = [&](int records, bool behind_a_message) {
    std::string bytes;
    McapWriter writer(test::SinkInto(&bytes), "", "");
    const std::uint16_t channel = writer.AddChannel(0, "/a", "");
    writer.AddMessage(channel, 0, "first");
    if (behind_a_message) writer.FlushChunk();
    for (int i = 0; i < records; ++i) writer.AddMetadata("m", {{"key", half}});
    writer.Finish();
    test::WriteFile(path, bytes);
    absl::StatusOr<std::unique_ptr<McapReader>> reader = McapReader::Open(path);
    if (!reader.ok()) return reader.status();
    McapMessage message;
    absl::StatusOr<bool> more = true;
    while (more.ok() && *more) more = (*reader)->Next(&message);
    return more.status();
  };
  for (const bool behind : {false, true}) {
    EXPECT_TRUE(open(2, behind).ok());
    EXPECT_TRUE(absl::IsInvalidArgument(open(3, behind)));
  }
}

TEST(Mcap, SurvivesHugeLengths) {
  const std::string whole = SmallFile();
  for (const test::RecordPlace& record : test::RecordsOf(whole)) {
    for (const std::uint64_t length : {std::uint64_t{1} << 32, std::uint64_t{1} << 63,
                                       ~std::uint64_t{0}, ~std::uint64_t{0} - 8}) {
      std::string bytes = whole;
      std::memcpy(bytes.data() + record.content - sizeof(length), &length, sizeof(length));
      const Content content = ReadBytes(bytes);
      if (record.opcode != mcap::kHeader || !content.damage.empty()) {
        EXPECT_LE(content.messages.size(), kMessages.size());
      }
      // Of the summary nothing is read.
      if (record.content < whole.find("five")) {
        EXPECT_FALSE(content.damage.empty());
      }
    }
  }
  // Inside of a record: strings and maps.
  for (std::size_t at = mcap::kMagic.size(); at + 4 < whole.size(); ++at) {
    std::string bytes = whole;
    std::memset(bytes.data() + at, 0xFF, 4);
    ReadBytes(bytes);
  }
}

TEST(Mcap, StopsWritingAtTheFirstError) {
  int calls = 0;
  McapWriter writer(
      [&calls](std::string_view) {
        return ++calls < 3 ? absl::OkStatus() : absl::DataLossError("disk full");
      },
      "", "test");
  const std::uint16_t channel = writer.AddChannel(0, "/a", "");
  writer.AddMessage(channel, 1, "data");
  writer.FlushChunk();
  for (int i = 0; i < 10; ++i) writer.AddMessage(channel, 1, "data");
  writer.Finish();
  EXPECT_EQ(writer.status().message(), "disk full");
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(writer.chunk_bytes(), 0u);  // nothing piles up
}

}  // namespace
}  // namespace adhesim
