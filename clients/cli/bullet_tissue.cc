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
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/model/tissue.h"
#include "core/scene/field_value.h"

namespace adhesim {
namespace {

constexpr double kDemoFriction = 2;  // of a body; that of a pair is their product

btVector3 ToBullet(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

Vec3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

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
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver bodies_solver;
  btDeformableMultiBodyConstraintSolver solver;
  btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration,
                                           &bodies_solver};
  std::unique_ptr<btDeformableGravityForce> gravity;
  std::unique_ptr<btDeformableLinearElasticityForce> elasticity;
  std::vector<std::unique_ptr<btSoftBody>> bodies;
  std::vector<int> first_particle;  // [#bodies] of the model

  ~World() {
    for (auto& body : bodies) world.removeSoftBody(body.get());
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
    if (body.all_fixed) continue;
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
  world_->solver.setDeformableSolver(&world_->bodies_solver);
  btDeformableMultiBodyDynamicsWorld& world = world_->world;
  btSoftBodyWorldInfo& info = world.getWorldInfo();
  info.m_gravity.setZero();  // a force of its own, below
  info.air_density = 0;
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
  // Those that move first: Bullet's guess of where contacts will be counts no fixed nodes, and is
  // of the wrong node behind them.
  for (const bool fixed : {false, true}) {
    for (const Body& body : model.bodies) {
      if (body.all_fixed == fixed) AddBody(body);
    }
  }
  AddForces();
}

BulletTissue::~BulletTissue() = default;

void BulletTissue::AddBody(const Body& body) {
  const int first = body.first_particle;
  std::vector<btVector3> position;
  std::vector<btScalar> mass;
  for (int p = first; p < first + body.particle_count; ++p) {
    position.push_back(ToBullet(model_.rest_position_m[p]));
    mass.push_back(model_.fixed[p] ? 0 : static_cast<btScalar>(model_.mass_kg[p]));
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
    soft->m_cfg.collisions = btSoftBody::fCollision::VF_DD | btSoftBody::fCollision::SDF_RD;
    soft->m_cfg.kKHR = soft->m_cfg.kCHR = 1;
    const std::optional<double>& friction = model_.adhesive->friction_coefficient;
    soft->m_cfg.kDF = static_cast<btScalar>(friction ? std::sqrt(*friction) : kDemoFriction);
    // Those of two bodies add up.
    soft->getCollisionShape()->setMargin(
        static_cast<btScalar>(0.5 * model_.adhesive->capture_distance_m));
  }
  world_->world.addSoftBody(soft.get());
  world_->bodies.push_back(std::move(soft));
  world_->first_particle.push_back(first);
}

void BulletTissue::AddForces() {
  const Effects effects = EffectsOf(model_);
  World& w = *world_;
  w.gravity = std::make_unique<btDeformableGravityForce>(ToBullet(effects.gravity_m_s2));
  w.elasticity = std::make_unique<btDeformableLinearElasticityForce>(
      static_cast<btScalar>(effects.material->mu()),
      static_cast<btScalar>(effects.material->lambda()), static_cast<btScalar>(effects.drag_per_s),
      static_cast<btScalar>(effects.stiffness_damping_s));
  for (auto& body : w.bodies) {
    w.world.addForce(body.get(), w.gravity.get());
    w.world.addForce(body.get(), w.elasticity.get());
  }
  std::size_t next = 0;
  for (const bool fixed : {false, true}) {
    for (const Body& body : model_.bodies) {
      if (body.all_fixed != fixed) continue;
      btSoftBody& soft = *w.bodies[next++];
      for (int t = 0; t < soft.m_tetras.size(); ++t) {
        soft.m_tetras[t].m_element_measure *=
            static_cast<btScalar>(effects.share[body.first_tetrahedron + t]);
      }
    }
  }
}

void BulletTissue::StartFrom(const std::vector<Vec3>& position_m) {
  for (std::size_t b = 0; b < world_->bodies.size(); ++b) {
    btSoftBody::tNodeArray& nodes = world_->bodies[b]->m_nodes;
    for (int i = 0; i < nodes.size(); ++i) {
      btSoftBody::Node& node = nodes[i];
      node.m_x = node.m_q = ToBullet(position_m[world_->first_particle[b] + i]);
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
  for (const auto& body : world_->bodies) count += body->m_faceNodeContacts.size();
  return count;
}

void BulletTissue::Read(std::vector<Vec3>* position_m, std::vector<Vec3>* velocity_m_s) const {
  position_m->resize(model_.rest_position_m.size());
  velocity_m_s->resize(model_.rest_position_m.size());
  for (std::size_t b = 0; b < world_->bodies.size(); ++b) {
    const btSoftBody::tNodeArray& nodes = world_->bodies[b]->m_nodes;
    for (int i = 0; i < nodes.size(); ++i) {
      (*position_m)[world_->first_particle[b] + i] = FromBullet(nodes[i].m_x);
      (*velocity_m_s)[world_->first_particle[b] + i] = FromBullet(nodes[i].m_v);
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
         "corotational with the same moduli; single precision; one Newton step solved by "
         "conjugate gradients in the projected space to Bullet's own bound, deformable_erp 0.3, "
         "100 contact iterations, no line search, no sleeping";
}

}  // namespace adhesim
