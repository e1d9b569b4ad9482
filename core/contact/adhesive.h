#pragma once

#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/contact/detector.h"
#include "core/contact/patches.h"
#include "core/contact/rigid_interfaces.h"
#include "core/model/bond_geometry.h"
#include "core/model/carried.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/state.h"
#include "core/model/tie_geometry.h"

namespace adhesim {

// When the virtual adhesive takes hold and when it lets go (Carra et al. 2007, 4.2.2, made
// well-posed as in the physics notes 3.3). It edits bonds; what moves together follows from them
// (ZoneBuilder).
//
// Capture: a pair nearer than d_on that approaches, or is inside, becomes a bond: the particle and
// those corners of the triangle with a weight above kMinWeight. So do edges, unless their ends move
// as one already: then nothing can bring them nearer. Release: with lambda_i the force
// that the adhesive must carry on a colliding particle and n_i the normal from the opposing body to
// its own, in tension (lambda_n > 0) it lets go when
//   (lambda_n / (sigma_n A_i))^2 + (|lambda_t| / (sigma_t A_i))^2 > 1,
// in compression never. With `kappa_adh`, sigma A_i is replaced by kappa m_i / dt_ref^2.
// Hysteresis: a pair that let go is not captured again before its gap has exceeded d_off, unless it
// is pressed closer than it was when it let go.
// Patches (patch_size_m) let go as wholes instead: the resultant of what one carries on one body's
// particles against the sum of their strengths (notes 3.3, item 9), also where the last look at a
// step has made one zone of several. A crack then runs a patch at a time: its size is the patch's.
// A bond of which only a part still holds ends where its contact points are further apart than
// d_off: a far corner says nothing about a contact that is gone.
// With a Bell rate, one in tension also lets go by chance.
// With ties, bonds between deformable bodies make no zones: the particle of the finer mesh is tied
// to a point of the other's triangle (TieGeometry), and lets go by itself, under what the tie
// carries. With friction, a new contact slides (ContactRows) until friction has stopped it, and in
// compression (lambda_n <= 0) a particle that sticks slides when |lambda_t| > sigma_t A_i + mu
// |lambda_n|.
class Adhesive {
 public:
  static constexpr double kMinWeight = 0.05;

  explicit Adhesive(const Model& model);

  // Bonds and released pairs of bodies that sleep stay as they are.
  void LeaveOut(const Sleep* sleep) { sleep_ = sleep; }

  // [#particles] the zone of those particles whose edges need no looking at against edges of the
  // same zone: nothing brings them nearer, and no end waits for having been further apart. -1: of
  // all others.
  std::span<const std::int32_t> MovesWith(const Contacts& contacts);

  // The pairs with their sides told by winding numbers where a particle seems to be inside a closed
  // body: one that is outside sees the back of a surface that has folded over, and that is to be
  // kept off like a sheet. One that is inside makes the contacts `overlapping`.
  std::span<const NearPair> TellInside(std::span<const NearPair> near,
                                       std::span<const Vec3> position_m, Contacts* contacts);

  // Removes bonds of what is inside a body, which is moved out of it: Capture() makes them anew
  // where it goes deeper. Returns their number.
  static int DropInside(Contacts* contacts);

  // Drops released pairs that have been further apart than d_off, then bonds the pairs that meet
  // the capture rule. Returns the number of changes. `dt_s` scales what counts as approaching.
  int Capture(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
              const State& state, double dt_s, Contacts* contacts, StepReport* report);

  // Bonds whatever a trial step to `moved_m` [#particles] would carry through, or almost onto, the
  // other surface, whether it let go before or not: capture looks at where things are and how fast
  // before forces, volumes and other zones have had their say. These stick, even where contacts
  // begin by sliding. Returns the number of changes.
  int CaptureCrossing(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
                      const State& state, std::span<const Vec3> moved_m, Contacts* contacts,
                      StepReport* report);

  // Renews where sliding bonds touch, drops those that are further apart than d_off, and makes
  // those that friction has stopped stick. Returns the number of changes.
  int FollowSliding(std::span<const NearPair> near, double time_s, Contacts* contacts);
  // What became of the sliding bonds in the sub-step just done, by bond: see ContactRows.
  void EndSliding(int bond, bool held, bool parted, Contacts* contacts);
  // Removes the bonds that parted.
  int RemoveParted(Contacts* contacts);

  // A triangle near a tool; `normal` points from the tool to the tissue.
  struct NearTool {
    std::int32_t tool, triangle;
    Vec3 weights;
    Vec3 normal;
    double gap_m;
    bool approaching;
    bool sticky;
  };
  // The same for tools; `near` ascending by (tool, triangle), with every triangle within d_off.
  int CaptureByTools(std::span<const NearTool> near, const State& state, Contacts* contacts,
                     StepReport* report);

  // m: by how much a trial step to `moved_m` [#particles] and `moved_tool` would bring the triangle
  // nearer to the tool than it may come; 0: it may.
  double ComesNearer(const NearTool& pair, const State& state, std::span<const Vec3> moved_m,
                     const Pose& moved_tool) const;
  // CaptureCrossing() for tools, which move to `moved_tool` [#tools]: capture looked at the motion
  // that they had before their couplings moved them.
  int CaptureCrossingByTools(std::span<const NearTool> near, const State& state,
                             std::span<const Vec3> moved_m, std::span<const Pose> moved_tool,
                             Contacts* contacts, StepReport* report);

  // FollowSliding() for tools: renews where bonds that slide on them touch, drops those that are
  // further apart than d_off, and makes those that friction has stopped stick.
  int FollowSlidingOnTools(std::span<const NearTool> near, const State& state, Contacts* contacts);

  // True when the tool cannot take the particle along: it is fixed, or in a zone that is held by
  // fixed particles or by another tool. Such a particle stops the tool instead, and pushes it.
  bool HeldAgainst(int tool, int particle, const Contacts& contacts) const;
  // True when the tool moves the particle: it, or something that carries it, is in the tool's zone.
  bool HeldBy(int tool, int particle, const Contacts& contacts) const;
  // The same of the triangle: of a corner of some weight.
  bool HeldAgainst(const NearTool& near, const Contacts& contacts) const;
  bool HeldBy(int tool, const NearTool& near, const Contacts& contacts) const;

  // Ties what sticks by ties and is not tied yet, where it is now. After every change of bonds.
  void Tie(std::span<const Vec3> position_m, Contacts* contacts) const;

  // Releases every colliding particle whose load [#particles, N] exceeds its strength
  // (`strength_scale` [#tools] multiplies that of tools' bonds), and those that chance takes in
  // `chance_s` seconds (0: chance has spoken already). Likewise every tie, by its own load. Writes
  // Zone::load. Returns the number that let go or began to slide.
  int Release(std::span<const Vec3> load_n, std::span<const TieLoad> tie_load, const State& state,
              std::span<const double> strength_scale, double chance_s, Contacts* contacts);
  // Lets go of everything a tool holds.
  int ReleaseTool(int tool, Contacts* contacts);

 private:
  struct Limit {      // of one colliding particle
    Vec3 normal_sum;  // of its bonds, from the opposing side to its own
    double normal_n;  // forces that its bonds carry
    double shear_n;
    bool may_slide;
    bool bonded;
    bool released;
    bool slides;
    double friction = 0;  // Coulomb's coefficient
  };
  // Load over strength: above 1 it gives way, by sliding or by letting go.
  struct Demand {
    double ratio;
    bool slides;
    bool pulled;  // in tension
  };
  // Whether a particle, or something that carries it, is what is asked for.
  template <typename Is>
  bool ItOrItsCarriers(int particle, const Is& is) const {
    if (is(particle)) return true;
    const CarriedParticle* c = carried_.Find(particle);
    for (int k = 0; c && k < 4; ++k) {
      if (c->weights[k] != 0 && is(c->carriers[k])) return true;
    }
    return false;
  }
  // Whether a corner that has some weight is.
  template <typename Is>
  bool ACornerIs(const NearTool& near, const Is& is) const {
    for (int k = 0; k < 3; ++k) {
      if (near.weights(k) > kMinWeight && is(model_.triangles[near.triangle][k])) return true;
    }
    return false;
  }
  // What bonds are sorted by; the last is the triangle's edge of an edge's bond.
  static std::tuple<int, int, int, int, int> Key(const Bond& bond);
  static bool KeyLess(const Bond& a, const Bond& b) { return Key(a) < Key(b); }
  // The tool in ReleasedPair::other.
  static int ToolKey(int tool) { return -1 - tool; }
  void CollectLimits(const State& state, std::span<const double> strength_scale,
                     const Contacts& contacts);
  void DropReleased(std::span<const NearPair> near, std::span<const NearEdges> near_edges,
                    Contacts* contacts);
  int DropApart(std::span<const Vec3> position_m, Contacts* contacts) const;
  void ListEdgeEnds(std::span<const NearEdges> near);
  int CaptureEdges(std::span<const NearEdges> near, const State& state, double still_m_s,
                   Contacts* contacts, StepReport* report);
  Bond BondOf(const NearEdges& near, const State& state) const;
  Bond BondOf(const NearPair& near, double time_s) const;
  // From one gap to the other, a trial step comes too near.
  bool Approaches(double gap_m, double then_m) const;
  bool Crosses(const Bond& bond, const State& state, std::span<const Vec3> moved_m) const;
  bool MoveAsOne(const Contacts& contacts, int triangle, const Vec3& weights, int first,
                 int second) const;
  bool MoveAsOne(const Contacts& contacts, const NearPair& pair) const {
    return MoveAsOne(contacts, pair.triangle, pair.weights, pair.particle, pair.particle);
  }
  // Bonds that the last look at a trial step made join patches no more. Returns their number.
  static int CutAgain(Contacts* contacts);
  int HoldWhole(Bond bond, Contacts* contacts, StepReport* report) const;
  // Adds the bond, or to that of the same features what it has more. True if anything is new.
  static bool Hold(Bond bond, Contacts* contacts, StepReport* report);
  static bool Insert(const Bond& bond, Contacts* contacts, StepReport* report);
  bool IsBonded(const NearPair& pair, const Contacts& contacts) const;
  bool LetGo(int particle, int other, double gap_m, const Contacts& contacts) const;
  // Corners and ends with a weight above this become members. What a lighter one does is of no
  // consequence at first, but may bring the surfaces nearer in time.
  double LeastWeight(double gap_m) const {
    return gap_m < 0.5 * capture_distance_m_ ? 0 : kMinWeight;
  }
  bool LetGoBefore(const Bond& bond, const Contacts& contacts) const;
  static bool InOneZone(const Bond& bond, const Contacts& contacts);
  void Limits(int particle, const Bond& bond, const Vec3& normal, double scale);
  void Bear(int tool, const BondLimit& one, double scale, Limit* limit) const;
  Demand DemandOn(const Limit& limit, const Vec3& load) const;
  int ReleaseParticles(std::span<const Vec3> load_n, double chance_s, const Contacts& contacts,
                       Zone* zone);
  bool LetsGoInPatches(const Zone& zone) const {
    return !patches_.empty() && zone.tool < 0 && zone.rigid_body < 0;
  }
  void CollectPatches(const Contacts& contacts);
  int ReleasePatches(std::span<const Vec3> load_n, double chance_s, Contacts* contacts);
  bool TakenByChance(int who, const Demand& demand, const Vec3& load, double chance_s,
                     const Contacts& contacts) const;
  std::pair<std::int32_t, std::int32_t> BodiesOf(const Bond& bond) const;  // ascending
  // Sliding ends when friction has held for so many sub-steps: one at the brink of sliding is slow
  // for a few as well.
  static constexpr int kCalm = 10;
  // Contacts begin by sliding.
  bool slides() const { return model_.adhesive->friction_coefficient.has_value(); }
  void ShowMembers(Bond* bond) const;
  Bond BondOf(const NearTool& near, const State& state, const Contacts& contacts) const;
  void RemoveReleased(Contacts* contacts);
  void MeasureMeshes();
  bool Ties(int body, int other) const;
  bool TiesParticlesOf(int body, int other) const;
  bool IsTied(int particle, int body, const Contacts& contacts) const;
  int ReleaseTies(std::span<const TieLoad> loads, const State& state, double chance_s,
                  const Contacts& contacts);
  Vec3 BondNormal(const Bond& bond, const State& state) const;
  void AddReleased(int particle, int other, double gap_m, Contacts* contacts);
  const ReleasedPair* FindReleased(const Contacts& contacts, int particle, int other) const;

  // Of a particle's body; null: nothing sleeps.
  bool Sleeps(int particle) const { return sleep_ && sleep_->Of(model_.body_of[particle]); }
  // What holds one that sleeps is held by it, or by what is fixed.
  bool Sleeps(const Bond& bond) const {
    return sleep_ && sleep_->bodies > 0 && bond.tool < 0 &&
           (Sleeps(bond.particle) || Sleeps(model_.triangles[bond.triangle][0]));
  }

  const Model& model_;
  const Sleep* sleep_ = nullptr;
  double capture_distance_m_ = 0;
  double release_distance_m_ = 0;
  std::vector<double> mesh_area_m2_;  // [#bodies]
  std::vector<Limit> limit_;          // [#particles]
  Patches patches_;
  struct Patch {                // of one zone and one body
    std::int32_t first, count;  // into patch_members_
    double area_m2;
  };
  std::vector<Patch> patch_list_;
  std::vector<std::int32_t> patch_members_;
  std::vector<double> crack_area_m2_;  // [#particles] of what lets go with it: the crack's step
  RigidInterfaces rigid_;
  CarriedLookup carried_;
  enum : std::uint8_t { kHolds, kLetsGo, kSlides };
  std::vector<std::uint8_t> bond_verdict_;  // [#bonds] of rigid interfaces
  std::vector<std::uint8_t> touched_;       // [#particles x #tools] within d_off of the tool
  std::vector<NearPair> told_;              // see TellInside
  std::vector<std::int32_t> moves_with_;    // see MovesWith
  std::vector<ReleasedPair> kept_;
  std::vector<std::pair<std::int32_t, std::int32_t>> calm_;  // bodies, ascending
  std::vector<std::pair<std::int32_t, std::int32_t>>
      edge_near_;  // (particle, body) of ends of edges within d_off; ascending
};

}  // namespace adhesim
