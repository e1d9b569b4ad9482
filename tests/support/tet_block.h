#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "core/model/model.h"
#include "core/scene/build_model.h"
#include "core/scene/mesh/topology.h"

namespace adhesim::test {

// A block of tetrahedra made by hand: its particles in rows along x, then y, then z.
struct TetBlock {
  std::array<int, 3> cells = {2, 2, 2};
  Vec3 size_m = {1, 1, 1};
  Vec3 origin_m = Vec3::Zero();  // its lowest corner
  bool six_a_cell = false;       // cells cut into six tetrahedra (all alike) instead of five
  double jitter = 0;             // inner particles strewn by up to this part of a cell, each axis
  double density_kg_m3 = 1000;
  double young_modulus_pa = 1000;  // of its effect `elasticity`
  double poisson_ratio = 0.3;
  v1::ElasticModel law = v1::ELASTIC_MODEL_COROTATIONAL;
  double stiffness_damping_s = 0;

  int ParticleAt(int i, int j, int k) const {
    return i + (cells[0] + 1) * (j + (cells[1] + 1) * k);
  }
};

// The tetrahedra of one cell as corners 0..7, whose bits are the steps along x, y and z; any
// orientation.
inline std::vector<std::array<int, 4>> CellTetrahedra(bool six, bool odd) {
  if (six) {
    return {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
  }
  // Neighbouring cells are mirror images, so that the diagonals of their common face agree.
  if (odd) return {{0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}};
  return {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}};
}

// The faces of the tetrahedra that only one of them has, seen from outside.
inline std::vector<Triangle> OuterFaces(const std::vector<Tetrahedron>& tetrahedra) {
  std::map<Triangle, Triangle> faces;  // by sorted corners
  for (const auto& [a, b, c, d] : tetrahedra) {
    for (const Triangle& face : {Triangle{a, c, b}, {a, b, d}, {a, d, c}, {b, c, d}}) {
      Triangle key = face;
      std::sort(key.begin(), key.end());
      if (const auto [other, is_new] = faces.emplace(key, face); !is_new) faces.erase(other);
    }
  }
  std::vector<Triangle> outer;
  for (const auto& [key, face] : faces) outer.push_back(face);
  return outer;
}

// The block as a model of one body "block" with one effect `elasticity`; the caller may change
// either (fix particles, set other constants) before an engine or an effect is made from it.
inline std::shared_ptr<Model> ModelOf(const TetBlock& block) {
  auto model = std::make_shared<Model>();
  const auto [nx, ny, nz] = block.cells;
  const Vec3 cell = block.size_m.cwiseQuotient(Vec3(nx, ny, nz));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-block.jitter, block.jitter);
  for (int k = 0; k <= nz; ++k) {
    for (int j = 0; j <= ny; ++j) {
      for (int i = 0; i <= nx; ++i) {
        Vec3 at(i, j, k);
        const bool inner = i > 0 && i < nx && j > 0 && j < ny && k > 0 && k < nz;
        if (inner && block.jitter > 0)
          at += Vec3(uniform(random), uniform(random), uniform(random));
        model->rest_position_m.push_back(block.origin_m + at.cwiseProduct(cell));
      }
    }
  }
  const std::vector<Vec3>& x = model->rest_position_m;
  const int n = model->particle_count();
  model->mass_kg.assign(n, 0);
  Body body;
  body.name = body.scene_name = "block";
  for (int k = 0; k < nz; ++k) {
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx; ++i) {
        for (const auto& corners : CellTetrahedra(block.six_a_cell, (i + j + k) % 2 != 0)) {
          Tetrahedron tet;
          for (int c = 0; c < 4; ++c) {
            tet[c] = block.ParticleAt(i + (corners[c] & 1), j + (corners[c] >> 1 & 1),
                                      k + (corners[c] >> 2));
          }
          const auto six_volumes = [&] {
            return (x[tet[1]] - x[tet[0]]).cross(x[tet[2]] - x[tet[0]]).dot(x[tet[3]] - x[tet[0]]);
          };
          if (six_volumes() < 0) std::swap(tet[2], tet[3]);
          for (int p : tet) model->mass_kg[p] += block.density_kg_m3 * six_volumes() / 24;
          body.rest_volume_m3 += six_volumes() / 6;
          model->tetrahedra.push_back(tet);
        }
      }
    }
  }
  const std::size_t tets = model->tetrahedra.size();
  model->fill.assign(tets, 1);
  model->tet_label.assign(tets, -1);
  model->tet_group.assign(tets, -1);
  model->triangles = OuterFaces(model->tetrahedra);
  model->area_m2.assign(n, 0);
  for (const auto& [a, b, c] : model->triangles) {
    const double area = AreaVector(x[a], x[b], x[c]).norm();
    for (int p : {a, b, c}) model->area_m2[p] += area / 3;
  }
  BuildConnectivity(model.get());
  model->initial_velocity_m_s.assign(n, Vec3::Zero());
  model->fixed.assign(n, 0);
  model->body_of.assign(n, 0);
  body.closed = true;
  body.particle_count = n;
  body.triangle_count = static_cast<int>(model->triangles.size());
  body.tetrahedron_count = static_cast<int>(tets);
  body.size_m = block.size_m.norm();
  model->bodies.push_back(body);

  model->name = "block";
  model->scene.add_bodies()->set_name("block");
  v1::Elasticity* elasticity = model->scene.add_effects()->mutable_elasticity();
  elasticity->set_young_modulus_pa(block.young_modulus_pa);
  elasticity->set_poisson_ratio(block.poisson_ratio);
  elasticity->set_model(block.law);
  elasticity->set_stiffness_damping_s(block.stiffness_damping_s);
  return model;
}

}  // namespace adhesim::test
