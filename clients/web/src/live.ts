// A live session: connection, session, control of a tool, and the history one steps back through.

import { Connection, webSocketUrl, type ConnectionState } from "./connection";
import type { Driving } from "./driving";
import type { Topology } from "./gen/adhesim/v1/frame_pb";
import { SessionState, type Heartbeat } from "./gen/adhesim/v1/status_pb";
import { History, type Sample } from "./history";
import { recordError } from "./hooks";
import type { Mode } from "./mode";
import { Roster } from "./roster";
import { SessionClient } from "./session";
import type { Shell } from "./shell";
import { ServiceError, Streams } from "./streams";
import { ToolControl } from "./tool_control";
import type { TransportState } from "./transport";

export class Live implements Mode {
  readonly session: SessionClient;
  readonly streams: Streams;
  viewers = 0;
  connectionState: ConnectionState = "closed";
  /** Called when the connection is up and the lists of the server can be read. */
  onConnected: () => void = () => {};

  private readonly connection: Connection;
  private readonly control: ToolControl;
  private readonly history = new History();
  private readonly roster = new Roster();
  private pending?: Sample;
  /** Number of the sample that is shown from the history. */
  private past?: number;
  private lastStep = -1;
  private publishedMs = 0;
  private timing: Pick<TransportState, "misses" | "skipped" | "stepS" | "fidelity"> = {
    misses: 0,
    skipped: 0,
    stepS: 0,
  };
  active = true;
  private everConnected = false;

  constructor(
    private readonly shell: Shell,
    driving: Driving,
    wanted: { session?: string; scene?: string },
  ) {
    this.connection = new Connection(webSocketUrl(location), {
      onState: (state) => this.connectionChanged(state),
      onMessage: (message) => {
        if (message.stream === 0 && message.response.case === "ended") {
          if (!this.active) return;
          shell.banner.set("session", message.response.value.message, "error");
        } else {
          this.streams.receive(message);
        }
      },
      onError: recordError,
    });
    this.streams = new Streams((message) => this.connection.send(message));
    this.control = new ToolControl(shell, driving, this.streams);
    // Heartbeats say it as well, a quarter of a second later.
    this.control.onTaken = (tool) => this.roster.take(tool);
    this.control.onReleased = (tool) => this.roster.release(tool, performance.now());
    this.session = new SessionClient(this.streams, wanted, {
      onTopology: (topology) => this.topologyArrived(topology),
      onSample: (sample) => this.sampleArrived(sample),
      onHeartbeat: (heartbeat) => this.heartbeatArrived(heartbeat),
      onProblem: (problem, mayCreate = false) => {
        const offer = { label: "New session (Space)", run: () => void this.session.createNew() };
        shell.banner.set("session", problem, "error", 0, mayCreate ? offer : undefined);
      },
      onLost: () => {
        this.roster.clear();
        this.viewers = 0;
      },
    });
  }

  open(): void {
    this.connection.open();
  }

  /** Leaves the view to a recording, or takes it back. */
  setActive(on: boolean): void {
    this.active = on;
    if (!on) {
      this.release();
      this.returnToNow();
      this.pending = undefined;
      this.session.leave();
      this.shell.banner.set("session", undefined);
      this.shell.banner.set("control", undefined);
    }
    this.writeConnection();
  }

  get running(): boolean {
    return this.session.state === SessionState.RUNNING;
  }

  /** Names of the tools that an operator holds. */
  get operatedTools(): readonly string[] {
    return this.roster.tools;
  }

  get role(): "controller" | "spectator" | "viewer" {
    if (this.control.held) return "controller";
    return this.operatedTools.length > 0 ? "spectator" : "viewer";
  }

  /** Whether this page may stop and start time. */
  get mayControl(): boolean {
    return this.session.watching && this.role !== "spectator";
  }

  tick(): void {
    this.control.flush();
    if (this.pending && this.past === undefined) {
      const sample = this.pending;
      this.pending = undefined;
      this.control.felt(sample);
      this.shell.show(sample);
      const budgetS = this.shell.rateHz > 0 ? 1 / this.shell.rateHz : 0;
      this.shell.plots.add(sample.timeS, sample.frame, this.shell.selectedTool, budgetS);
    }
    this.session.acknowledge();
  }

  transport(): TransportState {
    const sample = this.shell.view.sample;
    return {
      mode: this.past === undefined ? "live" : "history",
      running: this.running && this.past === undefined,
      enabled: this.mayControl,
      timeS: sample?.timeS ?? 0,
      realTime: this.running ? this.shell.realTime.perSecond(this.publishedMs) : 0,
      stepS: this.timing.stepS,
      budgetS: this.shell.rateHz > 0 ? 1 / this.shell.rateHz : 0,
      misses: this.timing.misses,
      fidelity: this.timing.fidelity,
      skipped: this.timing.skipped,
    };
  }

  play(): void {
    if (this.past !== undefined) {
      this.returnToNow();
      if (this.running || !this.session.watching) return;
    }
    if (this.session.waiting) {
      void this.session.createNew();
      return;
    }
    this.attempt(() => (this.running ? this.session.pause() : this.session.resume()));
  }

  forward(): void {
    if (this.past !== undefined) {
      this.showPast(this.past + 1);
      return;
    }
    this.attempt(async () => {
      if (this.running) await this.session.pause();
      await this.session.step();
    });
  }

  back(): void {
    // Time stands still while one looks back, as far as one may stop it.
    if (this.past === undefined && this.running && this.mayControl)
      this.attempt(() => this.session.pause());
    this.showPast((this.past ?? this.history.newest) - 1);
  }

  reset(): void {
    this.returnToNow();
    this.attempt(() => this.session.reset());
  }

  /** Takes the tool, or gives it back. */
  toggleGrab(tool = this.shell.selectedTool): void {
    if (this.control.held) {
      this.release();
    } else if (this.session.watching && this.session.id !== undefined) {
      this.returnToNow();
      this.control.take(this.session.id, tool);
    }
  }

  release(): void {
    this.control.release();
  }

  private showPast(number: number): void {
    if (number >= this.history.newest) {
      this.returnToNow();
      return;
    }
    const sample = this.history.at(Math.max(number, this.history.oldest));
    if (!sample) return;
    this.past = Math.max(number, this.history.oldest);
    this.shell.hooks.mode = "history";
    this.shell.show(sample);
    const newest = this.history.at(this.history.newest)!;
    const ago = (newest.timeS - sample.timeS).toFixed(3);
    this.shell.banner.set(
      "history",
      `Looking back: step ${sample.step}, ${ago} s ago. Space returns to now.`,
      "info",
    );
  }

  private returnToNow(): void {
    if (this.past === undefined) return;
    this.past = undefined;
    this.shell.hooks.mode = "live";
    this.shell.banner.set("history", undefined);
    this.pending ??= this.history.at(this.history.newest);
  }

  private connectionChanged(state: ConnectionState): void {
    this.connectionState = state;
    document.body.dataset.connection = state;
    if (state === "connected") {
      this.everConnected = true;
      this.writeConnection();
      if (this.active) void this.session.start();
      this.onConnected();
    } else if (state === "reconnecting") {
      this.session.stop();
      this.streams.loseAll();
      this.writeConnection();
    }
  }

  private writeConnection(): void {
    const lost = this.active && this.connectionState === "reconnecting";
    const text = this.everConnected
      ? `The connection to ${location.host} is lost. Trying again every second.`
      : `No answer from ${location.host}. Trying again every second.`;
    this.shell.banner.set("connection", lost ? text : undefined, "error");
  }

  private topologyArrived(topology: Topology): void {
    if (!this.active) return;
    this.returnToNow();
    this.history.clear();
    this.lastStep = -1;
    this.pending = undefined;
    this.shell.setTopology(topology);
    this.control.markHeld();
  }

  private sampleArrived(sample: Sample): void {
    if (!this.active) return;
    this.shell.hooks.framesReceived++;
    if (sample.step < this.lastStep) {
      this.returnToNow();
      this.history.clear();
      this.shell.restart();
    }
    this.lastStep = sample.step;
    this.history.push(sample);
    this.shell.collect(sample.frame.tools, sample.timeS);
    // By the server's clock: how frames travel is not how time passes there.
    this.publishedMs = Number(sample.frame.publishedNs) / 1e6;
    this.shell.realTime.add(sample.timeS, this.publishedMs);
    this.timing = {
      misses: Number(sample.frame.deadlineMisses),
      fidelity: sample.frame.fidelity,
      skipped: Number(sample.frame.skippedSteps),
      stepS: sample.frame.stepDurationS,
    };
    this.pending = sample;
  }

  private heartbeatArrived(heartbeat: Heartbeat): void {
    this.viewers = heartbeat.viewers;
    this.roster.hear(heartbeat.operatedTools, performance.now());
    if (heartbeat.state === SessionState.FROZEN) {
      this.shell.banner.set(
        "session",
        "The session is frozen: a value became non-finite. Reset it to go on.",
        "error",
      );
    } else if (heartbeat.draining) {
      this.shell.banner.set(
        "session",
        "The server is going away; the session ends soon.",
        "warning",
      );
    } else {
      this.shell.banner.set("session", undefined);
    }
  }

  // What a person asked for and the server may refuse.
  private attempt(action: () => Promise<void>): void {
    if (!this.mayControl) {
      this.shell.banner.set("control", this.refusal(), "warning", 4000);
      return;
    }
    action().catch((error: unknown) => {
      if (!(error instanceof ServiceError)) recordError(error);
      this.shell.banner.set("control", (error as Error).message, "warning", 6000);
    });
  }

  private refusal(): string {
    if (this.connectionState !== "connected") return "There is no connection to the server.";
    if (!this.session.watching) return "There is no session.";
    return `Someone else holds ${this.operatedTools.join(", ")}: time is theirs.`;
  }
}
