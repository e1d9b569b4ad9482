#include "clients/cli/bullet_tissue.h"

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableGravityForce.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <absl/strings/str_cat.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/model/tissue.h"
#include "core/scene/field_value.h"

namespace adhesim {
namespace {

constexpr double kBodySize = 3;            // of its smallest tissue, in Bullet's units
constexpr double kDemoFriction = 2;        // of a body; that of a pair is their product
constexpr double kSheetThicknessM = 0.02;  // of obstacles without any, away from what may hit them

btVector3 ToBullet(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

Vec3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

// Bullet's own numbers (tolerances, 0.5 N/m of a repulsion) are made for bodies of a few metres
// and about a kilogram, and cubes of centimetres fall through what others rest on. So the smallest
// tissue is made such a one; times stay.
struct Units {
  double length_m = 1, mass_kg = 1;
};

Units UnitsOf(const Model& model) {
  Units units{std::numeric_limits<double>::infinity(), 0};
  for (const Body& body : model.bodies) {
    if (body.tetrahedron_count == 0 || body.size_m / kBodySize >= units.length_m) continue;
    units = {body.size_m / kBodySize, 0};
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      units.mass_kg += model.mass_kg[p];
    }
  }
  return units;
}

// What the effects of a scene say, as far as Bullet has it: one set of moduli and of damping for
// all bodies, but stiffness in proportion to the tetrahedra's share (below).
struct Effects {
  std::string unknown;               // the first that Bullet does not have
  std::optional<Material> material;  // of the first tetrahedron
  double stiffness_damping_s = 0, drag_per_s = 0;
  Vec3 gravity_m_s2 = Vec3::Zero();
  // [#tetrahedra] Young's modulus and filled part over those of the first: the factor of what
  // Bullet takes for its volume, which is all that forces know of it.
  std::vector<double> share;
};

void ReadElasticity(const Model& model, const v1::Elasticity& elasticity, Effects* effects) {
  const bool first = !effects->material;
  const double damping_s = elasticity.stiffness_damping_s();
  if (elasticity.model() == v1::ELASTIC_MODEL_NEO_HOOKEAN) {
    effects->unknown = "its neo-Hookean law is not ours";
  } else if (!first && damping_s != effects->stiffness_damping_s) {
    effects->unknown = "it has one damping of stiffness for all bodies";
  }
  effects->stiffness_damping_s = damping_s;
  for (const std::int32_t t : TetrahedraOf(elasticity, model)) {
    const Material material = MaterialOf(elasticity, model, t);
    if (!effects->material) effects->material = material;
    if (material.poisson_ratio != effects->material->poisson_ratio) {
      effects->unknown = "it has one Poisson's ratio for all bodies";
    }
    effects->share[t] =
        model.fill[t] * material.young_modulus_pa / effects->material->young_modulus_pa;
  }
}

Effects EffectsOf(const Model& model) {
  Effects effects;
  effects.share.assign(model.tetrahedra.size(), 0);
  for (const v1::Effect& effect : model.scene.effects()) {
    if (effect.has_elasticity()) {
      ReadElasticity(model, effect.elasticity(), &effects);
    } else if (effect.has_uniform_gravity() && effect.uniform_gravity().bodies().empty()) {
      effects.gravity_m_s2 += Vec3Of(effect.uniform_gravity(), "acceleration_m_s2");
    } else if (effect.has_drag() && effect.drag().bodies().empty()) {
      effects.drag_per_s += NumberOf(effect.drag(), "rate_per_s");
    } else if (!effect.has_virtual_adhesive()) {
      effects.unknown = "it has none of this scene's effects beside elasticity, gravity and drag";
    }
  }
  return effects;
}

// Bullet builds its trees from links and never ends where a body falls apart.
bool Connected(const Model& model, const Body& body) {
  std::vector<int> group(body.particle_count);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int p) {
    while (group[p] != p) p = group[p] = group[group[p]];
    return p;
  };
  const auto join = [&](int a, int b) {
    group[root(a - body.first_particle)] = root(b - body.first_particle);
  };
  for (int t = 0; t < body.tetrahedron_count; ++t) {
    const Tetrahedron& tet = model.tetrahedra[body.first_tetrahedron + t];
    for (int k = 1; k < 4; ++k) join(tet[0], tet[k]);
  }
  for (int t = 0; t < body.triangle_count; ++t) {
    const Triangle& triangle = model.triangles[body.first_triangle + t];
    for (int k = 1; k < 3; ++k) join(triangle[0], triangle[k]);
  }
  for (int p = 1; p < body.particle_count; ++p) {
    if (root(p) != root(0)) return false;
  }
  return true;
}

const v1::Body& SceneBodyOf(const Model& model, const Body& body) {
  return *std::find_if(model.scene.bodies().begin(), model.scene.bodies().end(),
                       [&](const v1::Body& one) { return one.name() == body.scene_name; });
}

bool IsConvex(const Model& model, const Body& body) {
  const v1::Body& shape = SceneBodyOf(model, body);
  return shape.has_sheet() || shape.has_block();
}

// Of a convex body. A sheet becomes a plate whose far side is away from the tissue.
std::vector<Vec3> CornersOf(const Model& model, const Body& body) {
  const std::vector<Vec3>& rest = model.rest_position_m;
  std::vector<Vec3> corners(rest.begin() + body.first_particle,
                            rest.begin() + body.first_particle + body.particle_count);
  if (!SceneBodyOf(model, body).has_sheet()) return corners;
  Vec3 tissue = Vec3::Zero();
  for (std::size_t p = 0; p < rest.size(); ++p) {
    if (!model.fixed[p]) tissue += rest[p] - corners[0];
  }
  const Triangle& t = model.triangles[body.first_triangle];
  Vec3 back = (rest[t[1]] - rest[t[0]]).cross(rest[t[2]] - rest[t[0]]).normalized();
  if (back.dot(tissue) > 0) back = -back;
  for (int i = 0; i < body.particle_count; ++i) {
    corners.push_back(corners[i] + kSheetThicknessM * back);
  }
  return corners;
}

std::set<std::pair<int, int>> EdgesOf(const Model& model, const Body& body) {
  std::set<std::pair<int, int>> edges;
  const auto add = [&](const auto& corners) {
    for (std::size_t a = 0; a < corners.size(); ++a) {
      for (std::size_t b = a + 1; b < corners.size(); ++b) {
        edges.insert(
            std::minmax(corners[a] - body.first_particle, corners[b] - body.first_particle));
      }
    }
  };
  for (int t = 0; t < body.tetrahedron_count; ++t) {
    add(model.tetrahedra[body.first_tetrahedron + t]);
  }
  for (int t = 0; t < body.triangle_count; ++t) add(model.triangles[body.first_triangle + t]);
  return edges;
}

}  // namespace

struct BulletTissue::World {
  Units unit;
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver bodies_solver;
  btDeformableMultiBodyConstraintSolver solver;
  btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration,
                                           &bodies_solver};
  std::unique_ptr<btDeformableGravityForce> gravity;
  std::unique_ptr<btDeformableLinearElasticityForce> elasticity;
  struct Tissue {
    const Body* body;
    std::unique_ptr<btSoftBody> soft;
  };
  std::vector<Tissue> tissues;
  struct Obstacle {
    std::unique_ptr<btConvexHullShape> shape;
    std::unique_ptr<btRigidBody> rigid;
  };
  std::vector<Obstacle> obstacles;

  ~World() {
    for (Tissue& tissue : tissues) world.removeSoftBody(tissue.soft.get());
    for (Obstacle& obstacle : obstacles) world.removeRigidBody(obstacle.rigid.get());
  }
};

std::string BulletTissue::WhyNot(const Model& model) {
  if (!model.tools.empty())
    return "its tools follow no coupling of limited force, and do not stick";
  if (!model.carried.empty())
    return "its bodies touch with their tetrahedra, not with a surface "
           "that they carry";
  if (std::all_of(model.bodies.begin(), model.bodies.end(),
                  [](const Body& body) { return body.tetrahedron_count == 0; })) {
    return "it has no shape memory, only links whose stiffness depends on the step";
  }
  for (const Body& body : model.bodies) {
    if (body.all_fixed) {
      if (!IsConvex(model, body)) return "its obstacles are convex";
      continue;
    }
    if (body.rigid || body.tetrahedron_count == 0) return "a body is no tissue";
    if (!Connected(model, body)) return "a body falls apart into pieces";
  }
  if (std::any_of(model.initial_velocity_m_s.begin(), model.initial_velocity_m_s.end(),
                  [](const Vec3& v) { return v != Vec3::Zero(); })) {
    return "its implicit steps do not take velocities at the start";
  }
  return EffectsOf(model).unknown;
}

BulletTissue::BulletTissue(const Model& model, double dt_s, const BulletSettings& settings)
    : model_(model), dt_s_(dt_s), settings_(settings), world_(std::make_unique<World>()) {
  world_->unit = UnitsOf(model);
  world_->solver.setDeformableSolver(&world_->bodies_solver);
  btDeformableMultiBodyDynamicsWorld& world = world_->world;
  btSoftBodyWorldInfo& info = world.getWorldInfo();
  info.m_gravity.setZero();  // a force of its own, below
  info.air_density = 0;
  if (model.adhesive) {
    // Of the field of distances around obstacles: between its nodes it does not see what is
    // thinner.
    info.m_sparsesdf.setDefaultVoxelsz(static_cast<btScalar>(2 * margin()));
    info.m_sparsesdf.Reset();
  }
  world.setGravity(btVector3(0, 0, 0));
  world.setImplicit(settings.implicit);
  world.setLineSearch(false);
  world.setUseProjection(true);
  btContactSolverInfo& solver = world.getSolverInfo();
  solver.m_deformable_erp = 0.3f;
  solver.m_deformable_maxErrorReduction = 200;
  solver.m_leastSquaresResidualThreshold = 1e-3f;
  solver.m_splitImpulse = true;
  solver.m_numIterations = 100;
  // Deformable obstacles would do in Bullet what fixed nodes of a body that is hit do: take up
  // impulses, and move.
  for (const Body& body : model.bodies) body.all_fixed ? AddObstacle(body) : AddTissue(body);
  AddForces();
}

BulletTissue::~BulletTissue() = default;

void BulletTissue::AddObstacle(const Body& body) {
  World::Obstacle obstacle;
  obstacle.shape = std::make_unique<btConvexHullShape>();
  for (const Vec3& corner : CornersOf(model_, body)) {
    obstacle.shape->addPoint(ToBullet(corner / world_->unit.length_m));
  }
  obstacle.shape->setMargin(static_cast<btScalar>(margin()));
  obstacle.rigid = std::make_unique<btRigidBody>(
      btRigidBody::btRigidBodyConstructionInfo(0, nullptr, obstacle.shape.get()));
  obstacle.rigid->setFriction(static_cast<btScalar>(friction()));
  world_->world.addRigidBody(obstacle.rigid.get());
  world_->obstacles.push_back(std::move(obstacle));
}

// Those of two bodies add up to where ours touch.
double BulletTissue::margin() const {
  return model_.adhesive ? 0.5 * model_.adhesive->capture_distance_m / world_->unit.length_m : 0;
}

double BulletTissue::friction() const {
  const bool has = model_.adhesive && model_.adhesive->friction_coefficient;
  return has ? std::sqrt(*model_.adhesive->friction_coefficient) : kDemoFriction;
}

void BulletTissue::AddTissue(const Body& body) {
  const int first = body.first_particle;
  std::vector<btVector3> position;
  std::vector<btScalar> mass;
  for (int p = first; p < first + body.particle_count; ++p) {
    position.push_back(ToBullet(model_.rest_position_m[p] / world_->unit.length_m));
    mass.push_back(
        model_.fixed[p] ? 0 : static_cast<btScalar>(model_.mass_kg[p] / world_->unit.mass_kg));
  }
  auto soft = std::make_unique<btSoftBody>(&world_->world.getWorldInfo(), body.particle_count,
                                           position.data(), mass.data());
  for (int i = 0; i < soft->m_nodes.size(); ++i) soft->m_nodes[i].index = i;
  for (int t = 0; t < body.tetrahedron_count; ++t) {
    const Tetrahedron& tet = model_.tetrahedra[body.first_tetrahedron + t];
    soft->appendTetra(tet[0] - first, tet[1] - first, tet[2] - first, tet[3] - first);
  }
  for (const auto& [a, b] : EdgesOf(model_, body)) soft->appendLink(a, b);
  for (int t = 0; t < body.triangle_count; ++t) {
    const Triangle& triangle = model_.triangles[body.first_triangle + t];
    soft->appendFace(triangle[0] - first, triangle[1] - first, triangle[2] - first);
  }
  soft->initializeDmInverse();
  soft->m_tetraScratches.resize(soft->m_tetras.size());
  soft->m_tetraScratchesTn.resize(soft->m_tetras.size());
  soft->setActivationState(DISABLE_DEACTIVATION);
  soft->m_cfg.collisions = 0;
  if (model_.adhesive) {
    soft->m_cfg.collisions = btSoftBody::fCollision::VF_DD | btSoftBody::fCollision::SDF_RD |
                             btSoftBody::fCollision::SDF_RDN;
    soft->m_cfg.kKHR = soft->m_cfg.kCHR = 1;
    soft->m_cfg.kDF = static_cast<btScalar>(friction());
    soft->getCollisionShape()->setMargin(static_cast<btScalar>(margin()));
  }
  world_->world.addSoftBody(soft.get());
  world_->tissues.push_back({&body, std::move(soft)});
}

void BulletTissue::AddForces() {
  const Effects effects = EffectsOf(model_);
  World& w = *world_;
  w.gravity =
      std::make_unique<btDeformableGravityForce>(ToBullet(effects.gravity_m_s2 / w.unit.length_m));
  const double unit_pa = w.unit.mass_kg / w.unit.length_m;  // and seconds
  w.elasticity = std::make_unique<btDeformableLinearElasticityForce>(
      static_cast<btScalar>(effects.material->mu() / unit_pa),
      static_cast<btScalar>(effects.material->lambda() / unit_pa),
      static_cast<btScalar>(effects.drag_per_s),
      static_cast<btScalar>(effects.stiffness_damping_s));
  for (World::Tissue& tissue : w.tissues) {
    btSoftBody& soft = *tissue.soft;
    w.world.addForce(&soft, w.gravity.get());
    w.world.addForce(&soft, w.elasticity.get());
    for (int t = 0; t < soft.m_tetras.size(); ++t) {
      soft.m_tetras[t].m_element_measure *=
          static_cast<btScalar>(effects.share[tissue.body->first_tetrahedron + t]);
    }
  }
}

void BulletTissue::StartFrom(const std::vector<Vec3>& position_m) {
  for (World::Tissue& tissue : world_->tissues) {
    for (int i = 0; i < tissue.soft->m_nodes.size(); ++i) {
      btSoftBody::Node& node = tissue.soft->m_nodes[i];
      node.m_x = node.m_q =
          ToBullet(position_m[tissue.body->first_particle + i] / world_->unit.length_m);
      node.m_v.setZero();
      node.m_vn.setZero();
    }
  }
}

void BulletTissue::Step() {
  const auto dt_s = static_cast<btScalar>(dt_s_ / settings_.substeps);
  for (int k = 0; k < settings_.substeps; ++k) world_->world.stepSimulation(dt_s, 0);
}

int BulletTissue::contacts() const {
  int count = 0;
  for (const World::Tissue& tissue : world_->tissues) {
    const btSoftBody& soft = *tissue.soft;
    count += soft.m_faceNodeContacts.size() + soft.m_faceNodeContactsCCD.size() +
             soft.m_nodeRigidContacts.size();
  }
  return count;
}

void BulletTissue::Read(std::vector<Vec3>* position_m, std::vector<Vec3>* velocity_m_s) const {
  const double length_m = world_->unit.length_m;
  *position_m = model_.rest_position_m;  // of obstacles
  velocity_m_s->assign(model_.rest_position_m.size(), Vec3::Zero());
  for (const World::Tissue& tissue : world_->tissues) {
    const btSoftBody::tNodeArray& nodes = tissue.soft->m_nodes;
    for (int i = 0; i < nodes.size(); ++i) {
      (*position_m)[tissue.body->first_particle + i] = length_m * FromBullet(nodes[i].m_x);
      (*velocity_m_s)[tissue.body->first_particle + i] = length_m * FromBullet(nodes[i].m_v);
    }
  }
}

const char* BulletTissue::version() {
  static const std::string text =
      absl::StrCat("Bullet ", BT_BULLET_VERSION / 100, ".", BT_BULLET_VERSION % 100);
  return text.c_str();
}

const char* BulletTissue::settings_text() {
  return "deformable bodies of the same particles, tetrahedra, masses, gravity and drag, "
         "corotational with the same moduli, in units in which the smallest body is of 3 m and "
         "1 kg; single precision; one Newton step solved by conjugate gradients in the projected "
         "space to Bullet's own bound, deformable_erp 0.3, 100 contact iterations, no line "
         "search, no sleeping";
}

}  // namespace adhesim
