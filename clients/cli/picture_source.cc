#include "clients/cli/picture_source.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <optional>
#include <utility>

#include "adhesim/v1/view_service.pb.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/record_run.h"
#include "core/engine/engine.h"
#include "server/encode.h"
#include "server/recording/file_sink.h"
#include "server/recording/mcap_reader.h"
#include "server/recording/mcap_writer.h"
#include "server/recording/recording_format.h"
#include "server/session.h"

namespace adhesim {
namespace {

// Writes frames of an engine into a recording.
class InstantWriter {
 public:
  InstantWriter(ByteSink sink, const Engine& engine)
      : dt_s_(engine.model().dt_s), writer_(std::move(sink), "", "adhesim " ADHESIM_VERSION) {
    RecordingAbout about;
    about.version = ADHESIM_VERSION;
    about.build = BuildText();
    about.scene_name = engine.model().name;
    about.rate_hz = 1 / dt_s_;
    channels_ = WriteBeginning(about, engine.model().scene, {}, &writer_);
    v1::WatchResponse message;
    EncodeTopology(engine.model(), message.mutable_topology());
    writer_.AddMessage(channels_.topology, 0, message.SerializeAsString());
    frame_.newest_pose.resize(engine.model().tools.size());
    frame_.target_jumps.resize(engine.model().tools.size());
  }

  void Write(const Engine& engine) {
    engine.WriteFrame(&frame_.frame);
    v1::WatchResponse message;
    message.set_step(frame_.frame.step);
    message.set_time_s(frame_.frame.time_s);
    EncodeFrame(frame_, {v1::POSITION_ENCODING_FLOAT32, true}, message.mutable_frame());
    writer_.AddMessage(channels_.frames, LogTime(frame_.frame.step, dt_s_),
                       message.SerializeAsString());
  }

  absl::Status Finish() {
    writer_.Finish();
    return writer_.status();
  }

 private:
  const double dt_s_;
  McapWriter writer_;
  RecordingChannels channels_{};
  SessionFrame frame_;
};

}  // namespace

bool IsMcap(const std::string& path) {
  constexpr char kMagic[] = "\x89MCAP0\r\n";
  char bytes[8] = {};
  std::ifstream(path, std::ios::binary).read(bytes, sizeof(bytes));
  return std::equal(bytes, bytes + sizeof(bytes), kMagic);
}

absl::Status RecordInstants(const std::string& scene, const std::vector<std::string>& settings,
                            std::vector<double> times_s, const std::string& file,
                            const std::function<bool()>& stop) {
  const std::optional<LoadedScene> loaded = LoadScene(scene, settings);
  if (!loaded) return absl::InvalidArgumentError(absl::StrCat(scene, " cannot be used"));
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(loaded->model, Engine::Options());
  if (!engine.ok()) return absl::InvalidArgumentError(engine.status().message());
  absl::StatusOr<ByteSink> sink = OpenFileSink(file, true);
  if (!sink.ok()) return sink.status();

  std::sort(times_s.begin(), times_s.end());
  InstantWriter writer(*std::move(sink), **engine);
  writer.Write(**engine);
  std::int64_t step = 0;
  for (const double time_s : times_s) {
    const std::int64_t wanted = std::llround(time_s / loaded->model->dt_s);
    const bool written = wanted == step;
    for (; step < wanted; ++step) {
      if (stop()) return absl::CancelledError("interrupted");
      (*engine)->Step({});
      if (!(*engine)->frozen()) continue;
      return absl::InternalError(absl::StrCat("the state became non-finite in step ", step + 1));
    }
    if (!written) writer.Write(**engine);
  }
  return writer.Finish();
}

absl::StatusOr<double> LastFrameTime(const std::string& file) {
  absl::StatusOr<std::unique_ptr<McapReader>> reader = McapReader::Open(file);
  if (!reader.ok()) return reader.status();
  const absl::StatusOr<RecordingBeginning> beginning = ReadBeginning(**reader, file);
  if (!beginning.ok()) return beginning.status();
  std::optional<double> last_s;
  McapMessage message;
  while (true) {
    const absl::StatusOr<bool> more = (*reader)->Next(&message);
    if (!more.ok()) return more.status();
    if (!*more) break;
    const auto channel = (*reader)->channels().find(message.channel);
    if (channel == (*reader)->channels().end() || channel->second.topic != kFramesTopic) continue;
    last_s = std::max(last_s.value_or(0), static_cast<double>(message.log_time) * 1e-9);
  }
  if (last_s) return *last_s;
  return absl::InvalidArgumentError(absl::StrCat(file, " holds no frames"));
}

}  // namespace adhesim
