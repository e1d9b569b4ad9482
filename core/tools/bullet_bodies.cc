#include "core/tools/bullet_bodies.h"

#include <BulletCollision/NarrowPhaseCollision/btGjkEpa2.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

btVector3 ToBullet(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

Vec3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

btTransform ToBullet(const Pose& pose) {
  const Quat& q = pose.orientation;
  return btTransform(btQuaternion(static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()),
                                  static_cast<btScalar>(q.z()), static_cast<btScalar>(q.w())),
                     ToBullet(pose.position_m));
}

double HalfThickness(const ToolShape& shape) {
  if (const auto* needle = std::get_if<NeedleShape>(&shape)) return needle->radius_m;
  const auto& lancet = std::get<LancetShape>(shape);
  return std::min({lancet.blade_thickness_m / 2, lancet.blade_width_m / 2, lancet.handle_radius_m});
}

}  // namespace

struct ToolBody::Bullet {
  struct Part {
    std::unique_ptr<btConvexShape> shape;
    btTransform place;  // in the tool's frame
    int solid;          // that it is part of
  };
  std::vector<Part> parts;
  std::unique_ptr<btCompoundShape> compound = std::make_unique<btCompoundShape>(false);
  std::unique_ptr<btRigidBody> body;

  void Add(std::unique_ptr<btConvexShape> shape, const btTransform& place, int solid) {
    // Bullet's margin would round the shape off, or thicken it: surfaces here are the real ones.
    shape->setMargin(0);
    compound->addChildShape(place, shape.get());
    parts.push_back({std::move(shape), place, solid});
  }

  void Add(const Round& round, int solid) {
    const auto radius = static_cast<btScalar>(round.radius);
    const double cone = round.shoulder_z - round.apex_z;
    if (cone > 0) {
      // Bullet's cone stands on its base, half its height below its origin; ours on its tip: half a
      // turn about x.
      const btQuaternion half_turn(1, 0, 0, 0);
      Add(std::make_unique<btConeShapeZ>(radius, static_cast<btScalar>(cone)),
          btTransform(half_turn, ToBullet(Vec3(0, 0, round.apex_z + cone / 2))), solid);
    }
    const auto half_length = static_cast<btScalar>((round.end_z - round.shoulder_z) / 2);
    Add(std::make_unique<btCylinderShapeZ>(btVector3(radius, radius, half_length)),
        btTransform(btQuaternion::getIdentity(),
                    ToBullet(Vec3(0, 0, (round.shoulder_z + round.end_z) / 2))),
        solid);
  }

  void Add(const Blade& blade, int solid) {
    auto hull = std::make_unique<btConvexHullShape>();
    for (const Vec3& vertex : blade.vertices) hull->addPoint(ToBullet(vertex), false);
    hull->recalcLocalAabb();
    Add(std::move(hull), btTransform::getIdentity(), solid);
  }
};

ToolBody::ToolBody(const ToolShape& shape)
    : solids_(SolidsOf(shape)),
      reach_m_(0),
      half_thickness_m_(HalfThickness(shape)),
      bullet_(new Bullet) {
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i) {
    std::visit([&](const auto& solid) { bullet_->Add(solid, i); }, solids_[i]);
    const Aabb box = BoxOf(solids_[i]);
    const double across = std::max(box.max.x(), box.max.y());
    reach_m_ = std::max(reach_m_, std::sqrt(across * across + box.max.z() * box.max.z()));
  }
  btRigidBody::btRigidBodyConstructionInfo info(0, nullptr, bullet_->compound.get());
  bullet_->body = std::make_unique<btRigidBody>(info);
  bullet_->body->setCollisionFlags(bullet_->body->getCollisionFlags() |
                                   btCollisionObject::CF_KINEMATIC_OBJECT);
  bullet_->body->setActivationState(DISABLE_DEACTIVATION);
}

ToolBody::~ToolBody() = default;
ToolBody::ToolBody(ToolBody&&) noexcept = default;

Aabb ToolBody::BoxAt(const Pose& pose) const {
  Aabb box;
  for (const Solid& solid : solids_) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1.0, 1.0}) {
        box.Add(pose *
                SupportPoint(solid, pose.orientation.conjugate() * Vec3(sign * Vec3::Unit(axis))));
      }
    }
  }
  return box;
}

Vec3 ToolBody::BulletSupport(const Vec3& direction) const {
  Vec3 best = Vec3::Zero();
  double furthest = -std::numeric_limits<double>::infinity();
  const btVector3 d = ToBullet(direction.normalized());
  for (const Bullet::Part& part : bullet_->parts) {
    const btVector3 local =
        part.shape->localGetSupportingVertex(part.place.getBasis().transpose() * d);
    const Vec3 point = FromBullet(part.place * local);
    if (point.dot(direction) > furthest) {
      furthest = point.dot(direction);
      best = point;
    }
  }
  return best;
}

Vec3 ToolBody::OverlapDirection(int solid, const ToolBody& other, int other_solid,
                                const Pose& relative) const {
  const btTransform other_place = ToBullet(relative);
  const Solid& a = solids_[solid];
  const Solid& b = other.solids_[other_solid];
  // How far apart the solids are along a direction (negative: how far they must be moved).
  const auto gap = [&](const Vec3& n) {
    const Vec3 in_other = relative.orientation.conjugate() * n;
    return n.dot(relative * SupportPoint(b, -in_other)) - n.dot(SupportPoint(a, n));
  };
  const Vec3 between = relative * Vec3(0, 0, EndZ(b) / 2) - Vec3(0, 0, EndZ(a) / 2);
  Vec3 best = between.norm() > 0 ? Vec3(between.normalized()) : Vec3::UnitX();
  for (const Bullet::Part& mine : bullet_->parts) {
    for (const Bullet::Part& theirs : other.bullet_->parts) {
      if (mine.solid != solid || theirs.solid != other_solid) continue;
      btGjkEpaSolver2::sResults result;
      if (!btGjkEpaSolver2::Penetration(mine.shape.get(), mine.place, theirs.shape.get(),
                                        other_place * theirs.place, ToBullet(best), result)) {
        continue;
      }
      const Vec3 normal = FromBullet(result.normal).normalized();
      if (!normal.allFinite()) continue;
      for (const Vec3& n : {normal, Vec3(-normal)}) {
        if (gap(n) > gap(best)) best = n;
      }
    }
  }
  return best;
}

struct ObstacleBody::Bullet {
  std::vector<btScalar> points;  // [#points x 3] from the centre
  std::vector<int> indices;      // [#triangles x 3]
  std::unique_ptr<btTriangleIndexVertexArray> mesh;
  std::unique_ptr<btBvhTriangleMeshShape> shape;
};

ObstacleBody::ObstacleBody(std::span<const Vec3> points_m, std::span<const Triangle> triangles)
    : points_m_(points_m.begin(), points_m.end()),
      triangles_(triangles.begin(), triangles.end()),
      bullet_(new Bullet) {
  for (const Triangle& triangle : triangles_) {
    for (const int corner : triangle) {
      box_.Add(points_m_[corner]);
      bullet_->indices.push_back(corner);
    }
  }
  centre_m_ = 0.5 * (box_.min + box_.max);
  for (const Vec3& point : points_m_) {
    // Points that no triangle uses may lie anywhere; Bullet need not see where.
    const Vec3 local = point.cwiseMax(box_.min).cwiseMin(box_.max) - centre_m_;
    for (int axis = 0; axis < 3; ++axis)
      bullet_->points.push_back(static_cast<btScalar>(local[axis]));
  }
  bullet_->mesh = std::make_unique<btTriangleIndexVertexArray>(
      static_cast<int>(triangles_.size()), bullet_->indices.data(),
      static_cast<int>(3 * sizeof(int)), static_cast<int>(points_m_.size()), bullet_->points.data(),
      static_cast<int>(3 * sizeof(btScalar)));
  bullet_->shape = std::make_unique<btBvhTriangleMeshShape>(bullet_->mesh.get(), true);
}

ObstacleBody::~ObstacleBody() = default;
ObstacleBody::ObstacleBody(ObstacleBody&&) noexcept = default;

void ObstacleBody::ForEachTriangleNear(
    const Aabb& box, absl::FunctionRef<void(const TriangleCorners&)> visit) const {
  if (!box.Overlaps(box_)) return;
  struct Visitor : btTriangleCallback {
    Visitor(const ObstacleBody& owner, absl::FunctionRef<void(const TriangleCorners&)> visitor)
        : body(owner), visit(visitor) {}
    void processTriangle(btVector3*, int, int index) override {
      const Triangle& t = body.triangles_[index];
      visit({body.points_m_[t[0]], body.points_m_[t[1]], body.points_m_[t[2]]});
    }
    const ObstacleBody& body;
    absl::FunctionRef<void(const TriangleCorners&)> visit;
  } visitor(*this, visit);
  // Only the part of the box that the mesh fills, so that what Bullet sees is no larger than the
  // mesh; 1e-6 of the mesh covers the rounding of both to single precision.
  const Vec3 slack = 1e-6 * (box_.max - box_.min).array() + 1e-9;
  const Vec3 low = box.min.cwiseMax(box_.min) - centre_m_ - slack;
  const Vec3 high = box.max.cwiseMin(box_.max) - centre_m_ + slack;
  bullet_->shape->processAllTriangles(&visitor, ToBullet(low), ToBullet(high));
}

}  // namespace adhesim
