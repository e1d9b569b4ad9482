// A session on the server: found or created, watched, controlled. Goes on by itself after a lost
// connection or an ended session.

import { SessionState, type Heartbeat, type Session } from "./gen/adhesim/v1/status_pb";
import { FrameField, type Topology } from "./gen/adhesim/v1/frame_pb";
import type { WatchResponse } from "./gen/adhesim/v1/view_service_pb";
import type { Sample } from "./history";
import { kConnectionLost, ServiceError, type Stream, type Streams } from "./streams";

export interface SessionEvents {
  onTopology(topology: Topology, session: string): void;
  onSample(sample: Sample): void;
  onHeartbeat(heartbeat: Heartbeat): void;
  /** What is in the way, as a sentence; undefined: nothing any more. */
  onProblem(problem: string | undefined): void;
}

const kRetryMs = 1000;

export class SessionClient {
  id?: string;
  state = SessionState.UNSPECIFIED;
  /** Name of the scene that was watched last. */
  private scene?: string;
  private watch?: Stream;
  private received = 0n;
  private acknowledged = 0n;
  private strainEnergy = false;
  // Rises whenever what is under way no longer counts.
  private epoch = 0;
  private retry = 0;

  constructor(
    private readonly streams: Streams,
    private wanted: { session?: string; scene?: string },
    private readonly events: SessionEvents,
  ) {}

  /** Finds or creates the session and watches it. Called whenever the connection is up. */
  async start(): Promise<void> {
    const epoch = ++this.epoch;
    clearTimeout(this.retry);
    try {
      const id = await this.choose();
      if (epoch !== this.epoch) return;
      this.events.onProblem(undefined);
      this.open(id);
    } catch (error) {
      if (epoch === this.epoch) this.failed(error);
    }
  }

  /** The connection is gone: nothing is under way any more. */
  stop(): void {
    this.epoch++;
    clearTimeout(this.retry);
    this.watch = undefined;
  }

  /** Leaves this session for another one, or for a new one of a scene. */
  async attach(wanted: { session?: string; scene?: string }): Promise<void> {
    this.wanted = wanted;
    this.id = undefined;
    this.scene = undefined;
    this.watch?.end();
    this.watch = undefined;
    await this.start();
  }

  /** Stops watching; `attach` or `start` goes on. */
  leave(): void {
    this.watch?.end();
    this.stop();
  }

  /** Frames carry the strain energy or not; it costs the server time. */
  wantStrainEnergy(on: boolean): void {
    if (on === this.strainEnergy) return;
    this.strainEnergy = on;
    if (!this.watch || !this.id) return;
    this.watch.end();
    this.open(this.id, true);
  }

  /** Says that the frames so far are drawn, so that the server sends more. */
  acknowledge(): void {
    if (!this.watch || this.received === this.acknowledged) return;
    this.acknowledged = this.received;
    this.watch.send({
      case: "watch",
      value: { request: { case: "ack", value: { frames: this.received } } },
    });
  }

  async pause(): Promise<void> {
    const { session } = await this.streams.call("pauseSession", { session: this.id });
    this.state = session?.state ?? this.state;
  }

  async resume(): Promise<void> {
    const { session } = await this.streams.call("resumeSession", { session: this.id });
    this.state = session?.state ?? this.state;
  }

  async step(steps = 1): Promise<void> {
    await this.streams.call("stepSession", { session: this.id, steps });
  }

  async reset(): Promise<void> {
    const { session } = await this.streams.call("resetSession", { session: this.id });
    this.state = session?.state ?? this.state;
  }

  private async choose(): Promise<string> {
    const { sessions } = await this.streams.call("listSessions", {});
    const named = (id: string | undefined) => sessions.find(({ session }) => session === id);
    const known = named(this.id) ?? named(this.wanted.session);
    if (known) return this.remember(known);
    const newest = sessions.at(-1);
    if (newest && !this.wanted.scene) return this.remember(newest);
    return this.remember(await this.create());
  }

  // The scene that was asked for, or was shown before the server forgot it, or the first that can
  // be built.
  private async create(): Promise<Session> {
    const wanted = this.wanted.scene ?? this.scene;
    const names = wanted
      ? [wanted]
      : (await this.streams.call("listScenes", {})).scenes.map(({ name }) => name);
    let problem = new Error("The server has no session and offers no scenes.");
    for (const name of names) {
      try {
        const source = { case: "sceneName" as const, value: name };
        const { session } = await this.streams.call("createSession", { source });
        if (session) return session;
      } catch (error) {
        // A scene may lack its files on this machine; the next one may not.
        if (!(error instanceof ServiceError) || error.reason !== "SCENE_INVALID") throw error;
        problem = error;
      }
    }
    this.scene = undefined;
    throw problem;
  }

  private remember(session: Session): string {
    this.state = session.state;
    this.scene = session.scene;
    return session.session;
  }

  // `again`: the same session with other fields; its topology is known.
  private open(id: string, again = false): void {
    const epoch = this.epoch;
    this.id = id;
    this.received = this.acknowledged = 0n;
    this.watch = this.streams.open(
      {
        case: "watch",
        value: {
          request: {
            case: "start",
            value: { session: id, fields: this.strainEnergy ? [FrameField.STRAIN_ENERGY] : [] },
          },
        },
      },
      (response) => {
        if (response.case !== "watch") return;
        if (again && response.value.response.case === "topology") return;
        this.receive(response.value);
      },
      (error) => {
        if (epoch === this.epoch) this.failed(error ?? new Error(`Session ${id} has ended.`));
      },
    );
  }

  private receive(message: WatchResponse): void {
    const { response } = message;
    if (response.case === "frame") {
      this.received++;
      this.events.onSample({
        session: message.session,
        step: Number(message.step),
        timeS: message.timeS,
        frame: response.value,
      });
    } else if (response.case === "topology") {
      this.events.onTopology(response.value, message.session);
    } else if (response.case === "heartbeat") {
      this.state = response.value.state;
      this.events.onHeartbeat(response.value);
    }
  }

  // A session that ended is left; what else went wrong is tried again.
  private failed(error: unknown): void {
    if (error instanceof ServiceError && error.reason === kConnectionLost) return;
    const text = error instanceof Error ? error.message : String(error);
    this.events.onProblem(
      this.watch ? `The session has ended: ${text} Looking for another one.` : text,
    );
    this.watch = undefined;
    this.retry = window.setTimeout(() => void this.start(), kRetryMs);
  }
}
