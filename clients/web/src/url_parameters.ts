// What the page's address asks for.

export interface UrlParameters {
  /** Attach to this session. */
  session?: string;
  /** Create a session of this scene. */
  scene?: string;
  /** Open this recording instead of a session. */
  recording?: string;
  /** Time to show first in a recording, s. */
  atS?: number;
  /** Show nothing but the tissue, the legend and a caption. */
  picture: boolean;
  /** Colour map to start with. */
  colour?: string;
  /** Theme to start with: "light" or "dark". */
  theme?: string;
  /** What not to show at first: names of Display's toggles. */
  hide: string[];
}

export function parseUrlParameters(search: string): UrlParameters {
  const query = new URLSearchParams(search);
  const text = (name: string) => query.get(name) || undefined;
  const at = Number(query.get("at") ?? NaN);
  return {
    session: text("session"),
    scene: text("scene"),
    recording: text("recording"),
    atS: Number.isFinite(at) ? at : undefined,
    picture: query.get("picture") === "1",
    colour: text("colour"),
    theme: text("theme"),
    hide: (text("hide") ?? "").split(",").filter((name) => name !== ""),
  };
}
