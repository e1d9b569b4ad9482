#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

// MCAP, major version 0 (https://mcap.dev/spec): a file of records, each an opcode, the length of
// its content (u64) and the content; integers are little-endian, strings have a u32 length.
namespace adhesim::mcap {

static_assert(std::endian::native == std::endian::little, "integers are memory copies");

inline constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
inline constexpr std::size_t kVersionAt = 5;     // of the byte in the magic that is the version
inline constexpr std::size_t kRecordPrefix = 9;  // opcode and length
// Of a message record's content before its data: channel, sequence, two times.
inline constexpr std::size_t kMessagePrefix = 2 + 4 + 8 + 8;

enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

template <std::unsigned_integral T>
void Put(T value, std::string* out) {
  out->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

inline void PutString(std::string_view text, std::string* out) {
  Put(static_cast<std::uint32_t>(text.size()), out);
  out->append(text);
}

// Opens a record at the end of `out`; CloseRecord(), with the value returned here, fills in its
// length.
inline std::size_t OpenRecord(Opcode opcode, std::string* out) {
  out->push_back(static_cast<char>(opcode));
  Put(std::uint64_t{0}, out);
  return out->size();
}

inline void CloseRecord(std::size_t content_begin, std::string* out) {
  const std::uint64_t length = out->size() - content_begin;
  std::memcpy(out->data() + content_begin - sizeof(length), &length, sizeof(length));
}

// Takes values from the front of bytes. Every call says whether there were enough; after one that
// did not have enough, all fail.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : bytes_(bytes) {}

  template <std::unsigned_integral T>
  bool Take(T* value) {
    if (bytes_.size() < sizeof(T)) return Fail();
    std::memcpy(value, bytes_.data(), sizeof(T));
    bytes_.remove_prefix(sizeof(T));
    return true;
  }
  bool TakeBytes(std::uint64_t count, std::string_view* bytes) {
    if (bytes_.size() < count) return Fail();
    *bytes = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return true;
  }
  bool TakeString(std::string_view* text) {
    std::uint32_t length = 0;
    return Take(&length) && TakeBytes(length, text);
  }
  std::string_view rest() const { return bytes_; }

 private:
  bool Fail() {
    bytes_ = {};
    return false;
  }
  std::string_view bytes_;
};

}  // namespace adhesim::mcap
