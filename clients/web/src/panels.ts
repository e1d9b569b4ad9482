// The tree of what the scene holds, the panel of the tool, and what was picked.

import { byId, create, onClick, setText } from "./dom";
import { axialForceN, forceN } from "./driving";
import { fixed, millimetres, newtons, short } from "./format";
import type { Sample } from "./history";
import { bodyColour } from "./tissue";
import { toolMood, type ToolMetrics } from "./tool_state";
import type { Content, View } from "./view";

/** Bodies and tools with their switches, effects by name. */
export class SceneTree {
  private readonly root = byId("tree");
  private boxes: HTMLInputElement[] = [];

  constructor(
    private readonly view: View,
    private readonly onSelectTool: (tool: number) => void,
  ) {}

  build({ topology, tissue, tools }: Content): void {
    this.boxes = [];
    const bodies = topology.bodies.map((body, index) =>
      this.row(
        `${body.name}`,
        `${index + 1}`,
        bodyColour(body, index),
        (on) => tissue.setVisible(index, on),
        {
          title: `${body.particles} particles, ${body.triangles} triangles${body.rigid ? ", rigid" : ""}`,
        },
      ),
    );
    const toolRows = topology.tools.map((tool, index) =>
      this.row(tool.name, "", "#9aa6b2", (on) => tools.setVisible(index, on), {
        title: `${tool.shape.case ?? "tool"}: click the name to select`,
        onName: () => this.onSelectTool(index),
      }),
    );
    const effects = topology.effects.map((name) =>
      create("li", { className: "effect" }, name.replaceAll("_", " ")),
    );
    this.root.replaceChildren(
      ...section("Bodies", bodies),
      ...section("Tools", toolRows),
      ...section("Effects", effects),
    );
  }

  /** Shows or hides the n-th body, from 0; all of them with -1. */
  toggleBody(index: number): void {
    const tissue = this.view.content?.tissue;
    if (!tissue) return;
    const all = tissue.bodies.map((_, body) => body);
    const some = index < 0 ? all : all.slice(index, index + 1);
    const on = index < 0 ? !all.every((body) => tissue.visible(body)) : !tissue.visible(index);
    for (const body of some) {
      tissue.setVisible(body, on);
      this.boxes[body].checked = on;
    }
    this.view.scene3d.invalidate();
  }

  private row(
    name: string,
    key: string,
    colour: string,
    show: (on: boolean) => void,
    { title, onName }: { title: string; onName?: () => void },
  ): HTMLElement {
    const box = create("input", { type: "checkbox", checked: true, ariaLabel: `Show ${name}` });
    box.addEventListener("change", () => {
      show(box.checked);
      box.blur();
      this.view.scene3d.invalidate();
    });
    this.boxes.push(box);
    const swatch = create("span", { className: "swatch" });
    swatch.style.background = colour;
    const label = onName
      ? create("button", { className: "link", type: "button", title }, name)
      : create("span", { title }, name);
    if (onName) onClick(label, onName);
    const row = create("li", {}, box, swatch, label);
    if (key) row.append(create("kbd", { title: `Key ${key}: show or hide` }, key));
    return row;
  }
}

function section(title: string, rows: HTMLElement[]): HTMLElement[] {
  return rows.length > 0 ? [create("h2", {}, title), create("ul", {}, ...rows)] : [];
}

/** Everything about the selected tool. */
export class ToolPanel {
  private readonly values = new Map<string, HTMLElement>();
  private readonly root = byId("tool-panel");
  private readonly title = byId("tool-name");
  private readonly grab = byId<HTMLButtonElement>("grab");

  constructor(onGrab: () => void) {
    const list = byId("tool-values");
    const names = [
      "state",
      "force",
      "axial",
      "torque",
      "depth",
      "contact",
      "tip",
      "max force",
      "path",
      "in contact",
    ];
    for (const name of names) {
      const value = create("dd", {}, "–");
      this.values.set(name, value);
      list.append(create("dt", {}, name), value);
    }
    onClick(this.grab, onGrab);
  }

  write(
    name: string | undefined,
    sample: Sample,
    index: number,
    metrics: ToolMetrics | undefined,
  ): void {
    const tool = sample.frame.tools[index];
    this.root.hidden = !tool || !metrics;
    if (!tool?.pose || !metrics) return;
    const { pose, tissue } = tool;
    const torque = tissue ? Math.hypot(tissue.txNm, tissue.tyNm, tissue.tzNm) * 1000 : 0;
    setText(this.title, name ?? "tool");
    this.set("state", toolMood(sample.frame, index) + (tool.speedLimited ? ", speed-limited" : ""));
    this.set("force", newtons(forceN(tool)));
    this.set("axial", newtons(axialForceN(tool)));
    this.set("torque", `${fixed(torque, 1)} mN·m`);
    this.set("depth", millimetres(tool.depthM));
    this.set("contact", `${tool.collidingParticles} · ${fixed(tool.contactAreaM2 * 1e6, 0)} mm²`);
    this.set("tip", [pose.xM, pose.yM, pose.zM].map((x) => fixed(x * 1000, 1)).join(", ") + " mm");
    this.set("max force", newtons(metrics.maxForceN));
    this.set("path", millimetres(metrics.pathM));
    this.set("in contact", `${metrics.contactS.toFixed(1)} s`);
  }

  /** What the button does now. */
  offer(label: "Grab (G)" | "Release (G)" | "Taken" | "Recording", enabled: boolean): void {
    setText(this.grab, label);
    this.grab.disabled = !enabled;
  }

  private set(name: string, text: string): void {
    setText(this.values.get(name)!, text);
  }
}

/** Numbers of the particle that was clicked on. */
export class PickPanel {
  private readonly root = byId("pick");
  particle?: number;

  write(view: View): void {
    const content = view.content;
    const p = this.particle;
    this.root.hidden = !content || p === undefined || p >= content.particles.count;
    if (this.root.hidden) return;
    const { particles, topology } = content!;
    const body = topology.bodies.find(
      (b) => p! >= b.firstParticle && p! < b.firstParticle + b.particles,
    );
    const at = [0, 1, 2].map((axis) => fixed(particles.position[3 * p! + axis] * 1000, 1));
    const rows = [
      `${body?.name ?? "?"}, particle ${p}`,
      `at ${at.join(", ")} mm`,
      `displaced ${millimetres(particles.displacementM(p!))}`,
      `contact force ${newtons(particles.contactForceN[p!])}`,
      particles.zone[p!] < 0 ? "in no zone" : `zone ${particles.zone[p!]}`,
    ];
    if (particles.hasStrainEnergy)
      rows.push(`strain energy ${short(particles.strainEnergyJ[p!])} J`);
    setText(this.root, rows.join("\n"));
  }
}
