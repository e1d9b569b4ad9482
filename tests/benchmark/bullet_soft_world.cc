#include "tests/benchmark/bullet_soft_world.h"

#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace adhesim::bench {
namespace {

constexpr btScalar kMarginM = 0.03f;

btVector3 ToBullet(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

// Flags of the bodies that an effect acts on: those it names, or all.
template <typename Names>
std::vector<std::uint8_t> ActsOn(const Model& model, const Names& names) {
  std::vector<std::uint8_t> flags;
  for (const Body& body : model.bodies) {
    flags.push_back(names.empty() ||
                    std::find(names.begin(), names.end(), body.scene_name) != names.end());
  }
  return flags;
}

}  // namespace

struct BulletSoftWorld::Bullet {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<std::unique_ptr<btSoftBody>> bodies;

  ~Bullet() {
    for (auto& body : bodies) world.removeSoftBody(body.get());
  }
};

std::unique_ptr<BulletSoftWorld> BulletSoftWorld::Create(const Model& model) {
  const auto rigid = [](const Body& body) { return body.rigid || body.all_fixed; };
  if (!model.tools.empty() || std::any_of(model.bodies.begin(), model.bodies.end(), rigid)) {
    return nullptr;
  }
  return std::unique_ptr<BulletSoftWorld>(new BulletSoftWorld(model));
}

BulletSoftWorld::BulletSoftWorld(const Model& model)
    : model_(model), bullet_(std::make_unique<Bullet>()) {
  btSoftBodyWorldInfo& info = bullet_->world.getWorldInfo();
  info.air_density = 0;
  info.water_density = 0;
  info.m_gravity.setZero();
  info.m_sparsesdf.Initialize();
  bullet_->world.setGravity(btVector3(0, 0, 0));
  for (const Body& body : model.bodies) AddBody(body);
  ReadFields();
}

BulletSoftWorld::~BulletSoftWorld() = default;

void BulletSoftWorld::AddBody(const Body& body) {
  const int first = body.first_particle;
  std::vector<btVector3> position;
  std::vector<btScalar> mass;
  for (int p = first; p < first + body.particle_count; ++p) {
    position.push_back(ToBullet(model_.rest_position_m[p]));
    mass.push_back(model_.fixed[p] ? 0 : static_cast<btScalar>(model_.mass_kg[p]));
  }
  auto soft = std::make_unique<btSoftBody>(&bullet_->world.getWorldInfo(), body.particle_count,
                                           position.data(), mass.data());
  soft->m_materials[0]->m_kLST = body.closed ? 0.45f : 0.9f;
  std::set<std::pair<int, int>> edges;
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model_.triangles[t];
    for (int k = 0; k < 3; ++k) edges.insert(std::minmax(tri[k] - first, tri[(k + 1) % 3] - first));
    soft->appendFace(tri[0] - first, tri[1] - first, tri[2] - first);
  }
  for (const auto& [a, b] : edges) soft->appendLink(a, b);
  // As Bullet's own mesh helper does by default; a link that follows its neighbour waits for it,
  // and unshuffled the position solver takes half as long again.
  soft->randomizeConstraints();
  soft->m_cfg.piterations = 10;
  soft->m_cfg.kDP = 0.005f;
  soft->m_cfg.kDF = 0.3f;
  soft->m_cfg.collisions = btSoftBody::fCollision::VF_SS | btSoftBody::fCollision::SDF_RS;
  if (body.closed) {
    soft->m_cfg.kVC = 20;
    soft->setPose(true, false);
  }
  soft->getCollisionShape()->setMargin(kMarginM);
  for (int p = 0; p < body.particle_count; ++p) {
    if (mass[p] > 0) soft->m_nodes[p].m_v = ToBullet(model_.initial_velocity_m_s[first + p]);
  }
  bullet_->world.addSoftBody(soft.get());
  bullet_->bodies.push_back(std::move(soft));
}

void BulletSoftWorld::ReadFields() {
  for (const v1::Effect& effect : model_.scene.effects()) {
    if (effect.has_uniform_gravity()) {
      const auto& gravity = effect.uniform_gravity();
      const Vec3 g(gravity.acceleration_m_s2().data());
      if (gravity.bodies().empty()) {
        bullet_->world.getWorldInfo().m_gravity += ToBullet(g);  // Bullet's own
      } else {
        fields_.push_back({ActsOn(model_, gravity.bodies()), false, g, Vec3::Zero(), 0, 0});
      }
    } else if (effect.has_attraction()) {
      const auto& pull = effect.attraction();
      fields_.push_back({ActsOn(model_, pull.bodies()), true, Vec3::Zero(),
                         Vec3(pull.point_m().data()), pull.acceleration_m_s2(),
                         pull.core_radius_m()});
    } else if (effect.has_drag()) {
      frictions_.push_back({ActsOn(model_, effect.drag().bodies()), effect.drag().rate_per_s()});
    }
  }
}

void BulletSoftWorld::AddFieldForces() {
  for (std::size_t b = 0; b < bullet_->bodies.size(); ++b) {
    btSoftBody::tNodeArray& nodes = bullet_->bodies[b]->m_nodes;
    for (const Field& field : fields_) {
      if (!field.acts_on[b]) continue;
      const btVector3 uniform = ToBullet(field.acceleration_m_s2), point = ToBullet(field.point_m);
      const btScalar size = static_cast<btScalar>(field.size_m_s2),
                     core = static_cast<btScalar>(field.core_radius_m);
      for (int i = 0; i < nodes.size(); ++i) {
        btSoftBody::Node& node = nodes[i];
        if (!(node.m_im > 0)) continue;
        const btVector3 towards = point - node.m_x;
        node.m_f +=
            (field.to_point ? towards * (size / std::max(towards.length(), core)) : uniform) /
            node.m_im;
      }
    }
    for (const Friction& friction : frictions_) {
      if (!friction.acts_on[b]) continue;
      const btScalar rate = static_cast<btScalar>(friction.rate_per_s);
      for (int i = 0; i < nodes.size(); ++i) {
        if (nodes[i].m_im > 0) nodes[i].m_f -= nodes[i].m_v * (rate / nodes[i].m_im);
      }
    }
  }
}

void BulletSoftWorld::Step() {
  AddFieldForces();
  bullet_->world.stepSimulation(static_cast<btScalar>(model_.dt_s), 0);
}

int BulletSoftWorld::contacts() const {
  int count = 0;
  for (const auto& body : bullet_->bodies) count += body->m_scontacts.size();
  return count;
}

bool BulletSoftWorld::finite() const {
  double sum = 0;
  for (const auto& body : bullet_->bodies) {
    for (int i = 0; i < body->m_nodes.size(); ++i) {
      for (int k = 0; k < 3; ++k) sum += body->m_nodes[i].m_x[k];
    }
  }
  return std::isfinite(sum);
}

}  // namespace adhesim::bench
