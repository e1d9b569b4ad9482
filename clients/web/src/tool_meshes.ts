// Needles and lancets, and a ghost of each where its operator wants it. In a tool's frame the tip
// is the origin and the shaft lies along +z.

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  ConeGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  MeshLambertMaterial,
  Quaternion,
  Vector3,
  type Raycaster,
} from "three";
import type {
  LancetTopology,
  NeedleTopology,
  Pose,
  ToolState,
  ToolTopology,
} from "./gen/adhesim/v1/frame_pb";

// A target this close to its tool is not drawn: the ghost would only flicker.
const kGhostDistanceM = 0.0005;
const kGhostAngleRad = 0.02;

interface Tool {
  body: Group;
  ghost: Group;
  visible: boolean;
}

export class ToolMeshes {
  readonly group = new Group();
  readonly topologies: readonly ToolTopology[];
  private readonly tools: Tool[] = [];
  private readonly steel = new MeshLambertMaterial({ color: 0x9aa6b2 });
  private readonly held = new MeshLambertMaterial({ color: 0x4d8fd6 });
  private readonly ghostMaterial = new MeshLambertMaterial({
    color: 0x4d8fd6,
    transparent: true,
    opacity: 0.3,
    depthWrite: false,
  });

  constructor(topologies: readonly ToolTopology[]) {
    this.topologies = topologies;
    for (const topology of topologies) {
      const tool = {
        body: shape(topology, this.steel),
        ghost: shape(topology, this.ghostMaterial),
        visible: true,
      };
      if (topology.start) {
        place(tool.body, topology.start);
        place(tool.ghost, topology.start);
      }
      tool.ghost.visible = false;
      this.tools.push(tool);
      this.group.add(tool.body, tool.ghost);
    }
  }

  /**
   * Takes over a frame. `localTarget` is the target that this page steers, ahead of what the server
   * has answered.
   */
  update(
    states: readonly ToolState[],
    localTarget?: { tool: number; tip: Vector3; orientation: Quaternion },
  ): void {
    for (const [index, tool] of this.tools.entries()) {
      const state = states[index];
      if (!state?.pose) continue;
      place(tool.body, state.pose);
      if (localTarget?.tool === index) {
        tool.ghost.position.copy(localTarget.tip);
        tool.ghost.quaternion.copy(localTarget.orientation);
      } else if (state.target) {
        place(tool.ghost, state.target);
      }
      tool.ghost.visible =
        tool.visible &&
        (tool.body.position.distanceTo(tool.ghost.position) > kGhostDistanceM ||
          tool.body.quaternion.angleTo(tool.ghost.quaternion) > kGhostAngleRad);
    }
  }

  /** Shows which tool this page holds; -1: none. */
  markHeld(held: number): void {
    for (const [index, { body }] of this.tools.entries()) {
      for (const part of body.children) {
        (part as Mesh).material = index === held ? this.held : this.steel;
      }
    }
  }

  visible(tool: number): boolean {
    return this.tools[tool]?.visible ?? false;
  }

  setVisible(index: number, on: boolean): void {
    const tool = this.tools[index];
    if (!tool) return;
    tool.visible = tool.body.visible = on;
    tool.ghost.visible &&= on;
  }

  /** The tool under a ray and how far away it is. */
  pick(raycaster: Raycaster): { tool: number; distance: number } | undefined {
    let nearest: { tool: number; distance: number } | undefined;
    for (const [index, { body, visible }] of this.tools.entries()) {
      if (!visible) continue;
      const [hit] = raycaster.intersectObject(body, true);
      if (hit && (!nearest || hit.distance < nearest.distance)) {
        nearest = { tool: index, distance: hit.distance };
      }
    }
    return nearest;
  }

  dispose(): void {
    this.group.traverse((object) => {
      if (object instanceof Mesh) object.geometry.dispose();
    });
    for (const material of [this.steel, this.held, this.ghostMaterial]) material.dispose();
  }
}

function place(object: Group, pose: Pose): void {
  object.position.set(pose.xM, pose.yM, pose.zM);
  object.quaternion.set(pose.qx, pose.qy, pose.qz, pose.qw);
}

function shape(topology: ToolTopology, material: MeshLambertMaterial): Group {
  const group = new Group();
  const parts =
    topology.shape.case === "needle"
      ? needle(topology.shape.value)
      : topology.shape.case === "lancet"
        ? lancet(topology.shape.value)
        : [];
  for (const geometry of parts) group.add(new Mesh(geometry, material));
  group.name = topology.name;
  return group;
}

// three.js builds cones and cylinders about y: turned here so that y becomes z, and moved along z
// to where they begin.
function aboutZ(geometry: BufferGeometry, beginM: number, lengthM: number): BufferGeometry {
  return geometry.rotateX(Math.PI / 2).translate(0, 0, beginM + lengthM / 2);
}

function needle({ lengthM, radiusM, tipLengthM }: NeedleTopology): BufferGeometry[] {
  const shaftM = Math.max(0, lengthM - tipLengthM);
  // The cone's apex is at +z after the turn; it belongs at the origin.
  const tip = new ConeGeometry(radiusM, tipLengthM, 16)
    .rotateX(-Math.PI / 2)
    .translate(0, 0, tipLengthM / 2);
  const shaft = aboutZ(new CylinderGeometry(radiusM, radiusM, shaftM, 16), tipLengthM, shaftM);
  // A hub, so that a thin needle can be seen and clicked; it is drawn only.
  const hubM = lengthM * 0.12;
  const hub = aboutZ(new CylinderGeometry(radiusM * 2.6, radiusM * 2, hubM, 16), lengthM, hubM);
  return [tip, shaft, hub];
}

function lancet(topology: LancetTopology): BufferGeometry[] {
  const { bladeLengthM, bladeWidthM, bladeThicknessM, handleLengthM, handleRadiusM } = topology;
  // Pointed over the first third, then as wide as the blade.
  const pointM = bladeLengthM / 3;
  const blade = new BoxGeometry(bladeThicknessM, bladeWidthM, bladeLengthM - pointM).translate(
    0,
    0,
    pointM + (bladeLengthM - pointM) / 2,
  );
  const handle = aboutZ(
    new CylinderGeometry(handleRadiusM, handleRadiusM, handleLengthM, 16),
    bladeLengthM,
    handleLengthM,
  );
  return [wedge(bladeThicknessM / 2, bladeWidthM / 2, pointM), blade, handle];
}

// A pyramid from the tip to a rectangle, flat in x.
function wedge(x: number, y: number, z: number): BufferGeometry {
  const tip = [0, 0, 0];
  const corners = [
    [x, y, z],
    [-x, y, z],
    [-x, -y, z],
    [x, -y, z],
  ];
  const points: number[] = [];
  for (let side = 0; side < 4; side++) {
    points.push(...tip, ...corners[(side + 1) % 4], ...corners[side]);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  geometry.computeVertexNormals();
  return geometry;
}
