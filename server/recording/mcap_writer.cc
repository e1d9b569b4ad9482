#include "server/recording/mcap_writer.h"

#include <zlib.h>

#include <algorithm>

#include "server/recording/mcap_format.h"

namespace adhesim {
namespace {

using namespace mcap;

std::string Record(Opcode opcode, std::string_view content) {
  std::string out;
  const std::size_t begin = OpenRecord(opcode, &out);
  out.append(content);
  CloseRecord(begin, &out);
  return out;
}

}  // namespace

std::uint32_t Crc32(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

McapWriter::McapWriter(ByteSink sink, std::string_view profile, std::string_view library)
    : sink_(std::move(sink)) {
  std::string content;
  PutString(profile, &content);
  PutString(library, &content);
  Write(std::string(kMagic) + Record(kHeader, content));
}

void McapWriter::Write(std::string_view bytes) {
  if (!status_.ok()) return;
  status_ = sink_(bytes);
  if (!status_.ok()) return;
  offset_ += bytes.size();
  crc_ = Crc32(bytes, crc_);
}

std::uint16_t McapWriter::AddSchema(std::string_view name, std::string_view encoding,
                                    std::string_view data) {
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);  // 0 would mean "none"
  std::string content;
  Put(id, &content);
  PutString(name, &content);
  PutString(encoding, &content);
  PutString(data, &content);
  schemas_.push_back(Record(kSchema, content));
  Write(schemas_.back());
  return id;
}

std::uint16_t McapWriter::AddChannel(std::uint16_t schema, std::string_view topic,
                                     std::string_view message_encoding) {
  const auto id = static_cast<std::uint16_t>(channels_.size());
  std::string content;
  Put(id, &content);
  Put(schema, &content);
  PutString(topic, &content);
  PutString(message_encoding, &content);
  Put(std::uint32_t{0}, &content);  // no metadata
  Channel channel;
  channel.record = Record(kChannel, content);
  Write(channel.record);
  channels_.push_back(std::move(channel));
  return id;
}

void McapWriter::AddMetadata(std::string_view name,
                             const std::map<std::string, std::string>& values) {
  std::string map;
  for (const auto& [key, value] : values) {
    PutString(key, &map);
    PutString(value, &map);
  }
  std::string content;
  PutString(name, &content);
  PutString(map, &content);
  const std::string record = Record(kMetadata, content);
  std::string index;
  Put(offset_, &index);
  Put(static_cast<std::uint64_t>(record.size()), &index);
  PutString(name, &index);
  metadata_.push_back(std::move(index));
  Write(record);
}

void McapWriter::AddAttachment(std::string_view name, std::string_view media_type,
                               std::string_view data) {
  std::string record;
  const std::size_t begin = OpenRecord(kAttachment, &record);
  Put(std::uint64_t{0}, &record);  // log time: the start
  Put(std::uint64_t{0}, &record);  // time of creation: not known
  PutString(name, &record);
  PutString(media_type, &record);
  Put(static_cast<std::uint64_t>(data.size()), &record);
  record.append(data);
  Put(Crc32(std::string_view(record).substr(begin)), &record);
  CloseRecord(begin, &record);
  std::string index;
  Put(offset_, &index);
  Put(static_cast<std::uint64_t>(record.size()), &index);
  Put(std::uint64_t{0}, &index);
  Put(std::uint64_t{0}, &index);
  Put(static_cast<std::uint64_t>(data.size()), &index);
  PutString(name, &index);
  PutString(media_type, &index);
  attachments_.push_back(std::move(index));
  Write(record);
}

void McapWriter::AddMessage(std::uint16_t channel, std::uint64_t log_time, std::string_view data) {
  if (!status_.ok()) return;
  Channel& to = channels_[channel];
  if (chunk_.empty()) {
    chunk_start_ = chunk_end_ = log_time;
  }
  chunk_start_ = std::min(chunk_start_, log_time);
  chunk_end_ = std::max(chunk_end_, log_time);
  if (messages_ == 0) first_time_ = last_time_ = log_time;
  first_time_ = std::min(first_time_, log_time);
  last_time_ = std::max(last_time_, log_time);
  ++messages_;
  ++to.messages;
  to.index.emplace_back(log_time, chunk_.size());
  const std::size_t begin = OpenRecord(kMessage, &chunk_);
  Put(channel, &chunk_);
  Put(to.sequence++, &chunk_);
  Put(log_time, &chunk_);
  Put(log_time, &chunk_);  // published when it was logged
  chunk_.append(data);
  CloseRecord(begin, &chunk_);
}

void McapWriter::FlushChunk() {
  if (chunk_.empty()) return;
  ChunkPlace place{chunk_start_, chunk_end_, offset_, 0, 0, chunk_.size(), {}};
  std::string out;
  out.reserve(chunk_.size() + chunk_.size() / 8 + 256);
  const std::size_t begin = OpenRecord(kChunk, &out);
  Put(chunk_start_, &out);
  Put(chunk_end_, &out);
  Put(static_cast<std::uint64_t>(chunk_.size()), &out);
  Put(Crc32(chunk_), &out);
  PutString("", &out);  // not compressed
  Put(static_cast<std::uint64_t>(chunk_.size()), &out);
  out.append(chunk_);
  CloseRecord(begin, &out);
  place.length = out.size();
  for (std::size_t id = 0; id < channels_.size(); ++id) {
    Channel& channel = channels_[id];
    if (channel.index.empty()) continue;
    place.index_offsets.emplace_back(id, offset_ + out.size());
    const std::size_t index = OpenRecord(kMessageIndex, &out);
    Put(static_cast<std::uint16_t>(id), &out);
    Put(static_cast<std::uint32_t>(channel.index.size() * 16), &out);
    for (const auto& [time, offset] : channel.index) {
      Put(time, &out);
      Put(offset, &out);
    }
    CloseRecord(index, &out);
    channel.index.clear();
  }
  place.index_length = out.size() - place.length;
  chunk_.clear();
  Write(out);
  chunks_.push_back(std::move(place));
}

std::string McapWriter::StatisticsRecord() const {
  std::string content;
  Put(messages_, &content);
  Put(static_cast<std::uint16_t>(schemas_.size()), &content);
  Put(static_cast<std::uint32_t>(channels_.size()), &content);
  Put(static_cast<std::uint32_t>(attachments_.size()), &content);
  Put(static_cast<std::uint32_t>(metadata_.size()), &content);
  Put(static_cast<std::uint32_t>(chunks_.size()), &content);
  Put(first_time_, &content);
  Put(last_time_, &content);
  Put(static_cast<std::uint32_t>(channels_.size() * 10), &content);
  for (std::size_t id = 0; id < channels_.size(); ++id) {
    Put(static_cast<std::uint16_t>(id), &content);
    Put(channels_[id].messages, &content);
  }
  return Record(kStatistics, content);
}

std::string McapWriter::ChunkIndexRecord(const ChunkPlace& place) const {
  std::string content;
  Put(place.start_time, &content);
  Put(place.end_time, &content);
  Put(place.offset, &content);
  Put(place.length, &content);
  Put(static_cast<std::uint32_t>(place.index_offsets.size() * 10), &content);
  for (const auto& [channel, offset] : place.index_offsets) {
    Put(channel, &content);
    Put(offset, &content);
  }
  Put(place.index_length, &content);
  PutString("", &content);
  Put(place.size, &content);
  Put(place.size, &content);
  return Record(kChunkIndex, content);
}

// The summary's records, grouped by opcode, and for each group where it is.
std::string McapWriter::SummaryGroups(std::uint64_t begin, std::string* offsets) const {
  std::string out;
  const auto group = [&](Opcode opcode, const auto& fill) {
    const std::size_t from = out.size();
    fill();
    if (out.size() == from) return;
    std::string content;
    Put(static_cast<std::uint8_t>(opcode), &content);
    Put(static_cast<std::uint64_t>(begin + from), &content);
    Put(static_cast<std::uint64_t>(out.size() - from), &content);
    offsets->append(Record(kSummaryOffset, content));
  };
  group(kSchema, [&] {
    for (const std::string& schema : schemas_) out += schema;
  });
  group(kChannel, [&] {
    for (const Channel& channel : channels_) out += channel.record;
  });
  group(kStatistics, [&] { out += StatisticsRecord(); });
  group(kChunkIndex, [&] {
    for (const ChunkPlace& chunk : chunks_) out += ChunkIndexRecord(chunk);
  });
  group(kAttachmentIndex, [&] {
    for (const std::string& index : attachments_) out += Record(kAttachmentIndex, index);
  });
  group(kMetadataIndex, [&] {
    for (const std::string& index : metadata_) out += Record(kMetadataIndex, index);
  });
  return out;
}

void McapWriter::Finish() {
  FlushChunk();
  std::string end;
  Put(crc_, &end);
  Write(Record(kDataEnd, end));
  const std::uint64_t summary_begin = offset_;
  std::string offsets;
  std::string out = SummaryGroups(summary_begin, &offsets);
  const std::uint64_t offsets_begin = summary_begin + out.size();
  out += offsets;
  const std::size_t footer = OpenRecord(kFooter, &out);
  Put(summary_begin, &out);
  Put(offsets_begin, &out);
  out.resize(out.size() + sizeof(std::uint32_t));
  CloseRecord(footer, &out);
  out.resize(out.size() - sizeof(std::uint32_t));
  Put(Crc32(out), &out);  // from the summary's start up to here
  out += kMagic;
  Write(out);
}

}  // namespace adhesim
