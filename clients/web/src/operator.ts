// Control of one tool: taken, fed with poses, given back (InteractionService over a stream).

import type { ToolState } from "./gen/adhesim/v1/frame_pb";
import type { TargetPose } from "./driving_math";
import type { ServiceError, Stream, Streams } from "./streams";

export interface OperatorEvents {
  onTaken(tool: ToolState): void;
  onPoseRefused(message: string): void;
  /** Control is over; an error says why it was not given or was lost. */
  onEnd(error: ServiceError | undefined): void;
}

// The server takes 250 ms without a pose for a lost operator.
const kKeepAliveMs = 100;
// A screen's refresh or 125 poses a second, whichever is less.
const kLeastIntervalMs = 8;

export class Operator {
  private stream?: Stream;
  private timer = 0;
  private sequence = 0n;
  private lastSentMs = 0;
  private target?: TargetPose;
  private changed = false;

  constructor(private readonly streams: Streams) {}

  take(session: string, tool: string, events: OperatorEvents): void {
    this.stop();
    this.sequence = 0n;
    const stream = this.streams.open(
      {
        case: "interact",
        value: { request: { case: "takeControl", value: { session, tool } } },
      },
      ({ case: kind, value }) => {
        if (kind !== "interact") return;
        const { response } = value;
        if (response.case === "controlTaken" && response.value.tool) {
          this.timer = window.setInterval(() => this.send(), kKeepAliveMs);
          events.onTaken(response.value.tool);
        } else if (response.case === "poseRefused") {
          events.onPoseRefused(response.value.message);
        }
      },
      (error) => {
        if (this.stream === stream) this.stop();
        events.onEnd(error);
      },
    );
    this.stream = stream;
  }

  /** The newest target; sent with the next animation frame. */
  setTarget(target: TargetPose): void {
    this.target = target;
    this.changed = true;
  }

  /** Called once per animation frame. */
  flush(): void {
    if (this.changed && performance.now() - this.lastSentMs >= kLeastIntervalMs) this.send();
  }

  /** Gives the tool back. */
  release(): void {
    this.stream?.end();
    this.stop();
  }

  private stop(): void {
    clearInterval(this.timer);
    this.stream = undefined;
    this.target = undefined;
    this.changed = false;
  }

  private send(): void {
    if (!this.stream || !this.target) return;
    const { tip, orientation } = this.target;
    this.changed = false;
    this.lastSentMs = performance.now();
    this.stream.send({
      case: "interact",
      value: {
        request: {
          case: "pose",
          value: {
            sequence: ++this.sequence,
            clientTimeNs: BigInt(Math.round(this.lastSentMs * 1e6)),
            pose: {
              xM: tip.x,
              yM: tip.y,
              zM: tip.z,
              qw: orientation.w,
              qx: orientation.x,
              qy: orientation.y,
              qz: orientation.z,
            },
          },
        },
      },
    });
  }
}
