// Smooth normals of an indexed surface: each vertex's is the sum of its triangles' area vectors,
// normalised.

/**
 * Writes `normals` [3 x #vertices]; vertices of no triangle keep a zero normal. Allocates nothing.
 */
export function computeNormals(
  position: Float32Array,
  triangles: Uint32Array,
  normals: Float32Array,
): void {
  normals.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t];
    const b = 3 * triangles[t + 1];
    const c = 3 * triangles[t + 2];
    const ax = position[a];
    const ay = position[a + 1];
    const az = position[a + 2];
    const ux = position[b] - ax;
    const uy = position[b + 1] - ay;
    const uz = position[b + 2] - az;
    const vx = position[c] - ax;
    const vy = position[c + 1] - ay;
    const vz = position[c + 2] - az;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    normals[a] += nx;
    normals[a + 1] += ny;
    normals[a + 2] += nz;
    normals[b] += nx;
    normals[b + 1] += ny;
    normals[b + 2] += nz;
    normals[c] += nx;
    normals[c + 1] += ny;
    normals[c + 2] += nz;
  }
  for (let i = 0; i < normals.length; i += 3) {
    const x = normals[i];
    const y = normals[i + 1];
    const z = normals[i + 2];
    // Area vectors of millimetre triangles are about 1e-6 m^2; float32 squares of them are still
    // normal numbers.
    const length = Math.sqrt(x * x + y * y + z * z);
    if (length > 0) {
      normals[i] = x / length;
      normals[i + 1] = y / length;
      normals[i + 2] = z / length;
    }
  }
}
