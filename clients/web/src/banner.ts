// The one line above the view that says what is wrong or unusual. Several things may be; the most
// urgent is shown.

import { byId, setText } from "./dom";

/** The most urgent first. */
const kTopics = ["graphics", "connection", "session", "recording", "control", "history"] as const;
export type Topic = (typeof kTopics)[number];
export type Level = "info" | "warning" | "error";

export class Banner {
  private readonly root = byId("banner");
  private readonly said = new Map<Topic, { text: string; level: Level }>();
  private readonly timers = new Map<Topic, number>();

  /** Says a sentence on a topic, or nothing any more; with `forMs` only for a while. */
  set(topic: Topic, text: string | undefined, level: Level = "warning", forMs = 0): void {
    clearTimeout(this.timers.get(topic));
    if (text === undefined) this.said.delete(topic);
    else this.said.set(topic, { text, level });
    if (forMs > 0)
      this.timers.set(
        topic,
        window.setTimeout(() => this.set(topic, undefined), forMs),
      );
    this.write();
  }

  private write(): void {
    const topic = kTopics.find((candidate) => this.said.has(candidate));
    this.root.hidden = topic === undefined;
    if (topic === undefined) return;
    const { text, level } = this.said.get(topic)!;
    setText(this.root, text);
    this.root.dataset.level = level;
  }
}
