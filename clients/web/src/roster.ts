// Which tools somebody holds. Heartbeats say it four times a second, and may be older than what
// this page just did.

// A heartbeat that was written before the server heard of a release arrives within this time.
const kStaleMs = 300;

export class Roster {
  /** Names of the tools that an operator holds. */
  tools: string[] = [];
  private released?: { tool: string; atMs: number };

  /** This page knows that a tool is taken. */
  take(tool: string): void {
    if (!this.tools.includes(tool)) this.tools.push(tool);
    this.released = undefined;
  }

  /** This page gave a tool back. */
  release(tool: string, nowMs: number): void {
    this.tools = this.tools.filter((name) => name !== tool);
    this.released = { tool, atMs: nowMs };
  }

  /** What a heartbeat says, but for what this page knows better. */
  hear(tools: readonly string[], nowMs: number): void {
    const { released } = this;
    const stale = released !== undefined && nowMs - released.atMs < kStaleMs;
    this.tools = tools.filter((name) => !stale || name !== released.tool);
  }

  clear(): void {
    this.tools = [];
    this.released = undefined;
  }
}
