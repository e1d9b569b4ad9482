#include "server/recording/paraview_export.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <utility>

#include "adhesim/v1/view_service.pb.h"
#include "server/recording/recording_format.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

using Vec3f = std::array<float, 3>;

// The values in bytes that are known to be a whole number of them.
template <typename T>
std::vector<T> Values(const std::string& bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

// What does not change from frame to frame.
struct Surface {
  std::vector<Vec3f> rest_m;
  std::vector<std::int32_t> triangles;  // three particles each
};

absl::StatusOr<Surface> ReadSurface(const v1::Topology& topology) {
  Surface surface;
  surface.rest_m = Values<Vec3f>(topology.rest_positions());
  surface.triangles = Values<std::int32_t>(topology.triangles());
  const auto count = static_cast<std::int64_t>(topology.particles());
  const auto outside = [count](std::int32_t p) { return p < 0 || p >= count; };
  if (topology.rest_positions().size() != sizeof(Vec3f) * count ||
      topology.triangles().size() % (3 * sizeof(std::int32_t)) != 0 ||
      std::any_of(surface.triangles.begin(), surface.triangles.end(), outside)) {
    return absl::InvalidArgumentError("its topology contradicts itself");
  }
  return surface;
}

// The arrays of a file, behind its XML: each a length (u64) and its bytes.
class AppendedData {
 public:
  // The element that says where the array is.
  template <typename T>
  std::string Add(const char* name, const char* type, int components,
                  const std::vector<T>& values) {
    const std::string element = absl::StrFormat(
        "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" "
        "format=\"appended\" offset=\"%d\"/>\n",
        type, name, components, bytes_.size());
    const std::uint64_t size = values.size() * sizeof(T);
    bytes_.append(reinterpret_cast<const char*>(&size), sizeof(size));
    bytes_.append(reinterpret_cast<const char*>(values.data()), size);
    return element;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

struct FrameArrays {
  std::vector<Vec3f> position_m, displacement_m, contact_force_n;
  std::vector<std::int32_t> zone;
  std::vector<float> strain_energy_j;
};

// False: the frame does not fit the surface.
bool ReadFrame(const v1::Frame& frame, const Surface& surface, FrameArrays* arrays) {
  const std::size_t count = surface.rest_m.size();
  const auto fits = [count](const std::string& bytes) {
    return bytes.empty() || bytes.size() == 4 * count;
  };
  if (frame.encoding() == v1::POSITION_ENCODING_Q16 ||
      frame.positions().size() != sizeof(Vec3f) * count || !fits(frame.zone_of()) ||
      !fits(frame.strain_energy())) {
    return false;
  }
  arrays->position_m = Values<Vec3f>(frame.positions());
  arrays->displacement_m.resize(count);
  for (std::size_t p = 0; p < count; ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      arrays->displacement_m[p][axis] = arrays->position_m[p][axis] - surface.rest_m[p][axis];
    }
  }
  arrays->zone = Values<std::int32_t>(frame.zone_of());
  if (arrays->zone.empty()) arrays->zone.assign(count, -1);
  arrays->strain_energy_j = Values<float>(frame.strain_energy());
  arrays->strain_energy_j.resize(count);
  arrays->contact_force_n.assign(count, Vec3f{});
  struct ContactForce {
    std::uint32_t particle;
    Vec3f force_n;
  };
  for (const ContactForce& contact : Values<ContactForce>(frame.contact_forces())) {
    if (contact.particle >= count) return false;
    arrays->contact_force_n[contact.particle] = contact.force_n;
  }
  return true;
}

std::string PolyData(const Surface& surface, const FrameArrays& arrays) {
  std::vector<std::int32_t> ends(surface.triangles.size() / 3);
  for (std::size_t i = 0; i < ends.size(); ++i) ends[i] = static_cast<std::int32_t>(3 * (i + 1));
  AppendedData data;
  std::string xml = absl::StrFormat(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n"
      "<Piece NumberOfPoints=\"%d\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
      "NumberOfPolys=\"%d\">\n<PointData Vectors=\"displacement\">\n",
      surface.rest_m.size(), ends.size());
  xml += data.Add("displacement", "Float32", 3, arrays.displacement_m);
  xml += data.Add("contact_force", "Float32", 3, arrays.contact_force_n);
  xml += data.Add("zone", "Int32", 1, arrays.zone);
  xml += data.Add("strain_energy", "Float32", 1, arrays.strain_energy_j);
  xml += "</PointData>\n<Points>\n";
  xml += data.Add("position", "Float32", 3, arrays.position_m);
  xml += "</Points>\n<Polys>\n";
  xml += data.Add("connectivity", "Int32", 1, surface.triangles);
  xml += data.Add("offsets", "Int32", 1, ends);
  xml += "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
  return absl::StrCat(xml, data.bytes(), "\n</AppendedData>\n</VTKFile>\n");
}

absl::Status WriteFile(const fs::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("'", path.string(), "': cannot be written"));
}

// Writes the files of an export one after the other.
class Exporter {
 public:
  explicit Exporter(const fs::path& pvd)
      : pvd_(pvd), folder_(pvd.parent_path() / absl::StrCat(pvd.stem().string(), "_frames")) {}

  absl::Status Begin() {
    std::error_code error;
    fs::create_directories(folder_, error);
    if (fs::is_directory(folder_)) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("'", folder_.string(), "': no directory can be made there"));
  }
  // `time_ns`: since the recording began.
  absl::Status Add(const std::string& poly_data, std::uint64_t time_ns) {
    const fs::path file = folder_ / absl::StrFormat("%06d.vtp", frames_++);
    absl::StrAppendFormat(&entries_, "<DataSet timestep=\"%.9g\" file=\"%s\"/>\n", 1e-9 * time_ns,
                          (folder_.filename() / file.filename()).string());
    return WriteFile(file, poly_data);
  }
  absl::Status End() const {
    return WriteFile(pvd_, absl::StrCat("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" "
                                        "version=\"1.0\" byte_order=\"LittleEndian\">\n"
                                        "<Collection>\n",
                                        entries_, "</Collection>\n</VTKFile>\n"));
  }
  std::uint64_t frames() const { return frames_; }

 private:
  const fs::path pvd_, folder_;
  std::string entries_;
  std::uint64_t frames_ = 0;
};

absl::Status Refuse(const std::string& recording, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("'", recording, "': ", what));
}

}  // namespace

absl::StatusOr<ExportResult> ExportParaView(const std::string& recording, const std::string& pvd,
                                            const std::atomic<bool>& stop) {
  absl::StatusOr<std::unique_ptr<McapReader>> reader = McapReader::Open(recording);
  if (!reader.ok()) return reader.status();
  const absl::StatusOr<RecordingBeginning> beginning = ReadBeginning(**reader, recording);
  if (!beginning.ok()) return beginning.status();
  // The name goes into XML, and its end decides what ParaView makes of it.
  const std::string name = fs::path(pvd).filename().string();
  if (!name.ends_with(".pvd") || name.find_first_of("<>&\"'") != name.npos) {
    return Refuse(pvd, "the name of an export ends in .pvd and has no quotes, '<', '>' or '&'");
  }
  Exporter exporter(pvd);
  if (absl::Status status = exporter.Begin(); !status.ok()) return status;
  ExportResult result;
  std::optional<Surface> surface;
  McapMessage message;
  v1::WatchResponse view;
  FrameArrays arrays;
  while (!result.interrupted) {
    const absl::StatusOr<bool> more = (*reader)->Next(&message);
    if (!more.ok()) return more.status();
    if (!*more) break;
    const auto channel = (*reader)->channels().find(message.channel);
    if (channel == (*reader)->channels().end()) continue;
    const std::string& topic = channel->second.topic;
    if (topic != kTopologyTopic && topic != kFramesTopic) continue;
    result.interrupted = stop.load();
    const bool decoded =
        view.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()));
    if (topic == kTopologyTopic && decoded) {
      absl::StatusOr<Surface> read = ReadSurface(view.topology());
      if (!read.ok()) return Refuse(recording, std::string(read.status().message()));
      surface = *std::move(read);
    } else if (surface && decoded && ReadFrame(view.frame(), *surface, &arrays)) {
      const std::string bytes = PolyData(*surface, arrays);
      if (absl::Status status = exporter.Add(bytes, message.log_time); !status.ok()) return status;
    } else {
      result.damage.push_back({message.offset, "a frame that cannot be read", {}, {}});
    }
  }
  if (!surface) return Refuse(recording, "it has no topology");
  if (absl::Status status = exporter.End(); !status.ok()) return status;
  result.frames = exporter.frames();
  result.truncated_at = (*reader)->truncated_at();
  const std::vector<McapDamage>& damage = (*reader)->damage();
  result.damage.insert(result.damage.begin(), damage.begin(), damage.end());
  return result;
}

}  // namespace adhesim
