#include "core/scene/mesh/inflate.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <zlib.h>

#include <algorithm>
#include <array>

namespace adhesim {

bool IsGzip(absl::string_view bytes) {
  return bytes.size() > 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

absl::StatusOr<std::string> Inflate(absl::string_view gzip, std::size_t max_bytes) {
  z_stream stream{};
  // 16: a gzip header, not a zlib one.
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) {
    return absl::ResourceExhaustedError("cannot start decompression");
  }
  std::string bytes;
  std::array<char, 1 << 16> block;
  std::size_t consumed = 0;
  int code = Z_OK;
  while (code == Z_OK && bytes.size() < max_bytes) {
    if (stream.avail_in == 0) {  // zlib counts in 32 bits: hand the input over in parts
      const std::size_t part = std::min<std::size_t>(gzip.size() - consumed, 1 << 20);
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(gzip.data() + consumed));
      stream.avail_in = static_cast<uInt>(part);
      consumed += part;
    }
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    code = inflate(&stream, Z_NO_FLUSH);  // Z_BUF_ERROR when there is no more input
    bytes.append(block.data(), block.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (bytes.size() >= max_bytes) {
    bytes.resize(max_bytes);
    return bytes;
  }
  if (code == Z_STREAM_END) return bytes;
  return absl::DataLossError(code == Z_BUF_ERROR ? "the compressed data ends too early"
                                                 : "the compressed data is damaged");
}

}  // namespace adhesim
