#include "core/scene/mesh/label_map.h"

#include <absl/container/flat_hash_map.h>
#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/scene/mesh/bytes.h"
#include "core/scene/mesh/inflate.h"
#include "core/scene/mesh/mesh_text.h"
#include "core/scene/mesh/read_file.h"

namespace adhesim {
namespace {

constexpr std::size_t kMaxHeaderBytes = 1 << 16;
constexpr double kMetresPerMillimetre = 1e-3;

absl::Status Error(absl::string_view what) { return absl::InvalidArgumentError(what); }

// What a header says.
struct Header {
  std::array<int, 3> size{};
  Vec3 spacing_m = Vec3::Ones();
  bool mirrored = false;  // left-handed axes
  int bytes_per_voxel = 1;
  bool big_endian = false;
  bool gzip = false;  // the data after the header
  std::size_t data_position = 0;
};

// Keys and values of lines "KEY=VALUE" or "key: value"; comments begin with #.
std::map<std::string, std::string> Fields(absl::string_view text, absl::string_view separator) {
  std::map<std::string, std::string> fields;
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    if (absl::StartsWith(line, "#")) continue;
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(line, absl::MaxSplits(separator, 1));
    fields[std::string(absl::StripAsciiWhitespace(parts.first))] =
        std::string(absl::StripAsciiWhitespace(parts.second));
  }
  return fields;
}

absl::Status SetSize(int axis, absl::string_view text, Header* header) {
  std::int64_t size = 0;
  if (!ParseWhole(text, &size) || size < 1 || size > 100'000) {
    return Error(absl::StrCat("image size '", text.substr(0, 40), "' must be in 1..100000"));
  }
  header->size[axis] = static_cast<int>(size);
  return absl::OkStatus();
}

absl::Status SetSpacing(int axis, double spacing_mm, Header* header) {
  if (!(std::abs(spacing_mm) >= 1e-4 && std::abs(spacing_mm) <= 1e3)) {
    return Error(absl::StrCat("voxel spacing ", spacing_mm, " mm must be in 0.0001..1000"));
  }
  header->spacing_m[axis] = std::abs(spacing_mm) * kMetresPerMillimetre;
  if (spacing_mm < 0) header->mirrored = !header->mirrored;
  return absl::OkStatus();
}

absl::StatusOr<Header> ParseInrHeader(absl::string_view start) {
  const std::size_t end = start.find("##}");
  if (end == start.npos) return Error("the INR header has no end (##})");
  Header header;
  header.data_position = (end + 3 + 255) / 256 * 256;
  std::map<std::string, std::string> fields = Fields(start.substr(0, end), "=");
  const std::array<const char*, 3> sizes = {"XDIM", "YDIM", "ZDIM"}, steps = {"VX", "VY", "VZ"};
  for (int axis = 0; axis < 3; ++axis) {
    if (absl::Status s = SetSize(axis, fields[sizes[axis]], &header); !s.ok()) return s;
    double spacing_mm = 1;
    if (fields.count(steps[axis]) > 0 && !ParseNumber(fields[steps[axis]], &spacing_mm)) {
      return Error(absl::StrCat(steps[axis], " is not a number"));
    }
    if (absl::Status s = SetSpacing(axis, spacing_mm, &header); !s.ok()) return s;
  }
  if (fields.count("VDIM") > 0 && fields["VDIM"] != "1") {
    return Error("only images with one value per voxel (VDIM=1) are read");
  }
  if (!absl::EndsWith(fields["TYPE"], "fixed")) {
    return Error("only whole-number labels (TYPE=unsigned fixed or signed fixed) are read");
  }
  const std::string& bits = fields["PIXSIZE"];
  header.bytes_per_voxel = bits == "8 bits" ? 1 : bits == "16 bits" ? 2 : bits == "32 bits" ? 4 : 0;
  if (header.bytes_per_voxel == 0) return Error("PIXSIZE must be 8, 16 or 32 bits");
  header.big_endian = fields["CPU"] == "sun" || fields["CPU"] == "sgi";
  return header;
}

// "(a,b,c) (d,e,f) (g,h,i)", in millimetres: one vector per axis of the image.
absl::Status SetDirections(absl::string_view text, Header* header) {
  const std::vector<absl::string_view> words =
      absl::StrSplit(text, absl::ByAnyChar("(), \t"), absl::SkipEmpty());
  Mat3 axes;
  if (words.size() != 9) return Error("'space directions' must be three vectors of three numbers");
  for (int i = 0; i < 9; ++i) {
    if (!ParseNumber(words[i], &axes(i % 3, i / 3))) {
      return Error("'space directions' must be three vectors of three numbers");
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (absl::Status s = SetSpacing(axis, axes.col(axis).norm(), header); !s.ok()) return s;
  }
  header->mirrored = axes.col(0).cross(axes.col(1)).dot(axes.col(2)) < 0;
  return absl::OkStatus();
}

absl::StatusOr<int> NrrdTypeBytes(const std::string& type) {
  static constexpr std::array<std::array<const char*, 6>, 3> kNames = {
      {{"uchar", "unsigned char", "uint8", "signed char", "int8", "uint8_t"},
       {"short", "ushort", "unsigned short", "int16", "uint16", "uint16_t"},
       {"int", "uint", "unsigned int", "int32", "uint32", "uint32_t"}}};
  for (int power = 0; power < 3; ++power) {
    for (const char* name : kNames[power]) {
      if (type == name) return 1 << power;
    }
  }
  return Error(
      "only whole-number labels of 8, 16 or 32 bits are read (type: uchar, short, int...)");
}

absl::StatusOr<Header> ParseNrrdHeader(absl::string_view start) {
  std::size_t end = start.find("\n\n"), blank = 2;
  if (const std::size_t windows = start.find("\r\n\r\n"); windows < end) end = windows, blank = 4;
  if (end == start.npos) return Error("the NRRD header has no end (an empty line)");
  Header header;
  header.data_position = end + blank;
  std::map<std::string, std::string> fields = Fields(start.substr(0, end), ":");
  if (fields.count("data file") + fields.count("datafile") > 0) {
    return Error("data in another file ('data file') is not read; write one .nrrd file");
  }
  if (fields["dimension"] != "3") return Error("the image must have three dimensions");
  const std::vector<std::string> sizes = absl::StrSplit(fields["sizes"], ' ', absl::SkipEmpty());
  if (sizes.size() != 3) return Error("'sizes' must be three numbers");
  for (int axis = 0; axis < 3; ++axis) {
    if (absl::Status s = SetSize(axis, sizes[axis], &header); !s.ok()) return s;
  }
  const absl::StatusOr<int> bytes = NrrdTypeBytes(fields["type"]);
  if (!bytes.ok()) return bytes.status();
  header.bytes_per_voxel = *bytes;
  header.big_endian = fields["endian"] == "big";
  header.gzip = fields["encoding"] == "gzip" || fields["encoding"] == "gz";
  if (!header.gzip && fields["encoding"] != "raw") return Error("'encoding' must be raw or gzip");
  if (fields.count("space directions") > 0) {
    if (absl::Status s = SetDirections(fields["space directions"], &header); !s.ok()) return s;
    return header;
  }
  const std::vector<std::string> steps = absl::StrSplit(fields["spacings"], ' ', absl::SkipEmpty());
  for (int axis = 0; axis < 3; ++axis) {
    double spacing_mm = 1;
    if (!steps.empty() && (steps.size() != 3 || !ParseNumber(steps[axis], &spacing_mm))) {
      return Error("'spacings' must be three numbers");
    }
    if (absl::Status s = SetSpacing(axis, spacing_mm, &header); !s.ok()) return s;
  }
  return header;
}

// Gives labels their numbers.
class LabelNumbers {
 public:
  explicit LabelNumbers(SolidMap* map) : map_(map) {}

  std::uint8_t Of(std::uint32_t label) {
    if (label == 0) return 0;
    if (label == last_label_) return last_number_;  // voxels beside each other are mostly alike
    last_label_ = label;
    const auto [it, is_new] =
        numbers_.try_emplace(label, static_cast<std::uint8_t>(map_->labels.size() + 1));
    if (is_new && map_->labels.size() == kMost) {
      map_->too_many_labels = true;
      it->second = kMost + 1;
    } else if (is_new) {
      map_->labels.push_back(label);
    }
    return last_number_ = it->second;
  }

 private:
  static constexpr std::uint8_t kMost = 254;
  SolidMap* map_;
  std::uint32_t last_label_ = 0;
  std::uint8_t last_number_ = 0;
  absl::flat_hash_map<std::uint32_t, std::uint8_t> numbers_;
};

std::uint32_t LabelOf(const Header& header, absl::string_view data, std::size_t voxel) {
  const std::size_t at = voxel * header.bytes_per_voxel;
  switch (header.bytes_per_voxel) {
    case 1:
      return static_cast<std::uint8_t>(data[at]);
    case 2:
      return LoadNumber<std::uint16_t>(data, at, header.big_endian);
    default:
      return LoadNumber<std::uint32_t>(data, at, header.big_endian);
  }
}

SolidMap MakeSolid(const Header& header, absl::string_view data) {
  SolidMap map{header.size, header.spacing_m, {}, {}};
  LabelNumbers numbers(&map);
  const auto [nx, ny, nz] = header.size;
  const std::size_t layer = static_cast<std::size_t>(nx) * ny;
  map.solid.resize(layer * nz);
  for (int z = 0; z < nz; ++z) {
    const std::size_t from = layer * (header.mirrored ? nz - 1 - z : z);
    for (std::size_t i = 0; i < layer; ++i) {
      map.solid[layer * z + i] = numbers.Of(LabelOf(header, data, from + i));
    }
  }
  return map;
}

}  // namespace

absl::StatusOr<SolidMap> ParseLabelMap(absl::string_view bytes) {
  // The header may be inside the compression (.inr.gz) or before it (NRRD's own).
  const bool whole_gzip = IsGzip(bytes);
  std::string start(bytes.substr(0, kMaxHeaderBytes));
  if (whole_gzip) {
    absl::StatusOr<std::string> inflated = Inflate(bytes, kMaxHeaderBytes);
    if (!inflated.ok()) return inflated.status();
    start = *std::move(inflated);
  }
  const bool is_inr = absl::StartsWith(start, "#INRIMAGE-4#{");
  if (!is_inr && !absl::StartsWith(start, "NRRD000")) {
    return Error("neither an INR (#INRIMAGE-4#{) nor an NRRD (NRRD000) image");
  }
  const absl::StatusOr<Header> header = is_inr ? ParseInrHeader(start) : ParseNrrdHeader(start);
  if (!header.ok()) return header.status();
  const std::int64_t voxels =
      std::int64_t{header->size[0]} * header->size[1] * header->size[2];  // <= 1e15
  const std::int64_t data_bytes = voxels * header->bytes_per_voxel;
  if (voxels > kMaxVoxels || data_bytes > static_cast<std::int64_t>(kMaxLabelBytes)) {
    return Error(absl::StrCat("an image of ", voxels, " voxels; at most ", kMaxVoxels,
                              " voxels and ", kMaxLabelBytes, " bytes are permitted"));
  }
  std::string inflated;
  absl::string_view data;
  if (whole_gzip && header->gzip) return Error("compressed twice");
  if (whole_gzip || header->gzip) {
    const std::size_t skip = whole_gzip ? header->data_position : 0;
    const absl::string_view gzip =
        whole_gzip ? bytes : bytes.substr(std::min(header->data_position, bytes.size()));
    absl::StatusOr<std::string> all = Inflate(gzip, skip + data_bytes);
    if (!all.ok()) return all.status();
    inflated = *std::move(all);
    data = absl::string_view(inflated).substr(std::min(skip, inflated.size()));
  } else {
    data = bytes.substr(std::min(header->data_position, bytes.size()));
  }
  if (static_cast<std::int64_t>(data.size()) < data_bytes) {
    return Error(absl::StrCat("the header announces ", data_bytes, " bytes of voxels; there are ",
                              data.size()));
  }
  return MakeSolid(*header, data);
}

absl::StatusOr<SolidMap> ReadLabelMap(const std::string& path) {
  const absl::StatusOr<std::string> bytes = ReadFile(path, kMaxLabelBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<SolidMap> map = ParseLabelMap(*bytes);
  if (map.ok()) return map;
  return absl::Status(map.status().code(), absl::StrCat("'", path, "': ", map.status().message()));
}

bool IsLabelMapName(const std::string& path) {
  absl::string_view name = path;
  absl::ConsumeSuffix(&name, ".gz");
  return absl::EndsWithIgnoreCase(name, ".inr") || absl::EndsWithIgnoreCase(name, ".nrrd");
}

}  // namespace adhesim
