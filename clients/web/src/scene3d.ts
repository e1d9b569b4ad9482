// The 3-D view: renderer, camera, lights. Draws only when something changed.

import {
  Box3,
  Color,
  DirectionalLight,
  HemisphereLight,
  PerspectiveCamera,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export type AxisView = "x" | "-x" | "y" | "-y" | "z" | "-z";

const kHomeDirection = new Vector3(0.55, -1, 0.5).normalize();
const kFieldOfViewDeg = 32;

export class Scene3d {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(kFieldOfViewDeg, 1, 0.001, 10);
  readonly renderer: WebGLRenderer;
  readonly controls: OrbitControls;
  /** Called after the camera moved or the canvas was resized. */
  onView: () => void = () => {};
  /**
   * Called with a sentence when the browser takes the graphics away, and with nothing when it gives
   * them back.
   */
  onContext: (problem?: string) => void = () => {};

  private dirty = true;
  private readonly fitted = new Sphere(new Vector3(), 0.1);
  private readonly resizing: ResizeObserver;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly frame: HTMLElement,
    quality: "smooth" | "auto",
  ) {
    const software = quality === "auto" && rendersInSoftware();
    // Drawing in software costs time by the pixel: no smoothing and no extra pixels there.
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: !software,
      powerPreference: "high-performance",
    });
    this.renderer.setPixelRatio(software ? 1 : Math.min(2, window.devicePixelRatio));
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.viewChanged());
    this.addLights();
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.onContext("The browser has lost the 3-D graphics; waiting for them to come back.");
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.onContext();
      this.invalidate();
    });
    this.resizing = new ResizeObserver(() => this.resize());
    this.resizing.observe(frame);
    this.resize();
    this.home();
  }

  get radius(): number {
    return this.fitted.radius;
  }

  /** Something changed: draw with the next animation frame. */
  invalidate(): void {
    this.dirty = true;
  }

  /** Draws if anything changed, and says whether it did. */
  draw(): boolean {
    if (!this.dirty) return false;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
    return true;
  }

  setBackground(colour: string): void {
    this.scene.background = new Color(colour);
    this.invalidate();
  }

  /** The box that home and axis views show. */
  fit(box: Box3): void {
    box.getBoundingSphere(this.fitted);
    this.fitted.radius = Math.max(this.fitted.radius, 1e-4);
    this.camera.near = this.fitted.radius / 100;
    this.camera.far = this.fitted.radius * 100;
    this.controls.minDistance = this.fitted.radius / 20;
    this.controls.maxDistance = this.fitted.radius * 30;
  }

  home(): void {
    this.look(kHomeDirection);
  }

  axisView(view: AxisView): void {
    const sign = view.startsWith("-") ? -1 : 1;
    const axis = view.at(-1);
    const direction = new Vector3(axis === "x" ? 1 : 0, axis === "y" ? 1 : 0, axis === "z" ? 1 : 0);
    direction.multiplyScalar(sign);
    // Straight along the upward axis the camera would have no upright: a hair beside it has.
    if (axis === "z") direction.y = -1e-4;
    this.look(direction);
  }

  /** The picture as it is drawn now, rows from the bottom. */
  pixels(): { width: number; height: number; data: Uint8Array } {
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext();
    const width = gl.drawingBufferWidth;
    const height = gl.drawingBufferHeight;
    const data = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return { width, height, data };
  }

  /** The picture as a PNG. */
  png(): Promise<Blob | null> {
    this.renderer.render(this.scene, this.camera);
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }

  /** Where a point is on the canvas, CSS pixels; undefined behind the camera. */
  project(point: Vector3): { x: number; y: number } | undefined {
    const at = point.clone().project(this.camera);
    if (at.z > 1) return undefined;
    return {
      x: ((at.x + 1) / 2) * this.canvas.clientWidth,
      y: ((1 - at.y) / 2) * this.canvas.clientHeight,
    };
  }

  private look(direction: Vector3): void {
    const half = (kFieldOfViewDeg * Math.PI) / 360;
    const narrow = Math.min(1, this.camera.aspect);
    // A little nearer than the sphere's edge: no scene fills its sphere.
    const distance = (0.85 * this.fitted.radius) / Math.sin(Math.atan(Math.tan(half) * narrow));
    this.controls.target.copy(this.fitted.center);
    this.camera.position.copy(direction).multiplyScalar(distance).add(this.fitted.center);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.viewChanged();
  }

  private viewChanged(): void {
    this.camera.updateMatrixWorld();
    this.invalidate();
    this.onView();
  }

  private resize(): void {
    const width = Math.max(1, this.frame.clientWidth);
    const height = Math.max(1, this.frame.clientHeight);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.viewChanged();
  }

  private addLights(): void {
    // Mostly from all around, so that a colour keeps its legend's shade; the rest from over the
    // viewer's left shoulder.
    this.scene.add(new HemisphereLight(0xffffff, 0xb8b0a8, 1.7));
    const lamp = new DirectionalLight(0xffffff, 1.6);
    lamp.position.set(-0.5, 0.8, 1);
    this.camera.add(lamp, lamp.target);
    this.scene.add(this.camera);
  }
}

function rendersInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}
