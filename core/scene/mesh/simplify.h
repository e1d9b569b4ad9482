#pragma once

#include <absl/status/statusor.h>

#include "core/model/geometry.h"

namespace adhesim {

// Taubin's smoothing (1995): `rounds` times a step of +lambda and one of -mu towards the mean of
// the neighbours (pass-band: lambda 0.5, mu 0.53), which removes the steps of a lattice and keeps
// the volume to second order.
void SmoothTaubin(int rounds, TriangleMesh* mesh);

// Collapses edges of a closed manifold, the shortest first, until `target_vertices` are left or no
// edge may go; returns the vertices left. The new vertex is the edge's middle, moved along the
// normal to where the planes of the triangles that were there (their quadrics: Garland, Heckbert
// 1997) fit best: even triangles for the physics, and the shape kept. An edge stays when the
// surface would change its topology (link condition), a normal would turn over or a triangle would
// become a sliver.
int CollapseEdges(int target_vertices, TriangleMesh* mesh);

// A closed surface with exactly this many vertices, made by CollapseEdges. Errors: InvalidArgument
// when the surface is not a closed manifold, has fewer, or cannot lose that many and keep its
// shape.
absl::StatusOr<TriangleMesh> Decimated(const TriangleMesh& mesh, int vertices);

// Makes triangles more even without changing the shape: `rounds` times flips of edges whose
// opposite angles sum to more than 180 degrees (Delaunay) where the surface is nearly flat, then a
// step of each vertex, in its tangent plane, towards the mean of its neighbours.
void EvenTriangles(int rounds, TriangleMesh* mesh);

}  // namespace adhesim
