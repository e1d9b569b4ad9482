// Dots for particles in contact and in zones, and arrows for forces.

import {
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  ConeGeometry,
  CylinderGeometry,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  Matrix4,
  MeshBasicMaterial,
  Points,
  PointsMaterial,
  Quaternion,
  Sphere,
  Vector3,
} from "three";
import { zoneColour } from "./colour_map";
import type { ToolState } from "./gen/adhesim/v1/frame_pb";
import type { Particles } from "./particles";

const kArrows = 256;
const kContactColour = 0xffffff;
const kContactArrowColour = 0xe69f00;
const kToolArrowColour = 0xd62f2f;

export interface ArrowSettings {
  /** Length of an arrow, m per N. */
  scaleMPerN: number;
  /** Forces below are not drawn, N. */
  thresholdN: number;
  /** No arrow is longer, m. */
  longestM: number;
  /** Thickness of the shafts, m. */
  radiusM: number;
}

export class Markers {
  readonly group = new Group();
  private readonly contacts: Dots;
  private readonly zones: Dots;
  private readonly contactArrows = new Arrows(kArrows, kContactArrowColour);
  private readonly toolArrows = new Arrows(16, kToolArrowColour);
  private readonly zoneColours: BufferAttribute;
  private readonly from = new Vector3();
  private readonly force = new Vector3();
  private order = new Uint32Array(0);

  constructor(
    position: BufferAttribute,
    private readonly particles: Particles,
  ) {
    this.zoneColours = new BufferAttribute(new Float32Array(3 * particles.count), 3).setUsage(
      DynamicDrawUsage,
    );
    this.zones = new Dots(position, 9, 0xffffff, this.zoneColours);
    this.contacts = new Dots(position, 5, kContactColour);
    this.contacts.points.renderOrder = 2;
    // Contact is where bodies meet, and so mostly behind one of them.
    this.contacts.points.material.depthTest = false;
    this.zones.points.renderOrder = 1;
    this.group.add(this.zones.points, this.contacts.points);
    this.group.add(...this.contactArrows.meshes, ...this.toolArrows.meshes);
  }

  show(what: { contacts: boolean; zones: boolean; forces: boolean }): void {
    this.contacts.points.visible = what.contacts;
    this.zones.points.visible = what.zones;
    for (const mesh of [...this.contactArrows.meshes, ...this.toolArrows.meshes])
      mesh.visible = what.forces;
  }

  update(tools: readonly ToolState[], settings: ArrowSettings): void {
    const { particles } = this;
    if (this.contacts.points.visible)
      this.contacts.set(particles.contactParticle, particles.contactCount);
    if (this.zones.points.visible) this.updateZones();
    if (!this.toolArrows.meshes[0].visible) return;
    this.updateContactArrows(settings);
    this.toolArrows.begin();
    for (const { pose, tissue } of tools) {
      if (!pose || !tissue) continue;
      this.from.set(pose.xM, pose.yM, pose.zM);
      this.toolArrows.add(
        this.from,
        this.force.set(tissue.fxN, tissue.fyN, tissue.fzN),
        settings,
        2,
      );
    }
    this.toolArrows.end();
  }

  dispose(): void {
    this.contacts.dispose();
    this.zones.dispose();
    this.contactArrows.dispose();
    this.toolArrows.dispose();
  }

  private updateZones(): void {
    const colours = this.zoneColours.array as Float32Array;
    this.zones.begin();
    for (let p = 0; p < this.particles.count; p++) {
      const id = this.particles.zone[p];
      if (id < 0) continue;
      const colour = zoneColour(id);
      colours[3 * p] = colour[0];
      colours[3 * p + 1] = colour[1];
      colours[3 * p + 2] = colour[2];
      this.zones.add(p);
    }
    this.zones.end();
    this.zoneColours.needsUpdate = true;
  }

  private updateContactArrows(settings: ArrowSettings): void {
    const { particles } = this;
    const strength = (c: number) => particles.contactForceN[particles.contactParticle[c]];
    this.contactArrows.begin();
    if (this.order.length < particles.contactCount)
      this.order = new Uint32Array(2 * particles.contactCount);
    for (let c = 0; c < particles.contactCount; c++) this.order[c] = c;
    const order = this.order.subarray(0, particles.contactCount);
    // More than can be drawn: the greatest ones.
    if (particles.contactCount > kArrows) order.sort((a, b) => strength(b) - strength(a));
    for (let i = 0; i < Math.min(kArrows, order.length); i++) {
      const c = order[i];
      this.from.fromArray(particles.position, 3 * particles.contactParticle[c]);
      this.force.fromArray(particles.contactVectorN, 3 * c);
      this.contactArrows.add(this.from, this.force, settings, 1);
    }
    this.contactArrows.end();
  }
}

// Round dots of a fixed size on the screen at some of the particles.
class Dots {
  readonly points: Points<BufferGeometry, PointsMaterial>;
  private readonly index: BufferAttribute;
  private count = 0;

  constructor(
    position: BufferAttribute,
    sizePx: number,
    colour: number,
    colours?: BufferAttribute,
  ) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", position);
    if (colours) geometry.setAttribute("color", colours);
    this.index = new BufferAttribute(new Uint32Array(position.count), 1).setUsage(DynamicDrawUsage);
    geometry.setIndex(this.index);
    geometry.setDrawRange(0, 0);
    geometry.boundingSphere = new Sphere(undefined, Infinity);
    const material = new PointsMaterial({
      size: sizePx * Math.min(2, window.devicePixelRatio),
      sizeAttenuation: false,
      color: colour,
      vertexColors: colours !== undefined,
      map: discTexture(),
      alphaTest: 0.5,
    });
    this.points = new Points(geometry, material);
    this.points.frustumCulled = false;
  }

  set(particles: Uint32Array, count: number): void {
    (this.index.array as Uint32Array).set(particles.subarray(0, count));
    this.count = count;
    this.end();
  }

  begin(): void {
    this.count = 0;
  }

  add(particle: number): void {
    this.index.array[this.count++] = particle;
  }

  end(): void {
    this.index.needsUpdate = true;
    this.points.geometry.setDrawRange(0, this.count);
  }

  dispose(): void {
    this.points.geometry.dispose();
    this.points.material.map?.dispose();
    this.points.material.dispose();
  }
}

// Many arrows in two draw calls: shafts and heads.
class Arrows {
  readonly meshes: [InstancedMesh, InstancedMesh];
  private readonly material: MeshBasicMaterial;
  private readonly matrix = new Matrix4();
  private readonly turn = new Quaternion();
  private readonly direction = new Vector3();
  private readonly at = new Vector3();
  private readonly scale = new Vector3();
  private count = 0;

  constructor(
    private readonly capacity: number,
    colour: number,
  ) {
    this.material = new MeshBasicMaterial({ color: colour });
    const shaft = new CylinderGeometry(1, 1, 1, 8, 1).translate(0, 0.5, 0);
    const head = new ConeGeometry(1, 1, 12).translate(0, 0.5, 0);
    const mesh = (geometry: BufferGeometry) => new InstancedMesh(geometry, this.material, capacity);
    this.meshes = [mesh(shaft), mesh(head)];
    for (const instanced of this.meshes) {
      instanced.frustumCulled = false;
      instanced.count = 0;
      instanced.instanceMatrix.setUsage(DynamicDrawUsage);
    }
  }

  begin(): void {
    this.count = 0;
  }

  add(from: Vector3, force: Vector3, settings: ArrowSettings, thickness: number): void {
    const size = force.length();
    if (size < settings.thresholdN || size === 0 || this.count >= this.capacity) return;
    const length = Math.min(settings.longestM, size * settings.scaleMPerN);
    const radius = thickness * settings.radiusM;
    const head = Math.min(length * 0.5, 5 * radius);
    this.direction.copy(force).divideScalar(size);
    this.turn.setFromUnitVectors(kUp, this.direction);
    this.scale.set(radius, Math.max(length - head, 1e-9), radius);
    this.meshes[0].setMatrixAt(this.count, this.matrix.compose(from, this.turn, this.scale));
    this.at.copy(from).addScaledVector(this.direction, length - head);
    this.scale.set(0.45 * head, head, 0.45 * head);
    this.meshes[1].setMatrixAt(this.count, this.matrix.compose(this.at, this.turn, this.scale));
    this.count++;
  }

  end(): void {
    for (const mesh of this.meshes) {
      mesh.count = this.count;
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  dispose(): void {
    for (const mesh of this.meshes) {
      mesh.geometry.dispose();
      mesh.dispose();
    }
    this.material.dispose();
  }
}

const kUp = new Vector3(0, 1, 0);

function discTexture(): CanvasTexture {
  const size = 32;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const context = canvas.getContext("2d")!;
  context.fillStyle = "#333";
  context.arc(size / 2, size / 2, size / 2 - 1, 0, 2 * Math.PI);
  context.fill();
  context.beginPath();
  context.fillStyle = "#fff";
  context.arc(size / 2, size / 2, size / 2 - 6, 0, 2 * Math.PI);
  context.fill();
  return new CanvasTexture(canvas);
}
