import assert from "node:assert/strict";
import { test } from "node:test";
import { Quaternion, Ray, Vector3 } from "three";
import {
  advance,
  dragRotation,
  pivot,
  planeMotion,
  shaftAxis,
  translate,
  wheelNotches,
  type TargetPose,
} from "../src/driving_math";

// Positions are fractions of a metre in double precision: 1e-12 m is round-off and nothing else.
const kRoundOffM = 1e-12;

function near(a: Vector3, b: Vector3): void {
  assert.ok(a.distanceTo(b) < kRoundOffM, `${a.toArray()} is not ${b.toArray()}`);
}

function tilted(): TargetPose {
  return {
    tip: new Vector3(0.01, -0.02, 0.03),
    orientation: new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), Math.PI / 2),
  };
}

test("planeMotion stays in the plane through the tip that faces the camera", () => {
  const eye = new Vector3(0, 0, 1);
  const forward = new Vector3(0, 0, -1);
  const tip = new Vector3(0, 0, 0.2);
  const through = (x: number, y: number) =>
    new Ray(eye, new Vector3(x, y, 0.2).sub(eye).normalize());
  near(
    planeMotion(through(0.1, 0), through(0.13, -0.04), tip, forward)!,
    new Vector3(0.03, -0.04, 0),
  );
});

test("planeMotion has no answer for a ray along the plane or away from it", () => {
  const forward = new Vector3(0, 0, -1);
  const along = new Ray(new Vector3(0, 0, 1), new Vector3(1, 0, 0));
  const away = new Ray(new Vector3(0, 0, 1), new Vector3(0, 0, 1));
  const good = new Ray(new Vector3(0, 0, 1), new Vector3(0, 0, -1));
  assert.equal(planeMotion(along, good, new Vector3(), forward), undefined);
  assert.equal(planeMotion(good, away, new Vector3(), forward), undefined);
});

test("advance goes into the tissue, against the shaft", () => {
  const target = tilted();
  const before = target.tip.clone();
  advance(target, 0.005);
  near(target.tip, before.addScaledVector(shaftAxis(target), -0.005));
});

test("translate with the axis lock keeps the tip on the shaft's line", () => {
  const target = tilted();
  const before = target.tip.clone();
  translate(target, new Vector3(0.1, 0.2, 0.3), true);
  const moved = target.tip.clone().sub(before);
  assert.ok(moved.clone().cross(shaftAxis(target)).length() < kRoundOffM);
  assert.ok(
    Math.abs(moved.dot(shaftAxis(target)) - new Vector3(0.1, 0.2, 0.3).dot(shaftAxis(target))) <
      kRoundOffM,
  );
});

test("pivot about the tip leaves the tip, about the entry keeps its distance and the unit norm", () => {
  const turn = dragRotation(37, -80, new Vector3(0, 0, 1), new Vector3(1, 0, 0));
  const atTip = tilted();
  const tip = atTip.tip.clone();
  pivot(atTip, tip.clone(), turn);
  near(atTip.tip, tip);
  const target = tilted();
  const entry = target.tip.clone().addScaledVector(shaftAxis(target), 0.02);
  for (let i = 0; i < 1000; i++) pivot(target, entry, turn);
  assert.ok(Math.abs(target.tip.distanceTo(entry) - 0.02) < 1e-10);
  assert.ok(Math.abs(target.orientation.length() - 1) < kRoundOffM);
  // The entry stays on the shaft's line.
  near(target.tip.clone().addScaledVector(shaftAxis(target), target.tip.distanceTo(entry)), entry);
});

test("wheelNotches counts mice by notches and touchpads in proportion", () => {
  assert.equal(wheelNotches(-100, 0), 1);
  assert.equal(wheelNotches(-120, 0), 1);
  assert.equal(wheelNotches(240, 0), -2);
  assert.equal(wheelNotches(3, 1), -1);
  assert.equal(wheelNotches(-50, 0), 1);
  assert.ok(Math.abs(wheelNotches(-4, 0) - 0.04) < 1e-15);
});
