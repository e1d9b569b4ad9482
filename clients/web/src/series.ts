// Rows of numbers for plots: the newest ones live, all of them for a recording.

/** Columns of equal length with time first, which never goes back; the oldest rows make room. */
export class Series {
  private readonly store: Float64Array[];
  private length = 0;

  constructor(
    columns: number,
    private readonly capacity: number,
  ) {
    this.store = Array.from({ length: columns }, () => new Float64Array(capacity));
  }

  /** A row; one that is not later than the last is left out, since plots need rising times. */
  push(...row: number[]): void {
    if (this.length > 0 && row[0] <= this.store[0][this.length - 1]) return;
    if (this.length === this.capacity) {
      // A quarter at once: moving everything for each row would cost more than drawing it.
      const kept = Math.floor(this.capacity * 0.75);
      for (const column of this.store) column.copyWithin(0, this.length - kept, this.length);
      this.length = kept;
    }
    for (let c = 0; c < this.store.length; c++) this.store[c][this.length] = row[c];
    this.length++;
  }

  clear(): void {
    this.length = 0;
  }

  get rows(): number {
    return this.length;
  }

  /** Views of what is held. */
  columns(): Float64Array[] {
    return this.store.map((column) => column.subarray(0, this.length));
  }
}
