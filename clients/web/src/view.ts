// What is seen: one scene's bodies, tools, markers and floor, drawn the same way live, from history
// and from a recording.

import { Box3, Raycaster, Vector2, Vector3 } from "three";
import { colourMap, type Range } from "./colour_map";
import type { Display } from "./display";
import type { TargetPose } from "./driving_math";
import type { Topology } from "./gen/adhesim/v1/frame_pb";
import { Ground } from "./ground";
import type { Sample } from "./history";
import type { Legend } from "./legend";
import { Markers } from "./markers";
import { Particles } from "./particles";
import { Scene3d } from "./scene3d";
import { Tissue } from "./tissue";
import { ToolMeshes } from "./tool_meshes";

export interface Content {
  topology: Topology;
  particles: Particles;
  tissue: Tissue;
  tools: ToolMeshes;
  markers: Markers;
  ground: Ground;
}

export class View {
  content?: Content;
  sample?: Sample;
  /** The target that this page steers. */
  localTarget?: { tool: number } & TargetPose;

  /** Called when another scene was fitted; with the distance of the floor's lines, m. */
  onFit: (spacingM: number) => void = () => {};

  private readonly raycaster = new Raycaster();

  constructor(
    readonly scene3d: Scene3d,
    private readonly display: Display,
    private readonly legend: Legend,
  ) {}

  /** Builds the scene anew; the camera stays where it is when the scene is the same as before. */
  setTopology(topology: Topology): void {
    const before = this.content;
    const particles = new Particles(topology);
    const tissue = new Tissue(topology, particles);
    const tools = new ToolMeshes(topology.tools);
    const markers = new Markers(tissue.position, particles);
    const ground = new Ground();
    this.content = { topology, particles, tissue, tools, markers, ground };
    this.sample = undefined;
    const scene = this.scene3d.scene;
    if (before) {
      scene.remove(
        before.tissue.group,
        before.tools.group,
        before.markers.group,
        before.ground.lines,
      );
      for (const part of [before.tissue, before.tools, before.markers, before.ground])
        part.dispose();
    }
    scene.add(tissue.group, tools.group, markers.group, ground.lines);
    const same =
      before?.topology.scene === topology.scene && before.particles.count === particles.count;
    if (particles.restKnown) this.frameContent(this.content, same);
    tissue.update(undefined);
    this.applyDisplay();
  }

  /** Shows a frame. Throws when it does not fit the topology; what was shown before stays. */
  show(sample: Sample): void {
    const content = this.content;
    if (!content) return;
    const { restKnown } = content.particles;
    content.particles.update(sample.frame);
    this.sample = sample;
    if (!restKnown) this.frameContent(content);
    content.tissue.update(this.lockedRange());
    this.update(content, sample);
  }

  /** Draws the last frame again, with the display settings of now. */
  applyDisplay(): void {
    const content = this.content;
    if (!content) return;
    const { tissue, markers, ground } = content;
    tissue.setWireframe(this.display.wireframe);
    tissue.setTransparent(this.display.transparent);
    tissue.setMap(this.display.colourMap);
    tissue.paint(this.lockedRange());
    markers.show(this.display);
    ground.lines.visible = this.display.ground;
    this.update(content, this.sample);
  }

  /** The tool or the particle under a place of the canvas; coordinates -1 to 1, y upwards. */
  pick(x: number, y: number): { tool: number } | { body: number; particle: number } | undefined {
    const content = this.content;
    if (!content) return undefined;
    this.raycaster.setFromCamera(new Vector2(x, y), this.scene3d.camera);
    const tool = content.tools.pick(this.raycaster);
    const tissue = content.tissue.pick(this.raycaster);
    if (tool && (!tissue || tool.distance <= tissue.hit.distance)) return { tool: tool.tool };
    return tissue && { body: tissue.body, particle: tissue.particle };
  }

  /** Where a tool's tip is on the screen, CSS pixels of the canvas. */
  tipOnScreen(tool: number): { x: number; y: number } | undefined {
    const pose = this.sample?.frame.tools[tool]?.pose;
    return pose && this.scene3d.project(new Vector3(pose.xM, pose.yM, pose.zM));
  }

  private update({ tissue, tools, markers, particles }: Content, sample: Sample | undefined): void {
    tools.update(sample?.frame.tools ?? [], this.localTarget);
    markers.update(sample?.frame.tools ?? [], {
      scaleMPerN: this.display.arrowMmPerN / 1000,
      thresholdN: this.display.arrowThresholdN,
      longestM: this.scene3d.radius,
      radiusM: this.scene3d.radius / 250,
    });
    const known = this.display.colourMap !== "strain-energy" || particles.hasStrainEnergy;
    this.legend.update(this.display.colourMap, tissue.range, this.display.lockRange, known);
    this.scene3d.invalidate();
  }

  // Fits camera and floor to what there is.
  private frameContent({ topology, particles, ground }: Content, keepCamera = false): void {
    const box = contentBox(topology, particles);
    ground.fit(box);
    this.scene3d.fit(box);
    if (keepCamera) return;
    this.scene3d.home();
    this.onFit(ground.spacingM);
  }

  private lockedRange(): Range | undefined {
    if (!this.display.lockRange) return undefined;
    const { scale } = colourMap(this.display.colourMap);
    return { min: this.display.rangeMin / scale, max: this.display.rangeMax / scale };
  }
}

// The bodies at rest, and of the tools what is near them: a long handle must not make the tissue
// small.
function contentBox(topology: Topology, particles: Particles): Box3 {
  const box = new Box3();
  const point = new Vector3();
  for (let p = 0; p < particles.count; p++)
    box.expandByPoint(point.fromArray(particles.rest, 3 * p));
  const reach = box.isEmpty() ? 0.05 : box.getSize(new Vector3()).length() / 6;
  for (const { start } of topology.tools) {
    if (!start) continue;
    const tip = new Vector3(start.xM, start.yM, start.zM);
    const axis = new Vector3(0, 0, 1).applyQuaternion({
      x: start.qx,
      y: start.qy,
      z: start.qz,
      w: start.qw,
    });
    box.expandByPoint(tip).expandByPoint(tip.clone().addScaledVector(axis, reach));
  }
  if (box.isEmpty()) box.setFromCenterAndSize(new Vector3(), new Vector3(0.1, 0.1, 0.1));
  return box;
}
