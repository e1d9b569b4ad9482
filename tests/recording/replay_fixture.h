#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "server/recording/file_sink.h"
#include "server/recording/recorder.h"
#include "server/recording/replay.h"

namespace adhesim::test {

inline std::shared_ptr<Recorder> RecordInto(const std::string& path, const Engine& engine,
                                            const std::vector<SceneAsset>& assets = {}) {
  const Model& model = engine.model();
  const RecordingAbout about{"test", "test", "s1", model.name, 1 / model.dt_s, model.seed};
  return std::make_shared<Recorder>(*OpenFileSink(path, false), Recorder::Options{}, about, assets,
                                    engine);
}

inline ReplayResult Verify(const std::string& path, int threads = 1) {
  const absl::StatusOr<ReplayResult> result = Replay(path, {.verify = true, .threads = threads});
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *result : ReplayResult();
}

}  // namespace adhesim::test
