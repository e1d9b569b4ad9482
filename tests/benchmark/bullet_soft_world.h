#pragma once

#include <memory>

#include "core/model/model.h"

namespace adhesim::bench {

// A model's bodies as Bullet's soft bodies: the same particles, triangles and masses, under the
// same fields. Bullet has no adhesion: its bodies collide and part.
//
// Settings are those of Bullet's own demo of volume-preserving bodies (SoftDemo): ten position
// iterations, links along the edges of stiffness 0.45 (0.9 on open sheets), closed bodies hold
// their volume (kVC 20), vertices collide with faces (VF_SS | SDF_RS) at a margin of 0.03 m,
// friction 0.3, and its own damping of 0.005 a step. Single precision, as Debian builds it.
class BulletSoftWorld {
 public:
  // Null when the model has what Bullet's soft bodies are not compared in: tools or rigid bodies.
  static std::unique_ptr<BulletSoftWorld> Create(const Model& model);
  ~BulletSoftWorld();

  // One step of Model::dt_s.
  void Step();
  // Vertex-face contacts of the last step.
  int contacts() const;
  bool finite() const;

 private:
  struct Bullet;
  explicit BulletSoftWorld(const Model& model);
  void AddBody(const Body& body);
  void ReadFields();
  void AddFieldForces();

  // An acceleration of some bodies: uniform, or towards a point.
  struct Field {
    std::vector<std::uint8_t> acts_on;  // [#bodies]
    bool to_point;
    Vec3 acceleration_m_s2, point_m;
    double size_m_s2, core_radius_m;
  };
  struct Friction {
    std::vector<std::uint8_t> acts_on;  // [#bodies]
    double rate_per_s;
  };

  const Model& model_;
  std::vector<Field> fields_;
  std::vector<Friction> frictions_;
  std::unique_ptr<Bullet> bullet_;
};

}  // namespace adhesim::bench
