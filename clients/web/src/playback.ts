// A recording: scrubbed, played and stepped through.

import { fromBinary } from "@bufbuild/protobuf";
import { byId, create, setText } from "./dom";
import type { ByteSource } from "./byte_source";
import type { Frame } from "./gen/adhesim/v1/frame_pb";
import { EventKind, EventSchema, ToolForcesSchema } from "./gen/adhesim/v1/recording_pb";
import { WatchResponseSchema } from "./gen/adhesim/v1/view_service_pb";
import type { Mode } from "./mode";
import { kRecordingRows, Plots } from "./plots";
import { inWords, RecordingFile, type RecordedFrame } from "./recording_file";
import type { Shell } from "./shell";
import type { TransportState } from "./transport";

// Reading everything shares the page with drawing.
const kSliceMs = 10;
const kScanDrawMs = 500;
// Long enough to read why a file could not be opened.
const kFailureMs = 15000;

export class Playback implements Mode {
  speed = 1;
  private file?: RecordingFile;
  name = "";
  private running = false;
  /** Time that is shown or on its way, ns since the recording began. */
  private atNs = 0n;
  private shownNs = -1n;
  private lastMs = 0;
  private busy = false;
  private frame?: Frame;
  private readonly scrub = byId<HTMLInputElement>("scrub");

  constructor(private readonly shell: Shell) {
    this.scrub.addEventListener("input", () => {
      this.running = false;
      this.seek(BigInt(Math.round(Number(this.scrub.value) * 1e9)));
    });
  }

  get open(): boolean {
    return this.file !== undefined;
  }

  /**
   * Opens a recording and shows its first frame, or the one nearest to a time. `before` is called
   * when it is known to be readable. False, with a banner, when it is not: what was shown stays.
   */
  async load(
    source: Promise<ByteSource> | ByteSource,
    name: string,
    atS: number | undefined,
    before: () => void,
  ): Promise<boolean> {
    try {
      const file = await RecordingFile.open(await source);
      const wanted = atS === undefined ? file.startNs : BigInt(Math.round(atS * 1e9));
      const frame = await file.frameNear(wanted);
      if (!frame) throw new Error("it holds no frames");
      before();
      this.shell.banner.set("opening", undefined);
      this.shell.setTopology(file.topology);
      this.file = file;
      this.name = name;
      this.running = false;
      this.shownNs = -1n;
      this.shell.hooks.mode = "recording";
      this.shell.banner.set("recording", file.notice, "warning");
      this.prepareScrub(file);
      this.show(frame);
      // A picture has no plots.
      if (!document.body.classList.contains("picture")) void this.scan(file);
      return true;
    } catch (error) {
      const text = `Cannot open ${name}: ${inWords(error)}`;
      this.shell.banner.set("opening", text, "error", kFailureMs);
      return false;
    }
  }

  close(): void {
    this.file = undefined;
    this.running = false;
    this.shell.plots.show(undefined);
    this.shell.banner.set("opening", undefined);
    this.shell.banner.set("recording", undefined);
    byId("scrub-row").hidden = true;
    this.shell.hooks.mode = "live";
  }

  /** Shows the frame nearest to a time; resolves when it has been painted. */
  async showAt(timeS: number): Promise<{ step: number; timeS: number }> {
    if (!this.file) throw new Error("no recording is open");
    this.running = false;
    const frame = await this.file.frameNear(BigInt(Math.round(timeS * 1e9)));
    if (!frame) throw new Error("the recording has no frames");
    this.show(frame);
    this.shell.draw(performance.now());
    this.shell.write();
    // The second animation frame begins after the first one's picture is on the screen.
    await nextAnimationFrame();
    await nextAnimationFrame();
    return { step: Number(frame.message.step), timeS: frame.message.timeS };
  }

  tick(nowMs: number): void {
    if (!this.file || !this.running) {
      this.lastMs = nowMs;
      return;
    }
    // What passes while a frame is read is made up for; a page that was hidden does not leap.
    if (this.busy) return;
    const passedMs = Math.min(500, nowMs - this.lastMs);
    this.lastMs = nowMs;
    this.seek(this.atNs + BigInt(Math.round(passedMs * 1e6 * this.speed)));
    if (this.atNs >= this.file.endNs) this.running = false;
  }

  transport(): TransportState {
    const sample = this.shell.view.sample;
    return {
      mode: "recording",
      running: this.running,
      enabled: this.open,
      timeS: sample?.timeS ?? 0,
      realTime: this.running ? this.speed : 0,
      stepS: this.frame?.stepDurationS ?? 0,
      budgetS: this.shell.rateHz > 0 ? 1 / this.shell.rateHz : 0,
      misses: Number(this.frame?.deadlineMisses ?? 0n),
      fidelity: this.frame?.fidelity,
      skipped: Number(this.frame?.skippedSteps ?? 0n),
    };
  }

  play(): void {
    if (!this.file) return;
    if (!this.running && this.atNs >= this.file.endNs) this.seek(this.file.startNs);
    this.running = !this.running;
  }

  forward(): void {
    this.running = false;
    void this.fetch((file) => file.frameAfter(this.shownNs));
  }

  back(): void {
    this.running = false;
    void this.fetch((file) => file.frameBefore(this.shownNs));
  }

  reset(): void {
    this.running = false;
    if (this.file) this.seek(this.file.startNs);
  }

  private seek(timeNs: bigint): void {
    if (!this.file) return;
    const { startNs, endNs } = this.file;
    this.atNs = timeNs < startNs ? startNs : timeNs > endNs ? endNs : timeNs;
    void this.follow();
  }

  // One read at a time, and then the newest place that was asked for meanwhile.
  private async follow(): Promise<void> {
    if (this.busy) return;
    for (let done = -1n; done !== this.atNs;) {
      done = this.atNs;
      await this.fetch((file) => file.frameAt(done), true);
    }
  }

  private async fetch(
    read: (file: RecordingFile) => Promise<RecordedFrame | undefined>,
    follows = false,
  ): Promise<void> {
    const file = this.file;
    if (!file || this.busy) return;
    this.busy = true;
    try {
      const frame = await read(file);
      if (file === this.file && frame && frame.timeNs !== this.shownNs) this.show(frame, follows);
    } catch (error) {
      this.running = false;
      this.shell.banner.set(
        "recording",
        `Cannot read ${this.name} here: ${inWords(error)}`,
        "error",
      );
    } finally {
      this.busy = false;
    }
  }

  private show(frame: RecordedFrame | undefined, follows = false): void {
    if (!frame || frame.message.response.case !== "frame") return;
    this.shownNs = frame.timeNs;
    // A frame that follows a place asked for does not move that place, which may be further on
    // already.
    if (!follows) this.atNs = frame.timeNs;
    this.frame = frame.message.response.value;
    const { session, step, timeS } = frame.message;
    this.shell.hooks.framesReceived++;
    this.shell.show({ session, step: Number(step), timeS, frame: this.frame });
    const atS = Number(frame.timeNs) / 1e9;
    this.shell.plots.setCursor(atS);
    if (document.activeElement !== this.scrub || this.running) this.scrub.value = String(atS);
    setText(byId("scrub-time"), `${atS.toFixed(2)} / ${this.scrub.max} s`);
  }

  private prepareScrub(file: RecordingFile): void {
    this.scrub.min = (Number(file.startNs) / 1e9).toFixed(2);
    this.scrub.max = (Number(file.endNs) / 1e9).toFixed(2);
    byId("scrub-row").hidden = false;
    byId("scrub-ticks").replaceChildren();
  }

  // Reads the whole recording once for its plots and events, a slice of time at a time.
  private async scan(file: RecordingFile): Promise<void> {
    const rows = Plots.empty(kRecordingRows);
    this.shell.plots.show(rows);
    const spanNs = file.endNs - file.startNs;
    const leastNs = spanNs / BigInt(kRecordingRows - 100) + 1n;
    const budgetS = this.shell.rateHz > 0 ? 1 / this.shell.rateHz : 0;
    let stepDurationS = 0;
    let nextNs = 0n;
    let sliceEnd = performance.now() + kSliceMs;
    let drawAt = performance.now() + kScanDrawMs;
    try {
      for await (const { topic, timeNs, data } of file.messages([
        "/forces",
        "/frames",
        "/events",
      ])) {
        if (file !== this.file) return;
        if (topic === "/frames") {
          const { response } = fromBinary(WatchResponseSchema, data);
          if (response.case !== "frame") continue;
          stepDurationS = response.value.stepDurationS;
          // Without tools nothing else says when.
          if (file.topology.tools.length === 0) {
            Plots.row(rows, Number(timeNs) / 1e9, response.value, 0, budgetS);
          }
        } else if (topic === "/events") {
          this.addTick(file, timeNs, data);
        } else if (timeNs >= nextNs) {
          nextNs = timeNs + leastNs;
          const { tools } = fromBinary(ToolForcesSchema, data);
          const tool = this.shell.selectedTool;
          Plots.row(rows, Number(timeNs) / 1e9, { tools, stepDurationS }, tool, budgetS);
          this.shell.collect(tools, Number(timeNs) / 1e9);
        }
        if (performance.now() > sliceEnd) {
          await nextTask();
          if (performance.now() > drawAt) {
            drawAt = performance.now() + kScanDrawMs;
            if (file === this.file) this.shell.plots.show(rows);
          }
          sliceEnd = performance.now() + kSliceMs;
        }
      }
    } catch (error) {
      this.shell.banner.set("recording", `${this.name} is damaged: ${inWords(error)}`, "warning");
    }
    if (file !== this.file) return;
    this.shell.plots.show(rows);
    this.shell.rewrite();
  }

  private addTick(file: RecordingFile, timeNs: bigint, data: Uint8Array): void {
    const ticks = byId("scrub-ticks");
    // More than the bar has pixels would only cost time.
    if (ticks.childElementCount > 500) return;
    const event = fromBinary(EventSchema, data);
    const at = Number(timeNs - file.startNs) / Math.max(1, Number(file.endNs - file.startNs));
    const kind = EventKind[event.kind]?.toLowerCase().replaceAll("_", " ") ?? "event";
    const tick = create("span", {
      className: "tick",
      title: `${(Number(timeNs) / 1e9).toFixed(2)} s: ${event.text || kind}`,
    });
    tick.dataset.kind = kind;
    tick.style.left = `${(100 * at).toFixed(2)}%`;
    ticks.append(tick);
  }
}

function nextTask(): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, 0));
}

function nextAnimationFrame(): Promise<number> {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}
