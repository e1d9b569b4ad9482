#include "server/recording/mcap_reader.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "server/recording/mcap_format.h"
#include "server/recording/mcap_writer.h"

namespace adhesim {
namespace {

using namespace mcap;

// More would say nothing new, and a hostile file could hold millions.
constexpr std::size_t kMostDamage = 100;

// Reads exactly so many bytes at a place.
bool ReadAt(int fd, std::uint64_t offset, std::uint64_t count, char* out) {
  while (count > 0) {
    const ssize_t got = pread(fd, out, count, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    out += got;
    offset += got;
    count -= got;
  }
  return true;
}

}  // namespace

std::string Escaped(std::string_view text) {
  constexpr std::size_t kMostBytes = 100;
  text = text.substr(0, kMostBytes);
  return absl::CHexEscape(absl::string_view(text.data(), text.size()));
}

absl::StatusOr<std::unique_ptr<McapReader>> McapReader::Open(const std::string& path) {
  // Without blocking: opening a pipe would wait for its writer.
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return absl::NotFoundError(absl::StrCat("'", path, "': ", std::strerror(errno)));
  struct stat about {};
  if (fstat(fd, &about) != 0 || !S_ISREG(about.st_mode)) {
    close(fd);
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': not a regular file"));
  }
  std::unique_ptr<McapReader> reader(new McapReader(fd, about.st_size, path));
  std::string magic;
  const bool is_mcap = reader->Read(kMagic.size(), &magic) &&
                       magic.substr(0, kVersionAt) == kMagic.substr(0, kVersionAt);
  if (!is_mcap) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': not an MCAP file: it begins with \"", Escaped(magic),
                     "\", permitted is \"", Escaped(kMagic), "\""));
  }
  if (magic != kMagic) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': MCAP of version \"", Escaped(magic.substr(kVersionAt)),
                     "\" (byte 5), permitted is \"", Escaped(kMagic.substr(kVersionAt)), "\""));
  }
  std::string end(kMagic.size(), '\0');
  reader->has_end_ = reader->size_ >= 2 * kMagic.size() &&
                     ReadAt(fd, reader->size_ - end.size(), end.size(), end.data()) &&
                     end == kMagic;
  // All that comes before the first message.
  std::uint8_t opcode = 0;
  std::uint64_t length = 0;
  while (reader->PeekRecord(&opcode, &length) && opcode != kChunk && opcode != kMessage) {
    if (!reader->ReadRecord(opcode, length)) break;
  }
  if (!reader->refused_.ok()) return reader->refused_;
  return reader;
}

McapReader::McapReader(int fd, std::uint64_t size, std::string path)
    : fd_(fd), size_(size), path_(std::move(path)) {}

McapReader::~McapReader() { close(fd_); }

// The next bytes, which the caller knows (or tries) to be there.
bool McapReader::Read(std::uint64_t count, std::string* bytes) {
  bytes->clear();
  if (count > size_ - position_) return false;
  bytes->resize(count);
  if (!ReadAt(fd_, position_, count, bytes->data())) return false;
  position_ += count;
  crc_ = Crc32(*bytes, crc_);
  return true;
}

void McapReader::Damaged(std::uint64_t offset, std::string what) {
  if (damage_.size() < kMostDamage) damage_.push_back({offset, std::move(what), {}, {}});
}

// The rest cannot be read. In a file whose end is there, that is damage.
void McapReader::EndEarly(std::uint64_t whole_bytes) {
  done_ = true;
  if (has_end_) {
    Damaged(whole_bytes, "a record here has a length that cannot be; the rest is not read");
  } else {
    truncated_at_ = whole_bytes;
  }
}

// The prefix of the next record; false at the end, or when there is no whole one.
bool McapReader::PeekRecord(std::uint8_t* opcode, std::uint64_t* length) {
  if (done_) return false;
  record_begin_ = position_;
  char prefix[kRecordPrefix];
  if (size_ - position_ < kRecordPrefix || !ReadAt(fd_, position_, kRecordPrefix, prefix)) {
    EndEarly(position_);
    return false;
  }
  *opcode = static_cast<std::uint8_t>(prefix[0]);
  std::memcpy(length, prefix + 1, sizeof(*length));
  const bool too_large = *length > kMaxRecordBytes;
  if (*opcode == 0 || too_large) {
    // What a record that was never written looks like, too: zeros at the end of a file whose
    // writer lost its power.
    if (!has_end_) {
      EndEarly(position_);
      return false;
    }
    done_ = true;
    Damaged(position_, too_large ? absl::StrCat("a record of ", *length, " bytes, permitted are ",
                                                kMaxRecordBytes, "; the rest is not read")
                                 : "no record begins with 0; the rest is not read");
    return false;
  }
  const bool whole = *length <= size_ - position_ - kRecordPrefix;
  if (!whole && *opcode != kChunk) {  // of a chunk, a part is good as well
    EndEarly(position_);
    return false;
  }
  return true;
}

// False, and nothing more is read, when there would be too much of it.
bool McapReader::Keep(std::uint64_t bytes, std::uint64_t most, const char* what,
                      std::uint64_t* kept) {
  if (bytes <= most - *kept) {
    *kept += bytes;
    return true;
  }
  done_ = true;
  chunk_ = {};
  refused_ = absl::InvalidArgumentError(
      absl::StrCat("'", path_, "': more than ", most, " bytes of ", what, " (up to byte ",
                   record_begin_, "); permitted are so many in all"));
  return false;
}

bool McapReader::KeepDescription(std::uint64_t bytes) {
  return Keep(bytes, kMaxDescriptionBytes, "schemas, channels and metadata", &description_bytes_);
}

// Reads a record that is not a chunk; false after the last one.
bool McapReader::ReadRecord(std::uint8_t opcode, std::uint64_t length) {
  // Before memory is taken. Even an empty attachment takes some.
  if (opcode == kAttachment && !Keep(length + sizeof(McapAttachment), kMaxAttachmentBytes,
                                     "attachments", &attachment_bytes_)) {
    return false;
  }
  const std::uint32_t crc_before = crc_;
  std::string prefix;
  if (!Read(kRecordPrefix, &prefix) || !Read(length, &record_)) {
    EndEarly(record_begin_);
    return false;
  }
  switch (opcode) {
    case kSchema:
      ReadSchema(record_);
      break;
    case kChannel:
      ReadChannel(record_);
      break;
    case kMetadata:
      ReadMetadata(record_);
      break;
    case kAttachment:
      ReadAttachment(record_);
      break;
    case kDataEnd:
      ReadEnd(record_, crc_before);
      return false;
    case kFooter:
      Damaged(record_begin_, "a footer before the end of the data section");
      done_ = true;
      return false;
    default:  // the header, indexes, and what later versions add
      break;
  }
  return refused_.ok();
}

void McapReader::ReadSchema(std::string_view content) {
  Cursor cursor(content);
  std::uint16_t id = 0;
  std::string_view name, encoding, data;
  if (!cursor.Take(&id) || !cursor.TakeString(&name) || !cursor.TakeString(&encoding) ||
      !cursor.TakeString(&data)) {
    return Damaged(record_begin_, "a schema that is too short");
  }
  // Writers may repeat schemas and channels in every chunk: the one before is not kept.
  McapSchema& schema = schemas_[id];
  description_bytes_ -= schema.name.size() + schema.encoding.size() + schema.data.size();
  if (!KeepDescription(name.size() + encoding.size() + data.size())) return;
  schema = {std::string(name), std::string(encoding), std::string(data)};
}

void McapReader::ReadChannel(std::string_view content) {
  Cursor cursor(content);
  std::uint16_t id = 0;
  McapChannel channel;
  std::string_view topic, encoding;
  if (!cursor.Take(&id) || !cursor.Take(&channel.schema) || !cursor.TakeString(&topic) ||
      !cursor.TakeString(&encoding)) {
    return Damaged(record_begin_, "a channel that is too short");
  }
  McapChannel& before = channels_[id];
  description_bytes_ -= before.topic.size() + before.message_encoding.size();
  if (!KeepDescription(topic.size() + encoding.size())) return;
  channel.topic = topic;
  channel.message_encoding = encoding;
  before = std::move(channel);
}

void McapReader::ReadMetadata(std::string_view content) {
  Cursor cursor(content);
  std::string_view name, map;
  if (!cursor.TakeString(&name) || !cursor.TakeString(&map)) {
    return Damaged(record_begin_, "metadata that is too short");
  }
  if (!KeepDescription(content.size())) return;
  std::map<std::string, std::string>& values = metadata_[std::string(name)];
  Cursor entries(map);
  while (!entries.rest().empty()) {
    std::string_view key, value;
    if (!entries.TakeString(&key) || !entries.TakeString(&value)) {
      return Damaged(record_begin_, "metadata that is too short");
    }
    values[std::string(key)] = value;
  }
}

void McapReader::ReadAttachment(std::string_view content) {
  Cursor cursor(content);
  std::uint64_t log_time = 0, create_time = 0, size = 0;
  std::uint32_t crc = 0;
  std::string_view name, media_type, data;
  if (!cursor.Take(&log_time) || !cursor.Take(&create_time) || !cursor.TakeString(&name) ||
      !cursor.TakeString(&media_type) || !cursor.Take(&size) || !cursor.TakeBytes(size, &data) ||
      !cursor.Take(&crc)) {
    return Damaged(record_begin_, "an attachment that is too short");
  }
  const std::size_t covered = content.size() - cursor.rest().size() - sizeof(crc);
  if (crc != 0 && crc != Crc32(content.substr(0, covered))) {
    Damaged(record_begin_,
            absl::StrCat("the checksum of the attachment \"", Escaped(name), "\" is wrong"));
  }
  attachments_.push_back({std::string(name), std::string(media_type), std::string(data)});
}

// Content of a chunk, or the part of it that there is.
absl::Status McapReader::OpenChunk(std::string_view content, bool whole) {
  Cursor cursor(content);
  std::uint64_t first_time = 0, last_time = 0, uncompressed = 0, size = 0;
  std::uint32_t crc = 0;
  std::string_view compression;
  if (!cursor.Take(&first_time) || !cursor.Take(&last_time) || !cursor.Take(&uncompressed) ||
      !cursor.Take(&crc) || !cursor.TakeString(&compression) || !cursor.Take(&size)) {
    if (whole) {
      Damaged(record_begin_, "a chunk that is too short");
    } else {
      EndEarly(record_begin_);
    }
    return absl::OkStatus();
  }
  if (!compression.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path_, "': the chunk at byte ", record_begin_, " is compressed (\"",
                     Escaped(compression), "\"), permitted are uncompressed ones"));
  }
  chunk_ = cursor.rest();
  chunk_at_ = record_begin_ + kRecordPrefix + (content.size() - chunk_.size());
  chunk_whole_ = whole;
  if (!whole) return absl::OkStatus();
  if (size != chunk_.size() || uncompressed != size) {
    Damaged(record_begin_, "the sizes in a chunk contradict each other");
  } else if (crc != 0 && crc != Crc32(chunk_)) {
    Damaged(record_begin_, "the checksum of a chunk is wrong");
  } else {
    return absl::OkStatus();
  }
  if (damage_.back().offset == record_begin_) {
    damage_.back().first_time = first_time;
    damage_.back().last_time = last_time;
  }
  return absl::OkStatus();
}

// The next message of the open chunk; false when it has none left.
bool McapReader::TakeFromChunk(McapMessage* message) {
  while (!chunk_.empty()) {
    const std::uint64_t at = chunk_at_;
    Cursor cursor(chunk_);
    std::uint8_t opcode = 0;
    std::uint64_t length = 0;
    std::string_view content;
    if (!cursor.Take(&opcode) || !cursor.Take(&length) || !cursor.TakeBytes(length, &content)) {
      chunk_ = {};
      if (chunk_whole_) {
        Damaged(at, "a record runs over the end of its chunk");
      } else {
        EndEarly(at);
      }
      return false;
    }
    chunk_at_ += chunk_.size() - cursor.rest().size();
    chunk_ = cursor.rest();
    record_begin_ = at;
    if (opcode == kSchema) ReadSchema(content);
    if (opcode == kChannel) ReadChannel(content);
    if (!refused_.ok()) return false;
    if (opcode != kMessage) continue;
    Cursor fields(content);
    std::uint32_t sequence = 0;
    std::uint64_t publish_time = 0;
    if (!fields.Take(&message->channel) || !fields.Take(&sequence) ||
        !fields.Take(&message->log_time) || !fields.Take(&publish_time)) {
      Damaged(at, "a message that is too short");
      continue;
    }
    message->data = fields.rest();
    message->offset = at;
    return true;
  }
  // The file may end exactly behind a record.
  if (!chunk_whole_ && !done_) EndEarly(chunk_at_);
  return false;
}

absl::StatusOr<bool> McapReader::Next(McapMessage* message) {
  while (true) {
    if (TakeFromChunk(message)) return true;
    if (!refused_.ok()) return refused_;
    std::uint8_t opcode = 0;
    std::uint64_t length = 0;
    if (!PeekRecord(&opcode, &length)) return false;
    if (opcode != kChunk && opcode != kMessage) {
      if (ReadRecord(opcode, length)) continue;
      if (!refused_.ok()) return refused_;
      return false;
    }
    std::string prefix;
    const std::uint64_t there = std::min(length, size_ - position_ - kRecordPrefix);
    if (!Read(kRecordPrefix, &prefix) || !Read(there, &record_)) {
      EndEarly(record_begin_);
      return false;
    }
    if (opcode == kMessage) {
      // A message outside of chunks: read as a chunk of one.
      record_ = absl::StrCat(prefix, record_);
      chunk_ = record_;
      chunk_at_ = record_begin_;
      chunk_whole_ = true;
      continue;
    }
    if (absl::Status status = OpenChunk(record_, there == length); !status.ok()) return status;
  }
}

// The data end, and the summary behind it: nothing in there is needed, but a file that ends in it
// was cut short.
void McapReader::ReadEnd(std::string_view content, std::uint32_t crc_before) {
  done_ = true;
  const std::uint64_t data_end = position_;
  Cursor cursor(content);
  std::uint32_t crc = 0;
  if (!cursor.Take(&crc)) return Damaged(record_begin_, "a data end that is too short");
  if (crc != 0 && crc != crc_before) {
    Damaged(record_begin_, "the checksum of the data section is wrong");
  }
  if (!has_end_) {
    truncated_at_ = data_end;
    return;
  }
  // Footer: opcode, length 20, start of the summary, of its offsets, checksum; then the magic.
  constexpr std::uint64_t kFooterBytes = kRecordPrefix + 8 + 8 + 4;
  const std::uint64_t end = size_ - kMagic.size();
  if (end < data_end + kFooterBytes) return Damaged(data_end, "there is no footer");
  const std::uint64_t footer_at = end - kFooterBytes;
  const std::uint64_t covered = footer_at + kRecordPrefix + 16 - data_end;
  crc_ = 0;
  std::string part;
  for (std::uint64_t left = covered; left > 0; left -= part.size()) {
    if (!Read(std::min<std::uint64_t>(left, 1 << 20), &part)) {
      return Damaged(data_end, "the summary cannot be read");
    }
  }
  const std::uint32_t summary_crc = crc_;
  std::string tail;
  if (!Read(sizeof(crc), &tail)) return Damaged(data_end, "the summary cannot be read");
  std::memcpy(&crc, tail.data(), sizeof(crc));
  if (crc != 0 && crc != summary_crc) {
    Damaged(data_end, "the checksum of the summary is wrong (nothing in it is used)");
  }
}

}  // namespace adhesim
