// What every mode shares: the view with its panels, and the one path by which a frame reaches the
// screen.

import { Banner } from "./banner";
import { DisplayPanel, defaultDisplay, kLongestMmPerN } from "./display";
import { byId, setText } from "./dom";
import { forceN } from "./driving";
import type { Topology, ToolState } from "./gen/adhesim/v1/frame_pb";
import type { Sample } from "./history";
import { recordError, type Hooks } from "./hooks";
import { Hud } from "./hud";
import { Legend } from "./legend";
import { PickPanel, SceneTree, ToolPanel } from "./panels";
import { Plots } from "./plots";
import { RateMeter } from "./rate_meter";
import { Scene3d } from "./scene3d";
import { seconds } from "./format";
import { ToolMetrics } from "./tool_state";
import { View } from "./view";

export class Shell {
  readonly banner = new Banner();
  readonly display = defaultDisplay();
  readonly panel: DisplayPanel;
  readonly view: View;
  readonly tree: SceneTree;
  readonly plots = new Plots();
  readonly toolPanel: ToolPanel;
  readonly pick = new PickPanel();
  readonly realTime = new RateMeter();
  /** The tool that panels, plots and HUD are about. */
  selectedTool = 0;
  rateHz = 0;
  /** Called after the display settings changed. */
  onDisplay: () => void = () => {};
  onGrab: () => void = () => {};

  private readonly hud: Hud;
  private readonly drawn = new RateMeter();
  private metrics: ToolMetrics[] = [];
  private drawings = 0;
  private written?: Sample;

  constructor(
    readonly scene3d: Scene3d,
    readonly hooks: Hooks,
  ) {
    this.view = new View(scene3d, this.display, new Legend());
    this.view.onFit = (spacingM) => {
      setText(byId("ground-note"), `floor: ${Number((spacingM * 1000).toPrecision(2))} mm`);
      this.display.arrowMmPerN = niceArrow(scene3d.radius);
      this.panel.refresh();
    };
    this.hud = new Hud(this.view);
    this.tree = new SceneTree(this.view, (tool) => this.selectTool(tool));
    this.toolPanel = new ToolPanel(() => this.onGrab());
    this.panel = new DisplayPanel(byId("display"), this.display, () => {
      hooks.colourMap = this.display.colourMap;
      this.view.applyDisplay();
      this.onDisplay();
    });
    scene3d.onContext = (problem) => this.banner.set("graphics", problem, "error");
  }

  /** A new scene, or the same once more. Throws when the message is not sound. */
  setTopology(topology: Topology): void {
    const before = this.view.content?.topology;
    this.view.setTopology(topology);
    if (before?.scene !== topology.scene) {
      this.selectedTool = 0;
      this.pick.particle = undefined;
    }
    this.rateHz = topology.rateHz;
    document.body.classList.toggle("no-tools", topology.tools.length === 0);
    this.restart();
    this.tree.build(this.view.content!);
    setText(byId("scene-name"), topology.scene || "scene");
    document.title = `${topology.scene || "scene"} – adhesim`;
  }

  /** Time begins anew: plots and metrics do as well. */
  restart(): void {
    this.metrics = (this.view.content?.topology.tools ?? []).map(() => new ToolMetrics());
    this.plots.clear();
    this.realTime.clear();
  }

  /** What tools felt, each frame or step once, shown or not. */
  collect(tools: readonly ToolState[], timeS: number): void {
    for (const [index, metrics] of this.metrics.entries()) {
      if (tools[index]) metrics.add(tools[index], timeS);
    }
  }

  /** Puts a frame before the eyes. */
  show(sample: Sample): void {
    const begin = performance.now();
    try {
      this.view.show(sample);
    } catch (error) {
      recordError(error);
      return;
    }
    const { hooks } = this;
    hooks.framesShown++;
    hooks.step = sample.step;
    hooks.timeS = sample.timeS;
    hooks.session = sample.session;
    const tool = sample.frame.tools[this.selectedTool];
    hooks.hud = { step: sample.step, forceN: tool ? forceN(tool) : 0, depthM: tool?.depthM ?? 0 };
    hooks.frameMs += 0.05 * (performance.now() - begin - hooks.frameMs);
  }

  /** Draws if needed; once per animation frame. */
  draw(nowMs: number): void {
    const begin = performance.now();
    if (this.scene3d.draw()) {
      this.hud.place(this.selectedTool);
      if (this.view.sample && this.hooks.firstFrameMs === 0)
        this.hooks.firstFrameMs = performance.now();
      this.drawn.add(++this.drawings, nowMs);
      // Drawing counts with the frame that caused it.
      this.hooks.frameMs += 0.05 * (performance.now() - begin);
    }
    this.hooks.fps = this.drawn.perSecond(nowMs);
  }

  /** Numbers beside the view; at the pace at which people read. */
  write(): void {
    const { sample } = this.view;
    if (!sample || sample === this.written) return;
    this.written = sample;
    const tool = this.selectedTool;
    this.hud.write(sample, tool);
    this.hud.place(tool);
    const name = this.view.content?.topology.tools[tool]?.name;
    this.toolPanel.write(name, sample, tool, this.metrics[tool]);
    this.pick.write(this.view);
    setText(
      byId("caption"),
      `${this.view.content?.topology.scene ?? ""} · ${seconds(sample.timeS)}`,
    );
  }

  /** Writes even when the frame is the same: something else changed. */
  rewrite(): void {
    this.written = undefined;
    this.write();
  }

  selectTool(tool: number): void {
    this.selectedTool = tool;
    this.plots.clear();
    this.rewrite();
  }
}

// A force of 1 N is drawn about half as long as the scene is wide, in a round number of
// millimetres.
function niceArrow(radiusM: number): number {
  return Math.min(kLongestMmPerN, Math.max(1, Math.round((radiusM * 1000) / 2 / 5) * 5));
}
