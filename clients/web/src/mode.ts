// What the transport and the keys act on: a live session or a recording.

import type { TransportState } from "./transport";

export interface Mode {
  /** Once per animation frame. */
  tick(nowMs: number): void;
  transport(): TransportState;
  play(): void;
  forward(): void;
  back(): void;
  reset(): void;
}
