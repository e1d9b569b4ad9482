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
  /**
   * What is in the way, as a sentence; undefined: nothing any more. `mayCreate`: `createNew` ends it.
   */
  onProblem(problem: string | undefined, mayCreate?: boolean): void;
  /** No session is watched any more. */
  onLost(): void;
}

const kDelays = {
  retryMs: 1000,
  /** All pages lose a restarted server at once; the first one back creates the session. */
  restartMs: 1500,
};
// The session is not there, and nothing is wrong with the server.
const kGone = ["SESSION_DELETED", "SESSION_NOT_FOUND"];
// A scene that the server does not offer any more, or whose files it lacks; the next one may do.
const kNoScene = ["SCENE_NOT_FOUND", "SCENE_INVALID"];

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
  private shown = false;
  /** Somebody deleted the session; what comes next is for people to say. */
  private deleted = false;

  constructor(
    private readonly streams: Pick<Streams, "call" | "open">,
    private wanted: { session?: string; scene?: string },
    private readonly events: SessionEvents,
    private readonly delays = kDelays,
  ) {}

  /** Whether a session is watched and known. */
  get watching(): boolean {
    return this.watch !== undefined && this.shown;
  }

  /** Whether the session was deleted and another one of its scene is waited for. */
  get waiting(): boolean {
    return this.deleted;
  }

  /** Finds or creates the session and watches it. Called whenever the connection is up. */
  start(): Promise<void> {
    return this.openChosen((current) => (this.deleted ? this.another() : this.choose(current)));
  }

  /** Ends the waiting after the session was deleted: a new one of its scene. */
  async createNew(): Promise<void> {
    if (!this.deleted) return;
    await this.openChosen(async () => this.remember(await this.create(this.scene, false)));
  }

  /** The connection is gone: nothing is under way any more. */
  stop(): void {
    this.epoch++;
    clearTimeout(this.retry);
    // A server that goes away deletes its sessions first: after a restart the page goes on.
    this.deleted = false;
    this.lose();
  }

  /** Leaves this session for another one, or for a new one of a scene. */
  async attach(wanted: { session?: string; scene?: string }): Promise<void> {
    this.wanted = wanted;
    this.id = undefined;
    this.scene = undefined;
    this.deleted = false;
    this.watch?.end();
    this.lose();
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

  // `choose` may find nothing yet; then it is asked again. It is told whether it still counts.
  private async openChosen(
    choose: (current: () => boolean) => Promise<string | undefined>,
  ): Promise<void> {
    const epoch = ++this.epoch;
    clearTimeout(this.retry);
    try {
      const id = await choose(() => epoch === this.epoch);
      if (epoch !== this.epoch) return;
      if (id === undefined) {
        this.tryAgain();
        return;
      }
      this.deleted = false;
      this.events.onProblem(undefined);
      this.open(id);
    } catch (error) {
      if (epoch === this.epoch) this.failed(error);
    }
  }

  private async choose(current: () => boolean): Promise<string | undefined> {
    const sessions = await this.list();
    const named = (id: string | undefined) => sessions.find(({ session }) => session === id);
    const known = named(this.id) ?? named(this.wanted.session);
    if (known) return this.remember(known);
    if (this.scene !== undefined) {
      // A server that was restarted knows nothing of what was watched, and other pages are back,
      // too: one of them creates the session, the others find it.
      await new Promise((resolve) => setTimeout(resolve, Math.random() * this.delays.restartMs));
      return current() ? this.remember(await this.create(this.scene, true)) : undefined;
    }
    const newest = sessions.at(-1);
    if (newest && !this.wanted.scene) return this.remember(newest);
    return this.remember(await this.create(this.wanted.scene, false));
  }

  /** The newest session of the scene whose session was deleted. */
  private async another(): Promise<string | undefined> {
    const found = (await this.list()).findLast(({ scene }) => scene === this.scene);
    return found && this.remember(found);
  }

  private async list(): Promise<Session[]> {
    return (await this.streams.call("listSessions", {})).sessions;
  }

  // Of a scene, else of the first that can be built. A scene that the address asks for is not
  // replaced before it was shown once. `join`: a session that is there will do.
  private async create(scene: string | undefined, join: boolean): Promise<Session> {
    const sessions = join ? await this.list() : [];
    const tried = new Set<string>();
    let problem = new Error("The server has no session and offers no scenes.");
    const attempt = async (name: string): Promise<Session | undefined> => {
      tried.add(name);
      const found = sessions.findLast((session) => session.scene === name);
      if (found) return found;
      try {
        const source = { case: "sceneName" as const, value: name };
        const { session } = await this.streams.call("createSession", { source });
        return session && join ? await this.withoutDouble(session) : session;
      } catch (error) {
        if (!(error instanceof ServiceError) || !kNoScene.includes(error.reason)) throw error;
        problem = error;
        return undefined;
      }
    };
    if (scene !== undefined) {
      const session = await attempt(scene);
      if (session) return session;
      if (this.scene === undefined) throw problem;
    }
    const { scenes } = await this.streams.call("listScenes", {});
    for (const { name } of scenes) {
      const session = tried.has(name) ? undefined : await attempt(name);
      if (session) return session;
    }
    throw problem;
  }

  // While the session was built another page may have made one, too: the first one counts.
  private async withoutDouble(made: Session): Promise<Session> {
    const first = (await this.list()).find(({ scene }) => scene === made.scene);
    if (!first || first.session === made.session) return made;
    await this.streams.call("deleteSession", { session: made.session });
    return first;
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
      this.shown = true;
      this.events.onTopology(response.value, message.session);
    } else if (response.case === "heartbeat") {
      this.state = response.value.state;
      this.events.onHeartbeat(response.value);
    }
  }

  private lose(): void {
    this.watch = undefined;
    this.shown = false;
    this.state = SessionState.UNSPECIFIED;
    this.events.onLost();
  }

  // A session that ended is left; what else went wrong is tried again.
  private failed(error: unknown): void {
    if (error instanceof ServiceError && error.reason === kConnectionLost) return;
    const text = error instanceof Error ? error.message : String(error);
    const ended = this.watch !== undefined;
    this.lose();
    if (ended && error instanceof ServiceError && kGone.includes(error.reason)) this.deleted = true;
    if (this.deleted) {
      const what = ended ? "The session was deleted." : text;
      this.events.onProblem(`${what} Waiting for another one of ${this.scene}.`, true);
    } else {
      this.events.onProblem(ended ? `The session has ended: ${text} Looking for it.` : text);
    }
    this.tryAgain();
  }

  private tryAgain(): void {
    this.retry = window.setTimeout(() => void this.start(), this.delays.retryMs);
  }
}
