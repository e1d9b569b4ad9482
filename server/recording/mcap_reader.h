#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace adhesim {

// What stands beside the messages is kept in memory whole: so much of it at most. What a scene
// names is far smaller.
inline constexpr std::uint64_t kMaxAttachmentBytes = std::uint64_t{256} << 20;
inline constexpr std::uint64_t kMaxDescriptionBytes = std::uint64_t{16} << 20;

struct McapSchema {
  std::string name, encoding, data;
};

struct McapChannel {
  std::uint16_t schema = 0;
  std::string topic, message_encoding;
};

struct McapAttachment {
  std::string name, media_type, data;
};

struct McapMessage {
  std::uint16_t channel = 0;
  std::uint64_t log_time = 0;  // ns
  std::string_view data;       // good until the next Next()
  std::uint64_t offset = 0;    // of its record in the file
};

// Something in the file is not what was written.
struct McapDamage {
  std::uint64_t offset = 0;  // of the record, bytes
  std::string what;
  // Times of the messages of a damaged chunk, ns.
  std::optional<std::uint64_t> first_time, last_time;
};

// Reads an MCAP file front to back, trusting nothing in it: every length is held against the file's
// size and a limit before memory is taken.
//
// A file that ends early is read up to its last whole record, whole messages of the last chunk
// included. Attachments, and schemas, channels and metadata, have a limit for all of them together;
// a file that has more is refused. A chunk whose checksum is wrong is read all the same (and said
// to be damaged), so that the reader of a recording can find what differs. Compressed chunks are
// refused.
class McapReader {
 public:
  // No record may be larger.
  static constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{1} << 30;

  // Opens the file and reads what stands before its first message. Errors: NotFound,
  // InvalidArgument (not MCAP, another version, more than is kept).
  static absl::StatusOr<std::unique_ptr<McapReader>> Open(const std::string& path);
  ~McapReader();

  // The next message in the file's order; false at the end. Errors: InvalidArgument (a compressed
  // chunk, more than is kept).
  absl::StatusOr<bool> Next(McapMessage* message);

  // What was met so far.
  const std::map<std::uint16_t, McapSchema>& schemas() const { return schemas_; }
  const std::map<std::uint16_t, McapChannel>& channels() const { return channels_; }
  const std::map<std::string, std::map<std::string, std::string>>& metadata() const {
    return metadata_;
  }
  const std::vector<McapAttachment>& attachments() const { return attachments_; }
  // The file ends before its end was written: so many bytes of it are whole.
  std::optional<std::uint64_t> truncated_at() const { return truncated_at_; }
  const std::vector<McapDamage>& damage() const { return damage_; }

 private:
  McapReader(int fd, std::uint64_t size, std::string path);

  bool Read(std::uint64_t count, std::string* bytes);
  bool PeekRecord(std::uint8_t* opcode, std::uint64_t* length);
  bool Keep(std::uint64_t bytes, std::uint64_t most, const char* what, std::uint64_t* kept);
  bool KeepDescription(std::uint64_t bytes);
  bool ReadRecord(std::uint8_t opcode, std::uint64_t length);
  void ReadSchema(std::string_view content);
  void ReadChannel(std::string_view content);
  void ReadMetadata(std::string_view content);
  void ReadAttachment(std::string_view content);
  absl::Status OpenChunk(std::string_view content, bool whole);
  bool TakeFromChunk(McapMessage* message);
  void ReadEnd(std::string_view content, std::uint32_t crc_before);
  void EndEarly(std::uint64_t whole_bytes);
  void Damaged(std::uint64_t offset, std::string what);

  const int fd_;
  const std::uint64_t size_;
  const std::string path_;
  bool has_end_ = false;  // the closing magic is there
  std::uint64_t position_ = 0;
  std::uint32_t crc_ = 0;  // of all bytes read
  bool done_ = false;
  absl::Status refused_;                                        // more than is kept
  std::uint64_t attachment_bytes_ = 0, description_bytes_ = 0;  // kept

  std::map<std::uint16_t, McapSchema> schemas_;
  std::map<std::uint16_t, McapChannel> channels_;
  std::map<std::string, std::map<std::string, std::string>> metadata_;
  std::vector<McapAttachment> attachments_;
  std::optional<std::uint64_t> truncated_at_;
  std::vector<McapDamage> damage_;

  std::string record_;              // content of the one read last
  std::uint64_t record_begin_ = 0;  // of its prefix
  std::string_view chunk_;          // what is left of the open chunk, in `record_`
  std::uint64_t chunk_at_ = 0;      // its place in the file
  bool chunk_whole_ = true;         // false: the file ends in it
};

// The first bytes of a foreign text, for a message of ours: nothing in it reaches a terminal.
std::string Escaped(std::string_view text);

}  // namespace adhesim
