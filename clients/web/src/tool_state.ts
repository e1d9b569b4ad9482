// A tool's state in words, and what a trainee's run comes to.

import type { Frame, ToolState } from "./gen/adhesim/v1/frame_pb";
import { axialForceN, forceN } from "./driving";

export type ToolMood = "free" | "touching" | "sticking" | "pulling" | "limited" | "unattended" | "retracted";

/** One word for what a tool does, the most urgent first. */
export function toolMood(frame: Frame, index: number): ToolMood {
  const tool = frame.tools[index];
  if (!tool) return "free";
  // Nobody drives it, by will or by mishap: it holds, and then leaves contact.
  if (tool.retracted) return "retracted";
  if (tool.operatorLost) return "unattended";
  if (tool.forceLimited || tool.obstructed) return "limited";
  const stuck = frame.zones.some((zone) => zone.tool === index);
  if (stuck && axialForceN(tool) < 0) return "pulling";
  if (stuck) return "sticking";
  return tool.collidingParticles > 0 ? "touching" : "free";
}

/** What a tool's run comes to so far. */
export class ToolMetrics {
  maxForceN = 0;
  /** Length of the tip's path, m. */
  pathM = 0;
  /** Simulated time in contact, s. */
  contactS = 0;
  private last?: { x: number; y: number; z: number; timeS: number };

  add(tool: ToolState, timeS: number): void {
    const { pose } = tool;
    if (!pose) return;
    this.maxForceN = Math.max(this.maxForceN, forceN(tool));
    if (this.last && timeS > this.last.timeS) {
      this.pathM += Math.hypot(pose.xM - this.last.x, pose.yM - this.last.y, pose.zM - this.last.z);
      if (tool.collidingParticles > 0) this.contactS += timeS - this.last.timeS;
    }
    this.last = { x: pose.xM, y: pose.yM, z: pose.zM, timeS };
  }
}
