#pragma once

#include <absl/strings/str_cat.h>

#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/engine/engine.h"
#include "server/scene_source.h"

namespace adhesim {

// A stand-in for physics: one triangle that moves along x by a micrometre a step, and tools that
// are where they shall be and feel 1 N upwards times the strength that they are given. A scene
// named "freezes" becomes non-finite in step 5.
class FakeEngine : public Engine {
 public:
  static constexpr std::uint64_t kFreezeStep = 5;

  explicit FakeEngine(Model model) : model_(std::move(model)) { Reset(); }

  StepReport Step(std::span<const ToolInput> tools) override {
    if (frozen_) return {kStepNonFinite, 0, 0};
    ++state_.step;
    state_.time_s = state_.step * model_.dt_s;
    frozen_ = model_.name == "freezes" && state_.step == kFreezeStep;
    if (frozen_) return {kStepNonFinite, 0, 0};
    for (std::size_t i = 0; i < tools.size(); ++i) {
      ToolFrame& tool = tools_[i];
      tool.flags = 0;
      if (tools[i].has_target) {
        const double way_m = (tools[i].target.position_m - tool.target.position_m).norm();
        if (way_m > 0.5 * model_.dt_s) tool.flags |= kToolTargetJumped;
        tool.pose = tool.target = tools[i].target;
      }
      tool.tissue.force_n = Vec3(0, 0, tools[i].strength_scale);
      tool.colliding_particles = tools[i].retracted ? 0 : 3;
    }
    return {0, 1, 0};
  }

  const Model& model() const override { return model_; }
  const State& state() const override { return state_; }
  bool frozen() const override { return frozen_; }
  std::string FrozenBecause() const override { return frozen_ ? "a particle is nowhere" : ""; }
  int substeps() const override { return 1; }
  void Reset() override {
    state_ = State{};
    frozen_ = false;
    tools_.assign(model_.tools.size(), ToolFrame{});
  }
  void Restore(const State& state) override { state_ = state; }

  Frame MakeFrame() const override {
    Frame frame;
    frame.position_m.resize(3 * model_.rest_position_m.size());
    frame.zone_of.assign(model_.rest_position_m.size(), -1);
    frame.tools.resize(model_.tools.size());
    return frame;
  }
  void WriteFrame(Frame* frame) const override {
    frame->step = state_.step;
    frame->time_s = state_.time_s;
    for (std::size_t i = 0; i < model_.rest_position_m.size(); ++i) {
      const Vec3 p = model_.rest_position_m[i] + Vec3(1e-6 * state_.step, 0, 0);
      for (int axis = 0; axis < 3; ++axis) frame->position_m[3 * i + axis] = p[axis];
    }
    frame->tools = tools_;
  }
  std::uint64_t StateHash() const override { return state_.step; }
  double MechanicalEnergy() const override { return 0; }
  std::span<const Stage> stages() const override { return {}; }
  void TimeStages(std::size_t) override {}

 private:
  Model model_;
  State state_;
  std::vector<ToolFrame> tools_;
  bool frozen_ = false;
};

// One triangle, one needle "needle", one lancet "lancet".
inline Model FakeModel(const std::string& name = "fake", double rate_hz = 1000) {
  Model model;
  model.name = name;
  model.dt_s = 1 / rate_hz;
  model.rest_position_m = {Vec3(0, 0, 0), Vec3(0.1, 0, 0), Vec3(0, 0.2, 0)};
  model.triangles = {{0, 1, 2}};
  Body body;
  body.name = "tissue";
  body.particle_count = 3;
  body.triangle_count = 1;
  model.bodies = {body};
  model.tools.resize(2);
  model.tools[0].name = "needle";
  model.tools[0].shape = NeedleShape{0.12, 0.0015, 0.004};
  model.tools[1].name = "lancet";
  model.tools[1].shape = LancetShape{0.025, 0.006, 0.0006, 0.1, 0.003};
  return model;
}

// Offers "fake" and "freezes". A scene without bodies, or with a body without a name, does not
// build.
inline SceneSource FakeScenes() {
  SceneSource source;
  source.list = [] {
    return std::vector<OfferedScene>{{"fake", "A triangle."}, {"freezes", "It breaks."}};
  };
  source.read = [](const std::string& name) -> absl::StatusOr<ReadScene> {
    if (name != "fake" && name != "freezes") {
      return absl::NotFoundError(absl::StrCat("no scene \"", name, "\""));
    }
    ReadScene read;
    read.scene.set_name(name);
    read.scene.add_bodies()->set_name("tissue");
    return read;
  };
  source.build = [](const ReadScene& read, Problems* problems) -> std::unique_ptr<Engine> {
    const v1::Scene& scene = read.scene;
    if (scene.bodies().empty()) problems->push_back({"bodies", "none, at least one is required"});
    for (int i = 0; i < scene.bodies_size(); ++i) {
      if (scene.bodies(i).name().empty()) {
        problems->push_back({absl::StrCat("bodies[", i, "].name"), "missing, it is required"});
      }
    }
    if (!problems->empty()) return nullptr;
    return std::make_unique<FakeEngine>(
        FakeModel(scene.name(), scene.has_rate_hz() ? scene.rate_hz() : 1000));
  };
  return source;
}

}  // namespace adhesim
