// The last frames of a live session, for stepping back.

import type { Frame } from "./gen/adhesim/v1/frame_pb";

/** A frame and when it is from. */
export interface Sample {
  session: string;
  step: number;
  timeS: number;
  frame: Frame;
}

const kFrames = 600;
const kBytes = 128 * 1024 * 1024;

/**
 * Bounded by number and by size: the oldest goes first. Numbers of samples go on rising, so that a
 * place stays a place.
 */
export class History {
  private readonly samples: (Sample | undefined)[];
  private end = 0;
  private begin = 0;
  private held = 0;

  constructor(
    private readonly capacity = kFrames,
    private readonly capacityBytes = kBytes,
  ) {
    this.samples = new Array(capacity);
  }

  /** Number of the oldest sample. */
  get oldest(): number {
    return this.begin;
  }

  /** Number of the newest sample; below `oldest` when there is none. */
  get newest(): number {
    return this.end - 1;
  }

  get bytes(): number {
    return this.held;
  }

  push(sample: Sample): void {
    if (this.end - this.begin === this.capacity) this.drop();
    this.samples[this.end % this.capacity] = sample;
    this.end++;
    this.held += sampleBytes(sample);
    while (this.held > this.capacityBytes && this.end - this.begin > 1) this.drop();
  }

  /** The sample of this number, while it is kept. */
  at(number: number): Sample | undefined {
    return number >= this.begin && number < this.end
      ? this.samples[number % this.capacity]
      : undefined;
  }

  clear(): void {
    this.samples.fill(undefined);
    this.begin = this.end;
    this.held = 0;
  }

  private drop(): void {
    const place = this.begin % this.capacity;
    this.held -= sampleBytes(this.samples[place]!);
    this.samples[place] = undefined;
    this.begin++;
  }
}

// The fields of a frame are views into one received message, which lives as long as any of them.
function sampleBytes(sample: Sample): number {
  return sample.frame.positions.buffer.byteLength;
}
