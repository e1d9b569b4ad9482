// window.adhesim: what tests and the picture maker read and call.

export interface Hooks {
  framesReceived: number;
  framesShown: number;
  /** Of the frame that is shown. */
  step: number;
  timeS: number;
  session: string;
  mode: "live" | "history" | "recording";
  colourMap: string;
  /** Pictures drawn in the last second. */
  fps: number;
  /** Time that this page's own code took for the last frame, ms, averaged. */
  frameMs: number;
  /** From the start of navigation to the first frame, ms. */
  firstFrameMs: number;
  hud: { step: number; forceN: number; depthM: number };
  /** What went wrong without stopping the page; the first hundred. */
  errors: string[];
  /** Shows the recorded frame of a time, s; resolves when it has been painted. */
  showAt(timeS: number): Promise<{ step: number; timeS: number }>;
  /** The 3-D picture, RGBA, rows from the bottom. */
  pixels(): { width: number; height: number; data: Uint8Array };
}

declare global {
  interface Window {
    adhesim: Hooks;
  }
}

const kErrors = 100;

export function installHooks(hooks: Pick<Hooks, "showAt" | "pixels">): Hooks {
  window.adhesim = {
    framesReceived: 0,
    framesShown: 0,
    step: 0,
    timeS: 0,
    session: "",
    mode: "live",
    colourMap: "none",
    fps: 0,
    frameMs: 0,
    firstFrameMs: 0,
    hud: { step: 0, forceN: 0, depthM: 0 },
    errors: [],
    ...hooks,
  };
  return window.adhesim;
}

/** Counts an error without disturbing anything. */
export function recordError(error: unknown): void {
  const { errors } = window.adhesim;
  if (errors.length < kErrors) errors.push(error instanceof Error ? error.message : String(error));
}
