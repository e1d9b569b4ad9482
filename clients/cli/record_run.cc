#include "clients/cli/record_run.h"

#include <absl/strings/str_cat.h>

#include <iostream>
#include <utility>
#include <vector>

#include "core/model/simd.h"
#include "server/recording/file_sink.h"

namespace adhesim {

std::string BuildText() { return absl::StrCat(ADHESIM_BUILD, ", ", SimdTarget()); }

absl::StatusOr<std::unique_ptr<Recorder>> RecordRun(const std::string& path, double frames_hz,
                                                    const LoadedScene& scene,
                                                    const Engine& engine) {
  const Model& model = engine.model();
  const absl::StatusOr<std::vector<SceneAsset>> assets =
      ReadSceneAssets(model.scene, scene.file.directory);
  if (!assets.ok()) return assets.status();
  absl::StatusOr<ByteSink> sink = OpenFileSink(path, false);
  if (!sink.ok()) return sink.status();
  Recorder::Options options;
  options.frames_hz = frames_hz;
  options.warn = [](const std::string& what) {
    std::cerr << absl::StrCat("warning: ", what, "\n") << std::flush;
  };
  const RecordingAbout about{ADHESIM_VERSION, BuildText(),    "run",
                             model.name,      1 / model.dt_s, model.seed};
  return std::make_unique<Recorder>(*std::move(sink), options, about, *assets, engine);
}

}  // namespace adhesim
