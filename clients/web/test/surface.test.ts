import assert from "node:assert/strict";
import { test } from "node:test";
import { computeNormals, isClosed } from "../src/surface";

const kTetrahedron = new Uint32Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);

test("isClosed knows a tetrahedron from one that lacks a side or has one turned", () => {
  assert.equal(isClosed(kTetrahedron), true);
  assert.equal(isClosed(kTetrahedron.subarray(3)), false);
  const turned = kTetrahedron.slice();
  [turned[0], turned[1]] = [turned[1], turned[0]];
  assert.equal(isClosed(turned), false);
  assert.equal(isClosed(new Uint32Array()), false);
});

test("computeNormals points outward with length 1, at any size that a body may have", () => {
  for (const size of [1e-5, 1, 1e3]) {
    const position = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]).map((x) => x * size);
    const normals = new Float32Array(12);
    computeNormals(position, kTetrahedron, normals);
    for (let v = 0; v < 4; v++) {
      const [x, y, z] = normals.subarray(3 * v, 3 * v + 3);
      // A few roundings of float32.
      assert.ok(Math.abs(Math.hypot(x, y, z) - 1) < 1e-6);
      const outward = [0, 1, 2].reduce(
        (sum, axis) => sum + normals[3 * v + axis] * (position[3 * v + axis] - size / 4),
        0,
      );
      assert.ok(outward > 0);
    }
  }
});
