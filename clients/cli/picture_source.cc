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
struct InstantWriter::Parts {
  Parts(ByteSink sink, const Engine& e)
      : engine(e),
        writer(std::move(sink), "", "adhesim " ADHESIM_VERSION),
        frame(MakeSessionFrame(e)) {}

  const Engine& engine;
  McapWriter writer;
  RecordingChannels channels{};
  SessionFrame frame;
};

InstantWriter::InstantWriter(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
InstantWriter::~InstantWriter() = default;

absl::StatusOr<std::unique_ptr<InstantWriter>> InstantWriter::Open(const std::string& file,
                                                                   const Engine& engine) {
  absl::StatusOr<ByteSink> sink = OpenFileSink(file, true);
  if (!sink.ok()) return sink.status();
  auto parts = std::make_unique<Parts>(*std::move(sink), engine);
  RecordingAbout about;
  about.version = ADHESIM_VERSION;
  about.build = BuildText();
  about.scene_name = engine.model().name;
  about.rate_hz = 1 / engine.model().dt_s;
  parts->channels = WriteBeginning(about, engine.model().scene, {}, &parts->writer);
  v1::WatchResponse message;
  EncodeTopology(engine.model(), message.mutable_topology());
  parts->writer.AddMessage(parts->channels.topology, 0, message.SerializeAsString());
  return std::unique_ptr<InstantWriter>(new InstantWriter(std::move(parts)));
}

void InstantWriter::Write() {
  Frame& frame = parts_->frame.frame;
  parts_->engine.WriteFrame(&frame);
  v1::WatchResponse message;
  message.set_step(frame.step);
  message.set_time_s(frame.time_s);
  EncodeFrame(parts_->frame, {v1::POSITION_ENCODING_FLOAT32, true}, message.mutable_frame());
  parts_->writer.AddMessage(parts_->channels.frames,
                            LogTime(frame.step, parts_->engine.model().dt_s),
                            message.SerializeAsString());
}

absl::Status InstantWriter::Finish() {
  parts_->writer.Finish();
  return parts_->writer.status();
}

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
  const absl::StatusOr<std::unique_ptr<InstantWriter>> writer = InstantWriter::Open(file, **engine);
  if (!writer.ok()) return writer.status();

  std::sort(times_s.begin(), times_s.end());
  (*writer)->Write();
  std::int64_t step = 0;
  for (const double time_s : times_s) {
    const std::int64_t wanted = std::llround(time_s / loaded->model->dt_s);
    const bool written = wanted == step;
    for (; step < wanted; ++step) {
      if (stop()) return absl::CancelledError("interrupted");
      (*engine)->Step({});
      if (!(*engine)->frozen()) continue;
      return absl::InternalError(absl::StrCat("frozen: ", (*engine)->FrozenBecause()));
    }
    if (!written) (*writer)->Write();
  }
  return (*writer)->Finish();
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
