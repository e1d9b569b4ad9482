// Where a mouse or a key moves a tool's target. Pure functions over three.js vectors; a pose is the
// tool's tip and its orientation, and the tool's shaft lies along its own +z, away from the tissue.

import { Quaternion, Vector3, type Ray } from "three";
import type { Pose } from "./gen/adhesim/v1/frame_pb";

export interface TargetPose {
  tip: Vector3;
  orientation: Quaternion;
}

export function targetOf(pose: Pose): TargetPose {
  return {
    tip: new Vector3(pose.xM, pose.yM, pose.zM),
    orientation: new Quaternion(pose.qx, pose.qy, pose.qz, pose.qw).normalize(),
  };
}

export function cloneTarget(target: TargetPose): TargetPose {
  return { tip: target.tip.clone(), orientation: target.orientation.clone() };
}

/** Unit vector from the tip to the handle, world axes. */
export function shaftAxis(target: TargetPose): Vector3 {
  return new Vector3(0, 0, 1).applyQuaternion(target.orientation);
}

/**
 * How far the pointer moved in the plane through the tip that is parallel to the screen, m.
 * `forward` is the camera's view direction. Undefined when a ray is parallel to the plane.
 */
export function planeMotion(
  from: Ray,
  to: Ray,
  tip: Vector3,
  forward: Vector3,
): Vector3 | undefined {
  const start = meetPlane(from, tip, forward);
  const end = meetPlane(to, tip, forward);
  return start && end && end.sub(start);
}

function meetPlane(ray: Ray, point: Vector3, normal: Vector3): Vector3 | undefined {
  const along = ray.direction.dot(normal);
  if (Math.abs(along) < 1e-9) return undefined;
  const distance = point.clone().sub(ray.origin).dot(normal) / along;
  return distance > 0 ? ray.origin.clone().addScaledVector(ray.direction, distance) : undefined;
}

/** Moves the target; with `axisOnly` by the motion's part along the shaft alone. */
export function translate(target: TargetPose, motion: Vector3, axisOnly: boolean): void {
  if (axisOnly) {
    const axis = shaftAxis(target);
    target.tip.addScaledVector(axis, motion.dot(axis));
  } else {
    target.tip.add(motion);
  }
}

/** Advances the tip along the shaft, m: above 0 into the tissue. */
export function advance(target: TargetPose, distance: number): void {
  target.tip.addScaledVector(shaftAxis(target), -distance);
}

/** Turns the tool about a point of the world. */
export function pivot(target: TargetPose, centre: Vector3, rotation: Quaternion): void {
  target.tip.sub(centre).applyQuaternion(rotation).add(centre);
  target.orientation.premultiply(rotation).normalize();
}

/** The rotation of a right-drag: about the screen's upward and rightward directions. */
export function dragRotation(dx: number, dy: number, up: Vector3, right: Vector3): Quaternion {
  const yaw = new Quaternion().setFromAxisAngle(up, dx * kRadiansPerPixel);
  const pitch = new Quaternion().setFromAxisAngle(right, dy * kRadiansPerPixel);
  return yaw.multiply(pitch);
}

const kRadiansPerPixel = (0.3 * Math.PI) / 180;

/**
 * Notches of a wheel event, above 0 away from the user. Mice report 100 or 120 pixels or 3 lines a
 * notch; what is smaller comes from a touchpad and counts in proportion.
 */
export function wheelNotches(deltaY: number, deltaMode: number): number {
  const notches = deltaMode === 1 ? deltaY / 3 : deltaMode === 2 ? deltaY : deltaY / 100;
  const count = Math.abs(notches);
  return -Math.sign(notches) * (count >= 0.5 ? Math.max(1, Math.round(count)) : count);
}
