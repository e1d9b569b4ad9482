// The bodies: one mesh each over one set of positions, normals and colours for all particles.

import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  Mesh,
  MeshPhongMaterial,
  Sphere,
  type Intersection,
  type Raycaster,
} from "three";
import {
  linearOfHex,
  niceRange,
  paintValues,
  paintZones,
  readValues,
  type ColourMapName,
  type Range,
} from "./colour_map";
import type { BodyTopology, Topology } from "./gen/adhesim/v1/frame_pb";
import { computeNormals } from "./normals";
import { readTriangles, type Particles } from "./particles";

const kSoftColours = ["#b5564a", "#c98f6a", "#a3795e", "#bf7f86", "#8f8a60"];
const kRigidColour = "#cfc8b4";

export class Tissue {
  readonly group = new Group();
  readonly bodies: readonly BodyTopology[];
  /** Positions that points and arrows share. */
  readonly position: BufferAttribute;
  /** Quantity of the colour map, SI units. [#particles] */
  readonly values: Float32Array;
  /** Range of the colours. */
  range: Range = { min: 0, max: 0 };

  private readonly triangles: Uint32Array<ArrayBuffer>;
  private readonly normal: BufferAttribute;
  private readonly colour: BufferAttribute;
  private readonly meshes: Mesh<BufferGeometry, MeshPhongMaterial>[] = [];
  private map: ColourMapName = "none";
  private painted: ColourMapName | undefined;

  constructor(
    topology: Topology,
    private readonly particles: Particles,
  ) {
    this.bodies = topology.bodies;
    this.triangles = readTriangles(topology);
    this.values = new Float32Array(particles.count);
    this.position = dynamic(particles.position);
    this.normal = dynamic(new Float32Array(3 * particles.count));
    this.colour = dynamic(new Float32Array(3 * particles.count));
    for (const body of topology.bodies) this.meshes.push(this.mesh(body));
    this.group.add(...this.meshes);
  }

  setMap(map: ColourMapName): void {
    this.map = map;
    for (const [index, { material }] of this.meshes.entries()) {
      // A highlight would change the colours of a legend.
      material.specular.set(map === "none" ? sheen(this.bodies[index]) : 0x000000);
    }
  }

  setWireframe(on: boolean): void {
    for (const { material } of this.meshes) material.wireframe = on;
  }

  setTransparent(on: boolean): void {
    for (const { material } of this.meshes) {
      material.transparent = on;
      material.opacity = on ? 0.35 : 1;
      material.depthWrite = !on;
      material.needsUpdate = true;
    }
  }

  visible(body: number): boolean {
    return this.meshes[body]?.visible ?? false;
  }

  setVisible(body: number, on: boolean): void {
    if (this.meshes[body]) this.meshes[body].visible = on;
  }

  /** Takes over what the particles are now. `lock` keeps a range instead of the frame's own. */
  update(lock: Range | undefined): void {
    computeNormals(this.particles.position, this.triangles, this.normal.array as Float32Array);
    this.position.needsUpdate = true;
    this.normal.needsUpdate = true;
    this.paint(lock);
  }

  paint(lock: Range | undefined): void {
    const colours = this.colour.array as Float32Array;
    if (this.map === "none") {
      if (this.painted === "none") return;
      for (const [index, body] of this.bodies.entries()) {
        const linear = linearOfHex(bodyColour(body, index));
        for (let p = body.firstParticle; p < body.firstParticle + body.particles; p++) {
          colours.set(linear, 3 * p);
        }
      }
    } else if (this.map === "zone") {
      paintZones(this.particles.zone, colours);
    } else {
      readValues(this.map, this.particles, this.values);
      this.range = lock ?? niceRange(this.values);
      paintValues(this.values, this.range, colours);
    }
    this.painted = this.map;
    this.colour.needsUpdate = true;
  }

  /** The nearest visible body under a ray: which one, where, and the particle nearest to there. */
  pick(raycaster: Raycaster): { body: number; particle: number; hit: Intersection } | undefined {
    // Meshes move without their bounding spheres; without limits nothing is left out.
    const [hit] = raycaster.intersectObjects(
      this.meshes.filter((mesh) => mesh.visible),
      false,
    );
    if (!hit?.face) return undefined;
    const body = this.meshes.indexOf(hit.object as Mesh<BufferGeometry, MeshPhongMaterial>);
    const distance = (p: number) =>
      Math.hypot(
        this.position.getX(p) - hit.point.x,
        this.position.getY(p) - hit.point.y,
        this.position.getZ(p) - hit.point.z,
      );
    const corners = [hit.face.a, hit.face.b, hit.face.c].sort((a, b) => distance(a) - distance(b));
    return { body, particle: corners[0], hit };
  }

  dispose(): void {
    for (const mesh of this.meshes) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }

  private mesh(body: BodyTopology): Mesh<BufferGeometry, MeshPhongMaterial> {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", this.position);
    geometry.setAttribute("normal", this.normal);
    geometry.setAttribute("color", this.colour);
    const first = 3 * body.firstTriangle;
    const own = this.triangles.subarray(first, first + 3 * body.triangles);
    geometry.setIndex(new BufferAttribute(own, 1));
    geometry.boundingSphere = new Sphere(undefined, Infinity);
    const material = new MeshPhongMaterial({
      vertexColors: true,
      side: DoubleSide,
      specular: sheen(body),
      shininess: body.rigid ? 10 : 40,
      // Dots and wires that lie on the surface are drawn in front of it.
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    const mesh = new Mesh(geometry, material);
    mesh.frustumCulled = false;
    mesh.name = body.name;
    return mesh;
  }
}

/** A body's own colour, "#rrggbb". */
export function bodyColour(body: BodyTopology, index: number): string {
  return body.rigid ? kRigidColour : kSoftColours[index % kSoftColours.length];
}

// Wet tissue shines more than bone.
function sheen(body: BodyTopology): number {
  return body.rigid ? 0x111111 : 0x262626;
}

function dynamic(array: Float32Array<ArrayBuffer>): BufferAttribute {
  return new BufferAttribute(array, 3).setUsage(DynamicDrawUsage);
}
