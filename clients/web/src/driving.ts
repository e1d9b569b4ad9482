// Driving a tool with the mouse and the keys while it is held: moves a target pose, which the
// server's tool follows.

import { Quaternion, Raycaster, Vector2, Vector3, type Ray } from "three";
import {
  advance,
  cloneTarget,
  dragRotation,
  pivot,
  planeMotion,
  shaftAxis,
  targetOf,
  translate,
  wheelNotches,
  type TargetPose,
} from "./driving_math";
import type { ToolState } from "./gen/adhesim/v1/frame_pb";
import type { Scene3d } from "./scene3d";

const kNotchM = 0.001;
const kFineNotchM = 0.0002;

export class Driving {
  /** Index of the tool that is driven. */
  tool = -1;
  axisLock = false;
  onTarget: (target: TargetPose) => void = () => {};

  private target?: TargetPose;
  private pointer?: { x: number; y: number };
  /** Where the tip met the tissue; the tool pivots there while it is in contact. */
  private entry?: Vector3;
  private readonly raycaster = new Raycaster();

  constructor(
    private readonly scene3d: Scene3d,
    private readonly canvas: HTMLCanvasElement,
  ) {
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerdown", () => (this.pointer = undefined));
    canvas.addEventListener("pointerup", () => (this.pointer = undefined));
    canvas.addEventListener("pointerleave", () => (this.pointer = undefined));
    // Before the camera's own handler, which would zoom.
    canvas.addEventListener("wheel", (event) => this.wheel(event), {
      capture: true,
      passive: false,
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  get driving(): boolean {
    return this.target !== undefined;
  }

  /** The tool is ours: the target starts where the tool is. */
  begin(tool: number, state: ToolState): void {
    if (!state.pose) return;
    this.tool = tool;
    this.target = targetOf(state.pose);
    this.pointer = undefined;
    this.entry = state.collidingParticles > 0 ? this.target.tip.clone() : undefined;
    this.scene3d.controls.enablePan = this.scene3d.controls.enableZoom = false;
    this.changed();
  }

  end(): void {
    this.tool = -1;
    this.target = undefined;
    this.scene3d.controls.enablePan = this.scene3d.controls.enableZoom = true;
  }

  /** What the tool met in the newest frame. */
  felt(state: ToolState | undefined): void {
    if (!this.target || !state?.pose) return;
    if (state.collidingParticles === 0) this.entry = undefined;
    else this.entry ??= new Vector3(state.pose.xM, state.pose.yM, state.pose.zM);
  }

  /** A key that moves the target; false when it is none. */
  key(event: KeyboardEvent): boolean {
    if (!this.target) return false;
    const step = event.altKey ? kFineNotchM : kNotchM;
    const along = (direction: Vector3, sign: number) =>
      translate(this.target!, direction.multiplyScalar(sign * step), this.axisLock);
    switch (event.key) {
      case "ArrowLeft":
        along(this.screenRight(), -1);
        break;
      case "ArrowRight":
        along(this.screenRight(), 1);
        break;
      case "ArrowUp":
        along(this.screenUp(), 1);
        break;
      case "ArrowDown":
        along(this.screenUp(), -1);
        break;
      case "PageDown":
        advance(this.target, step);
        break;
      case "PageUp":
        advance(this.target, -step);
        break;
      default:
        return false;
    }
    this.changed();
    return true;
  }

  private move(event: PointerEvent): void {
    if (!this.target) return;
    const from = this.pointer;
    this.pointer = { x: event.offsetX, y: event.offsetY };
    // A drag with the left button turns the camera.
    if (!from || (event.buttons & 1) !== 0) return;
    if ((event.buttons & 2) !== 0) {
      const rotation = dragRotation(
        event.offsetX - from.x,
        event.offsetY - from.y,
        this.screenUp(),
        this.screenRight(),
      );
      pivot(this.target, (this.entry ?? this.target.tip).clone(), rotation);
    } else {
      const forward = this.scene3d.camera.getWorldDirection(new Vector3());
      const start = this.ray(from).clone();
      const motion = planeMotion(start, this.ray(this.pointer), this.target.tip, forward);
      if (motion) translate(this.target, motion, this.axisLock);
    }
    this.changed();
  }

  private wheel(event: WheelEvent): void {
    if (!this.target) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const notches = wheelNotches(event.deltaY, event.deltaMode);
    advance(this.target, notches * (event.altKey ? kFineNotchM : kNotchM));
    this.changed();
  }

  private changed(): void {
    if (this.target) this.onTarget(cloneTarget(this.target));
  }

  private ray({ x, y }: { x: number; y: number }): Ray {
    const at = new Vector2(
      (2 * x) / this.canvas.clientWidth - 1,
      1 - (2 * y) / this.canvas.clientHeight,
    );
    this.raycaster.setFromCamera(at, this.scene3d.camera);
    return this.raycaster.ray;
  }

  private screenRight(): Vector3 {
    return new Vector3().setFromMatrixColumn(this.scene3d.camera.matrixWorld, 0);
  }

  private screenUp(): Vector3 {
    return new Vector3().setFromMatrixColumn(this.scene3d.camera.matrixWorld, 1);
  }
}

/**
 * The part of a force along a tool's shaft, N: above 0 when it pushes the tool out, below 0 when it
 * holds it back.
 */
export function axialForceN(state: ToolState): number {
  const { pose, tissue } = state;
  if (!pose || !tissue) return 0;
  const orientation = new Quaternion(pose.qx, pose.qy, pose.qz, pose.qw);
  return new Vector3(tissue.fxN, tissue.fyN, tissue.fzN).dot(
    shaftAxis({ tip: new Vector3(), orientation }),
  );
}

/** The magnitude of the tissue's force on a tool, N. */
export function forceN(state: ToolState): number {
  const { tissue } = state;
  return tissue ? Math.hypot(tissue.fxN, tissue.fyN, tissue.fzN) : 0;
}
