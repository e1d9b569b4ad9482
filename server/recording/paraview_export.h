#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/recording/mcap_reader.h"

namespace adhesim {

struct ExportResult {
  std::uint64_t frames = 0;                   // written
  std::optional<std::uint64_t> truncated_at;  // bytes of the recording that are whole
  std::vector<McapDamage> damage;             // frames that cannot be read are left out
  bool interrupted = false;
};

// Writes the frames of a recording for ParaView: NAME.pvd, and a file for each in NAME_frames/
// (PolyData, XML with raw appended data). Points are where particles are; they have
//   displacement   from rest, m           contact_force  exerted by contact, N
//   zone           id, or -1              strain_energy  share of the elastic energy, J
// and times are simulated seconds since the recording began. Errors: no recording, no topology in
// it, a file that cannot be written.
absl::StatusOr<ExportResult> ExportParaView(const std::string& recording, const std::string& pvd,
                                            const std::atomic<bool>& stop);

}  // namespace adhesim
