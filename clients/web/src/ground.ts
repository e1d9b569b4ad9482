// A floor grid with round spacing, and the little cross of axes in a corner.

import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  LineBasicMaterial,
  LineSegments,
  Vector3,
  type Camera,
} from "three";
import { niceCeiling } from "./colour_map";

const kCells = 20;

/** Lines under the scene; `spacingM` is the distance between them. */
export class Ground {
  readonly lines = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({
      color: 0x808890,
      transparent: true,
      opacity: 0.28,
      depthWrite: false,
    }),
  );
  spacingM = 0;

  fit(box: Box3): void {
    const size = box.getSize(new Vector3());
    const centre = box.getCenter(new Vector3());
    // About twice the scene's width, in 20 cells of a round size.
    this.spacingM = niceCeiling(Math.max(size.x, size.y, size.z / 2, 1e-4) / (kCells / 2));
    const half = (this.spacingM * kCells) / 2;
    const snap = (value: number) => Math.round(value / this.spacingM) * this.spacingM;
    const cx = snap(centre.x);
    const cy = snap(centre.y);
    const z = box.min.z - 0.02 * size.z;
    const points: number[] = [];
    for (let i = 0; i <= kCells; i++) {
      const at = i * this.spacingM - half;
      points.push(cx - half, cy + at, z, cx + half, cy + at, z);
      points.push(cx + at, cy - half, z, cx + at, cy + half, z);
    }
    const position = new BufferAttribute(new Float32Array(points), 3);
    this.lines.geometry.setAttribute("position", position);
    this.lines.geometry.computeBoundingSphere();
  }

  dispose(): void {
    this.lines.geometry.dispose();
    this.lines.material.dispose();
  }
}

const kAxes: [string, Vector3, string][] = [
  ["x", new Vector3(1, 0, 0), "#d55e00"],
  ["y", new Vector3(0, 1, 0), "#009e73"],
  ["z", new Vector3(0, 0, 1), "#3d8fd1"],
];

/** Draws the directions of the world's axes into an SVG of 72 x 72 units. */
export function drawAxes(svg: SVGElement, camera: Camera): void {
  const turn = camera.quaternion.clone().invert();
  const parts = kAxes.map(([name, axis, colour]) => {
    const { x, y, z } = axis.clone().applyQuaternion(turn).multiplyScalar(24);
    const [ex, ey] = [(36 + x).toFixed(1), (36 - y).toFixed(1)];
    const [tx, ty] = [(36 + 1.3 * x).toFixed(1), (36 - 1.3 * y + 4).toFixed(1)];
    const text = `<text x="${tx}" y="${ty}" fill="${colour}" text-anchor="middle">${name}</text>`;
    return {
      z,
      svg: `<line x1="36" y1="36" x2="${ex}" y2="${ey}" stroke="${colour}" stroke-width="2"/>${text}`,
    };
  });
  parts.sort((a, b) => a.z - b.z);
  svg.innerHTML = parts.map((part) => part.svg).join("");
}
