// Simulated time over wall time, and events over wall time, of the last second or so.

export class RateMeter {
  private readonly entries: { value: number; wallMs: number }[] = [];

  constructor(private readonly windowMs = 1000) {}

  add(value: number, wallMs: number): void {
    const last = this.entries.at(-1);
    // A reset goes back: rates begin anew.
    if (last && value < last.value) this.entries.length = 0;
    this.entries.push({ value, wallMs });
    while (this.entries.length > 2 && this.entries[0].wallMs < wallMs - this.windowMs)
      this.entries.shift();
  }

  /** Value per second; 0 when nothing came for a window's time. */
  perSecond(nowMs: number): number {
    const first = this.entries[0];
    const last = this.entries.at(-1);
    if (!first || !last || last.wallMs <= first.wallMs || nowMs - last.wallMs > this.windowMs)
      return 0;
    return ((last.value - first.value) * 1000) / (last.wallMs - first.wallMs);
  }

  clear(): void {
    this.entries.length = 0;
  }
}
