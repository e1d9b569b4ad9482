#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace adhesim {

// Where bytes go, in order. After an error it is not called again.
using ByteSink = std::function<absl::Status(std::string_view)>;

// Writes an MCAP file: uncompressed chunks with checksum and message indexes, and a summary at the
// end. Each chunk leaves in one call of the sink, so that a file cut short is whole up to there.
//
// One thread at a time. The first error of the sink stays in status(), and everything after it is
// ignored.
class McapWriter {
 public:
  // Writes the header; `library` is free text.
  McapWriter(ByteSink sink, std::string_view profile, std::string_view library);

  // These are written at once, before the chunk that is being filled.
  std::uint16_t AddSchema(std::string_view name, std::string_view encoding, std::string_view data);
  std::uint16_t AddChannel(std::uint16_t schema, std::string_view topic,
                           std::string_view message_encoding);
  void AddMetadata(std::string_view name, const std::map<std::string, std::string>& values);
  void AddAttachment(std::string_view name, std::string_view media_type, std::string_view data);

  // Adds to the chunk that is being filled; times are ns.
  void AddMessage(std::uint16_t channel, std::uint64_t log_time, std::string_view data);
  // Bytes of messages that are not written yet.
  std::size_t chunk_bytes() const { return chunk_.size(); }
  // Writes them as a chunk. Does nothing when there are none.
  void FlushChunk();

  // Flushes, and writes the end of the file. Last call.
  void Finish();

  const absl::Status& status() const { return status_; }
  std::uint64_t bytes_written() const { return offset_; }

 private:
  struct Channel {
    std::string record;  // as written, for the summary
    std::uint32_t sequence = 0;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> index;  // of the chunk: time, offset
    std::uint64_t messages = 0;
  };
  struct ChunkPlace {
    std::uint64_t start_time, end_time, offset, length, index_length, size;
    std::vector<std::pair<std::uint16_t, std::uint64_t>> index_offsets;
  };

  void Write(std::string_view bytes);
  std::string SummaryGroups(std::uint64_t begin, std::string* offsets) const;
  std::string StatisticsRecord() const;
  std::string ChunkIndexRecord(const ChunkPlace& place) const;

  ByteSink sink_;
  absl::Status status_;
  std::uint64_t offset_ = 0;
  std::uint32_t crc_ = 0;  // of all bytes written

  std::vector<std::string> schemas_;  // as written; ids from 1
  std::vector<Channel> channels_;     // ids from 0
  std::vector<ChunkPlace> chunks_;
  std::vector<std::string> attachments_;  // contents of their index records
  std::vector<std::string> metadata_;     // likewise

  std::string chunk_;
  std::uint64_t chunk_start_ = 0, chunk_end_ = 0;  // times of its messages
  std::uint64_t first_time_ = 0, last_time_ = 0;   // of all messages
  std::uint64_t messages_ = 0;
};

// CRC-32 as in zlib.
std::uint32_t Crc32(std::string_view bytes, std::uint32_t before = 0);

}  // namespace adhesim
