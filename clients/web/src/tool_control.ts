// Taking a tool and giving it back: the server's leave, the driving, and what the page shows of both.

import type { Driving } from "./driving";
import { cloneTarget } from "./driving_math";
import type { Sample } from "./history";
import { Operator } from "./operator";
import type { Shell } from "./shell";
import type { ServiceError, Streams } from "./streams";

export class ToolControl {
  /** Called when the server refused a tool because someone else has it. */
  onTaken: (tool: string) => void = () => {};
  /** Called when this page gave a tool back. */
  onReleased: (tool: string) => void = () => {};
  private name = "";
  private readonly operator: Operator;

  constructor(
    private readonly shell: Shell,
    private readonly driving: Driving,
    streams: Streams,
  ) {
    this.operator = new Operator(streams);
    driving.onTarget = (target) => {
      this.operator.setTarget(target);
      shell.view.localTarget = { tool: driving.tool, ...cloneTarget(target) };
    };
  }

  get held(): boolean {
    return this.driving.driving;
  }

  /** Once per animation frame. */
  flush(): void {
    this.operator.flush();
  }

  /** What the tool met in the frame that is about to be shown. */
  felt(sample: Sample): void {
    this.driving.felt(sample.frame.tools[this.driving.tool]);
  }

  take(session: string, tool: number): void {
    const name = this.shell.view.content?.topology.tools[tool]?.name;
    if (name === undefined) return;
    this.shell.selectTool(tool);
    this.operator.take(session, name, {
      onTaken: (state) => {
        this.shell.banner.set("control", undefined);
        this.name = name;
        this.driving.begin(tool, state);
        this.markHeld();
      },
      onPoseRefused: (message) => this.shell.banner.set("control", message, "warning", 4000),
      onEnd: (error) => {
        this.letGo();
        if (error) this.refused(name, error);
      },
    });
  }

  release(): void {
    if (!this.held) return;
    this.operator.release();
    this.letGo();
    this.onReleased(this.name);
  }

  /** Colours the tool that is held; also after the scene was built anew. */
  markHeld(): void {
    this.shell.view.content?.tools.markHeld(this.driving.tool);
    this.shell.scene3d.invalidate();
  }

  private letGo(): void {
    this.driving.end();
    this.shell.view.localTarget = undefined;
    this.markHeld();
    this.shell.view.applyDisplay();
  }

  private refused(name: string, error: ServiceError): void {
    if (error.reason === "TOOL_TAKEN") this.onTaken(name);
    const text = `Control of ${name} was refused or lost: ${error.message}`;
    this.shell.banner.set("control", text, "warning", 6000);
  }
}
