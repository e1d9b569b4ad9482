// Force, depth and state beside the tip of the tool, where the eyes are.

import { byId, setText } from "./dom";
import { forceN } from "./driving";
import { millimetres, newtons } from "./format";
import type { Sample } from "./history";
import { toolMood } from "./tool_state";
import type { View } from "./view";

const kWidthPx = 148;
const kHeightPx = 92;
const kOffsetPx = 22;

export class Hud {
  private readonly root = byId("hud");
  private readonly force = byId("hud-force");
  private readonly depth = byId("hud-depth");
  private readonly step = byId("hud-step");
  private readonly mood = byId("hud-state");
  private readonly name = byId("hud-tool");

  constructor(private readonly view: View) {}

  /** The numbers of a tool; called at the pace at which people read. */
  write(sample: Sample, tool: number): void {
    const state = sample.frame.tools[tool];
    this.root.hidden = !state;
    if (!state) return;
    setText(this.name, this.view.content?.topology.tools[tool]?.name ?? "");
    setText(this.force, newtons(forceN(state)));
    setText(this.depth, millimetres(state.depthM));
    setText(this.step, `step ${sample.step}`);
    const mood = toolMood(sample.frame, tool);
    setText(this.mood, mood);
    this.root.dataset.state = mood;
  }

  /** Follows the tip; called when something was drawn. */
  place(tool: number): void {
    if (this.root.hidden) return;
    const at = this.view.tipOnScreen(tool);
    if (!at) return;
    const area = this.root.parentElement!;
    // Beside the tip, on its left where there is no room on its right.
    const right = at.x + kOffsetPx;
    const left = at.x - kOffsetPx - kWidthPx;
    const x = Math.max(
      8,
      right + kWidthPx > area.clientWidth ? Math.min(left, area.clientWidth - kWidthPx) : right,
    );
    const y = Math.min(area.clientHeight - kHeightPx, Math.max(8, at.y - kHeightPx / 2));
    this.root.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
  }
}
