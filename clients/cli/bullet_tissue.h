#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/model/model.h"

namespace adhesim {

// How Bullet is to step.
struct BulletSettings {
  bool implicit = true;  // elastic forces; damping always is
  int substeps = 1;      // of a step
};

// A model's tissue as deformable bodies of Bullet (btDeformableMultiBodyDynamicsWorld), to compare
// with: the same particles, tetrahedra, masses, gravity and drag, and Bullet's corotational linear
// elasticity with the same moduli and damping. Surfaces touch (vertices and faces, VF_DD) where
// the scene has an adhesive, at its capture distance; Bullet has no adhesion, so nothing sticks.
//
// Settings are those of Bullet's own demo of volumetric deformables: one Newton step, conjugate
// gradients in the projected space, deformable_erp 0.3, 100 contact iterations, friction 2 a body
// (where the scene has no coefficient), no sleeping. Obstacles are convex rigid bodies. Single
// precision, as Debian builds it.
class BulletTissue {
 public:
  // Why Bullet cannot express the scene, in words that end a sentence; empty: it can.
  static std::string WhyNot(const Model& model);

  // Of a model that WhyNot() has nothing against, and that outlives this; `dt_s` is that of a step.
  BulletTissue(const Model& model, double dt_s, const BulletSettings& settings);
  ~BulletTissue();

  // Puts particles elsewhere, at rest; what their shape is remains the model's.
  void StartFrom(const std::vector<Vec3>& position_m);
  void Step();
  // Vertex-face contacts of the last sub-step.
  int contacts() const;
  // [#particles], converted; non-finite where Bullet's are.
  void Read(std::vector<Vec3>* position_m, std::vector<Vec3>* velocity_m_s) const;

  static const char* version();        // "Bullet 3.24"
  static const char* settings_text();  // what is the same in every run, for reports

 private:
  struct World;
  void AddTissue(const Body& body);
  void AddObstacle(const Body& body);
  double margin() const;  // in Bullet's units
  double friction() const;
  void AddForces();

  const Model& model_;
  const double dt_s_;
  const BulletSettings settings_;
  std::unique_ptr<World> world_;
};

}  // namespace adhesim
