#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/model/geometry.h"

namespace adhesim {

constexpr std::int64_t kMaxVoxels = 500'000'000;
constexpr std::size_t kMaxLabelBytes = std::size_t{1} << 30;  // of voxels, after decompression

// A segmented image. A surface needs only which voxels have any label; tetrahedra ask which.
struct SolidMap {
  std::array<int, 3> size{};          // voxels along x, y, z; right-handed axes
  Vec3 spacing_m = Vec3::Ones();      // between voxels
  std::vector<std::uint8_t> solid;    // [z][y][x] 0: no label; else the label's number, from 1
  std::vector<std::uint32_t> labels;  // label number i + 1, in the order of their first voxels
  bool too_many_labels = false;       // those after the 254th share a number, without a label
};

// Reads an INR ("#INRIMAGE-4#{", fixed point) or NRRD (three dimensions, data in the same file, raw
// or gzip) label map; either may be gzip-compressed as a whole (".inr.gz"). Both formats mean
// millimetres. Of an NRRD's `space directions` the lengths and the handedness are used (a
// left-handed image is mirrored back); the patient's pose is not. Headers are checked against
// kMaxVoxels and against the data before memory is taken.
absl::StatusOr<SolidMap> ReadLabelMap(const std::string& path);

// The same from the bytes of a file.
absl::StatusOr<SolidMap> ParseLabelMap(absl::string_view bytes);

// True when a file's name ends like a label map's: .inr, .nrrd, .inr.gz, .nrrd.gz.
bool IsLabelMapName(const std::string& path);

}  // namespace adhesim
