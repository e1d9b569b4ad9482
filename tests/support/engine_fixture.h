#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "core/engine/engine.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"

namespace adhesim::test {

inline std::shared_ptr<const Model> ModelOf(const SceneFile& file) {
  EXPECT_TRUE(file.ok()) << file.Format(file.problems);
  BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  EXPECT_TRUE(built.model) << file.Format(file.Located(built.problems));
  return built.model;
}

// A scene given as YAML text.
inline SceneFile SceneFileOf(const std::string& yaml) {
  SceneFile file = ParseScene(yaml, "test.yaml", ADHESIM_SOURCE_DIR);
  EXPECT_TRUE(file.ok()) << file.Format(file.problems);
  return file;
}

inline std::shared_ptr<const Model> ModelOf(const std::string& yaml) {
  return ModelOf(SceneFileOf(yaml));
}

inline std::unique_ptr<Engine> EngineOf(std::shared_ptr<const Model> model, int threads = 1,
                                        Simd simd = BestSimd()) {
  auto engine = Engine::Create(std::move(model), {.threads = threads, .simd = simd});
  EXPECT_TRUE(engine.ok()) << engine.status();
  return *std::move(engine);
}

inline std::unique_ptr<Engine> EngineOf(const std::string& yaml, int threads = 1) {
  return EngineOf(ModelOf(yaml), threads);
}

// A scene of the repository, by its path below scenes/.
inline std::unique_ptr<Engine> SceneEngine(const std::string& path, int threads = 1) {
  return EngineOf(ModelOf(ReadSceneFile(ADHESIM_SOURCE_DIR "/scenes/" + path)), threads);
}

// Steps with every tool on its trajectory; returns the union of the report bits.
inline std::uint32_t StepMany(Engine* engine, int steps) {
  std::uint32_t bits = 0;
  for (int k = 0; k < steps; ++k) bits |= engine->Step({}).bits;
  return bits;
}

// Likewise; captures and releases of all those steps.
struct ContactCounts {
  int captures = 0, releases = 0;
};
inline ContactCounts CountContacts(Engine* engine, int steps) {
  ContactCounts counts;
  for (int k = 0; k < steps; ++k) {
    const StepReport report = engine->Step({});
    counts.captures += report.captures;
    counts.releases += report.releases;
  }
  return counts;
}

}  // namespace adhesim::test
