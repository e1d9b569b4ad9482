#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/recording/mcap_format.h"
#include "server/recording/mcap_reader.h"
#include "server/recording/mcap_writer.h"

namespace adhesim::test {

// Tests may run at the same time in processes of their own.
inline std::string TempPath(const std::string& name) {
  return ::testing::TempDir() + "recording_" + std::to_string(getpid()) + "_" + name;
}

inline void WriteFile(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline std::string ReadWholeFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
}

inline ByteSink SinkInto(std::string* bytes) {
  return [bytes](std::string_view more) {
    bytes->append(more);
    return absl::OkStatus();
  };
}

// Where a record's content begins, and how long it is.
struct RecordPlace {
  std::uint8_t opcode;
  std::size_t content, length;
};

// The records of an undamaged file, chunks as one.
inline std::vector<RecordPlace> RecordsOf(const std::string& file) {
  std::vector<RecordPlace> records;
  std::size_t at = mcap::kMagic.size();
  while (at + mcap::kMagic.size() < file.size()) {
    std::uint64_t length = 0;
    std::memcpy(&length, file.data() + at + 1, sizeof(length));
    records.push_back({static_cast<std::uint8_t>(file[at]), at + mcap::kRecordPrefix, length});
    at += mcap::kRecordPrefix + length;
  }
  return records;
}

// Makes every checksum of chunks and of the data section right for what is there.
inline void RepairChecksums(std::string* file) {
  constexpr std::size_t kCrcAt = 8 + 8 + 8;  // in a chunk's content
  constexpr std::size_t kChunkPrefix = kCrcAt + 4 + 4 + 8;
  for (const RecordPlace& record : RecordsOf(*file)) {
    std::uint32_t crc = 0;
    if (record.opcode == mcap::kChunk) {
      crc = Crc32(std::string_view(*file).substr(record.content + kChunkPrefix,
                                                 record.length - kChunkPrefix));
      std::memcpy(file->data() + record.content + kCrcAt, &crc, sizeof(crc));
    } else if (record.opcode == mcap::kDataEnd) {
      crc = Crc32(std::string_view(*file).substr(0, record.content - mcap::kRecordPrefix));
      std::memcpy(file->data() + record.content, &crc, sizeof(crc));
    }
  }
}

}  // namespace adhesim::test
