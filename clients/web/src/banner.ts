// The one line above the view that says what is wrong or unusual. Several things may be; the most
// urgent is shown.

import { byId, create, onClick, setText } from "./dom";

/** The most urgent first. What a person just did, and what came of it, goes before what lasts. */
const kTopics = [
  "graphics",
  "opening",
  "connection",
  "session",
  "recording",
  "control",
  "history",
] as const;
export type Topic = (typeof kTopics)[number];
export type Level = "info" | "warning" | "error";
/** What one can do about it. */
export interface Offer {
  label: string;
  run(): void;
}

export class Banner {
  private readonly root = byId("banner");
  private readonly text = create("span");
  private readonly button = create("button", { type: "button", hidden: true });
  private readonly said = new Map<Topic, { text: string; level: Level; offer?: Offer }>();
  private readonly timers = new Map<Topic, number>();

  constructor() {
    this.root.append(this.text, this.button);
    onClick(this.button, () => this.said.get(this.topic!)?.offer?.run());
  }

  /** Says a sentence on a topic, or nothing any more; with `forMs` only for a while. */
  set(
    topic: Topic,
    text: string | undefined,
    level: Level = "warning",
    forMs = 0,
    offer?: Offer,
  ): void {
    clearTimeout(this.timers.get(topic));
    if (text === undefined) this.said.delete(topic);
    else this.said.set(topic, { text, level, offer });
    if (forMs > 0)
      this.timers.set(
        topic,
        window.setTimeout(() => this.set(topic, undefined), forMs),
      );
    this.write();
  }

  /** The topic that is shown. */
  private get topic(): Topic | undefined {
    return kTopics.find((candidate) => this.said.has(candidate));
  }

  private write(): void {
    const { topic } = this;
    this.root.hidden = topic === undefined;
    if (topic === undefined) return;
    const { text, level, offer } = this.said.get(topic)!;
    setText(this.text, text);
    this.button.hidden = offer === undefined;
    setText(this.button, offer?.label ?? "");
    this.root.dataset.level = level;
  }
}
