#pragma once

#include <memory>
#include <vector>

#include "core/contact/adhesive.h"
#include "core/contact/detector.h"
#include "core/contact/overlap.h"
#include "core/contact/zone_builder.h"
#include "core/effects/registry.h"
#include "core/engine/engine.h"
#include "core/engine/frame_writer.h"
#include "core/engine/freeze_cause.h"
#include "core/engine/sleeping.h"
#include "core/engine/stage_clock.h"
#include "core/engine/state_hash.h"
#include "core/engine/tool_contacts.h"
#include "core/solve/force_error.h"
#include "core/solve/implicit_solver.h"
#include "core/solve/ledger.h"
#include "core/solve/subspace_solver.h"
#include "core/solve/tool_system.h"
#include "core/tools/coupling.h"
#include "core/tools/tool_set.h"

namespace adhesim {

// The engine: a scene's effects compiled into stages. A sub-step is detect, zones, forces, tools,
// solve (which may let go and try again), book, move. What a scene does not name is a null pointer
// or an empty array here.
class Pipeline : public Engine {
 public:
  static absl::StatusOr<std::unique_ptr<Engine>> Compile(std::shared_ptr<const Model> model,
                                                         const Options& options);

  StepReport Step(std::span<const ToolInput> tools) override;
  std::span<const FidelityRung> rungs() const override { return rungs_; }
  void SetFidelity(int rungs) override;
  int fidelity() const override { return fidelity_; }
  const Model& model() const override { return *model_; }
  const State& state() const override { return state_; }
  bool frozen() const override { return frozen_; }
  std::string FrozenBecause() const override {
    return frozen_ ? WhyNotFinite(*model_, state_) : "";
  }
  int substeps() const override { return substeps_; }
  void Reset() override { Restore(start_); }
  void Restore(const State& state) override;
  Frame MakeFrame() const override;
  void WriteFrame(Frame* frame) const override;
  std::uint64_t StateHash() const override { return HashState(state_); }
  double MechanicalEnergy() const override;
  double KeptEnergy() const override;
  double CaptureImpulse(int tool) const override { return capture_impulse_ns_[tool]; }
  std::span<const Stage> stages() const override { return clock_.stages(); }
  void TimeStages(std::size_t capacity) override { clock_.Enable(capacity); }

 private:
  Pipeline(std::shared_ptr<const Model> model, const Options& options)
      : model_(std::move(model)), parallel_(options.threads, options.simd) {}
  absl::Status CompileEffects();
  absl::Status CompileImplicit();
  std::vector<const Effect*> RowsOnTissue() const;
  void CompileContact();
  absl::Status CompileRungs();
  absl::Status CompileTools();
  absl::Status CompileSleep();
  absl::Status ChooseSubsteps();
  void NameStages();
  Engine::Stage EffectStage(std::size_t effect) const;
  void MakeStartState();

  // What tools do to what closes in: their velocities, and how fast their ends turn about the tips.
  struct ToolMotion {
    Aabb velocities;
    double turning_m_s = 0;
  };
  Twist ComingTwist(int tool) const;
  ToolMotion ComingToolMotion() const;
  double PartsByClosing(double time_s, std::span<const Vec3> velocity_m_s, const ToolMotion& tools,
                        double most_m, double enough);
  double PartsByTurning(double time_s, std::span<const Vec3> velocity_m_s, double most_rad) const;
  int SubstepsNow();
  int Permitted(double wanted);
  void DivideRest(int substeps);
  bool MovesTooFar();
  // Visits (particle, its place seen from the tip) of all that the tool's zone carries.
  template <typename Visit>
  void ForEachCarried(int tool, const Visit& visit) const {
    for (const Zone& zone : state_.contacts.zones) {
      if (zone.tool != tool) continue;
      for (int k = zone.first; k < zone.first + zone.count; ++k) {
        const int p = state_.contacts.zone_members[k];
        visit(p, Vec3(state_.position_m[p] - state_.tools[tool].pose.position_m));
      }
    }
  }
  // Of what the tool's zone carries, about the tip.
  Mat6 CarriedInertia(int tool) const;
  Vec6 CarriedMomentum(int tool) const;
  void MeetTools();
  void SetTargets(std::span<const ToolInput> tools);
  void Substep();
  bool TrySubstep(double dt_s);
  void Separate();
  void RegainVolumes();
  void DetectAndCapture(double dt_s);
  void ScaleStrengths();
  void FindNearEdges() {
    std::span<const std::int32_t> moves_with;
    if (adhesive_) moves_with = adhesive_->MovesWith(state_.contacts);
    near_edges_ = detector_->FindEdges(state_.position_m, moves_with, &parallel_, &report_);
    zones_parted_ = false;
  }
  void RenewZones(bool meets_tools);
  // Which lists of what is near a sub-step makes anew; the other one is of the sub-step before.
  struct Search {
    bool particles, edges;
  };
  Search NextSearch();
  void EndSliding();
  std::span<const Aabb> ToolBoxes();
  void Wake();
  void FallAsleep();
  void LeaveOutSleepers();
  // What solvers keep is not of the state to come.
  void Forget();
  // Where anything is implicit, all sleep or none: then nothing is assembled or solved.
  bool StepsImplicitly() const { return implicit_ && state_.sleep.bodies == 0; }
  void RestoreSleep();
  double AddAllForces();
  void EvaluateForces();
  struct EnergyNow {
    double mechanical_j = 0;
    double elastic_w = 0;  // power of the elastic forces
  };
  EnergyNow Energies() const;
  void MoveTools(double dt_s);
  void FollowAgainstForces(int tool, double dt_s);
  bool MoveWithTissue(double dt_s);
  void BoundToolForces(double dt_s);
  Twist Unobstructed(int tool, Twist twist, double dt_s);
  Twist NotIntoHeldTissue(int tool, const Twist& aim);
  bool GiveWay(double dt_s);
  void KeepToolsApart(double dt_s);
  bool Solve(double dt_s);
  ImplicitSolver::Forces AllForces() {
    return {{force_n_[0], force_n_[1], force_n_[2], force_n_[3]}, total_force_n_};
  }
  bool IsImplicit(const Effect& effect) const { return implicit_ && effect.has_stiffness(); }
  bool Finite() const;

  std::shared_ptr<const Model> model_;
  mutable Parallel parallel_;
  State state_, start_;
  bool frozen_ = false;
  bool has_forces_ = false;  // those of the last sub-step belong to `state_`
  int substeps_ = 1;         // at least
  bool springs_ = false;     // some effect is elastic and explicit
  // Of a step: sub-steps done and in all, how long they are, and what time is left.
  int made_ = 0, to_make_ = 0;
  double substep_dt_s_ = 0, left_s_ = 0;
  std::vector<FidelityRung> rungs_;  // by order; what each does is told by its name
  int fidelity_ = 0;
  bool search_in_turns_ = false;  // permitted by the fidelity
  bool slow_ = false;             // two sub-steps bring nothing nearer than one may
  bool searched_ = false;         // both lists are of this state or the one before
  bool edges_next_ = false;
  bool old_lists_ = false;  // one of them is of the one before
  StepReport report_;

  std::vector<std::unique_ptr<Effect>> effects_;
  bool strengths_scale_ = false;         // one of them scales strengths
  std::vector<int> effect_state_first_;  // [#effects] into State::effect_state
  std::unique_ptr<Detector> detector_;   // null without contact
  double contact_distance_m_ = 0;        // the smallest at which anything feels a contact
  std::unique_ptr<Adhesive> adhesive_;
  std::unique_ptr<Overlap> overlap_;  // null without an adhesive
  std::vector<Vec3> before_m_;        // [#particles] empty without that and volumes
  std::unique_ptr<ZoneBuilder> zone_builder_;
  std::unique_ptr<Sleeping> sleeping_;  // null where nothing may sleep
  std::unique_ptr<ToolSet> tool_set_;   // null without tools
  std::unique_ptr<ToolContacts> tool_contacts_;
  std::unique_ptr<SubspaceSolver> solver_;
  std::unique_ptr<ImplicitSolver> implicit_;  // null where every force is explicit
  // Null without tools or implicit forces.
  std::unique_ptr<ForceError> force_error_;
  std::unique_ptr<ToolSystem> tool_system_;
  std::unique_ptr<FrameWriter> frame_writer_;
  bool tools_can_collide_ = false;  // obstacles, or more than one tool

  // Scratch.
  std::array<std::vector<Vec3>, kForceKinds>
      force_n_;                           // [#particles] each; empty: no effect adds that kind
  std::vector<Vec3> total_force_n_;       // [#particles]
  std::vector<Vec3> implicit_damping_n_;  // [#particles] goes unused: implicit steps find their own
  std::vector<Twist> tool_twist_;         // [#tools] for the coming sub-step
  std::vector<Twist> last_twist_;         // [#tools] before it
  std::vector<Pose> tool_pose_;           // [#tools]
  std::vector<Mat6> own_inertia_;         // [#tools] these three of tools that move with tissue
  std::vector<CouplingLaw> coupling_law_;
  std::vector<ToolSystem::Law> tool_law_;
  std::vector<Wrench> tool_impulse_, coupling_impulse_;  // [#tools] over the step
  std::vector<Wrench> coupling_now_;                     // [#tools] of it, in the coming sub-step
  std::vector<double> capture_impulse_ns_;               // [#tools] see CaptureImpulse
  std::vector<ForceError::Bar> error_bar_;  // [#tools] mean over the step; empty likewise
  std::vector<double> strength_scale_;      // [#tools]
  std::vector<std::uint8_t> retracted_;     // [#tools]
  std::vector<std::uint32_t> tool_flags_;   // [#tools] before tools moved
  std::vector<Aabb> tool_box_;              // [#tools] of those that may touch
  std::vector<double> strain_energy_j_;     // [#particles] of what falls asleep
  std::span<const NearPair> near_;          // of this sub-step
  std::span<const NearEdges> near_edges_;   // of this sub-step
  bool zones_parted_ = false;               // zones have lost members since near_edges_ were found
  std::span<const Adhesive::NearTool> near_tools_;  // of this sub-step

  StageClock clock_;
  std::vector<int> effect_stage_;         // [#effects], -1: it is part of others
  std::vector<std::string> effect_path_;  // [#effects] in the scene
  std::string adhesive_path_;             // likewise
  // What compiling took from the heap; of effects with their state and force arrays.
  struct StageBytes {
    std::vector<std::size_t> effects;
    std::size_t detect = 0, zones = 0, tools = 0, solve = 0, error = 0, sleep = 0, book = 0;
  } bytes_;
  int detect_stage_ = 0, zones_stage_ = 0, tools_stage_ = 0, solve_stage_ = 0, error_stage_ = 0,
      sleep_stage_ = 0, book_stage_ = 0;
};

}  // namespace adhesim
