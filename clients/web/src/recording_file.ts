// A recording (MCAP): frames by time, and everything else in order. Complete files are read through
// their index, a piece at a time; a file whose writer was stopped has none and is read through
// once, up to its last whole record.

import { fromBinary } from "@bufbuild/protobuf";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import type { ByteSource } from "./byte_source";
import type { Topology } from "./gen/adhesim/v1/frame_pb";
import { WatchResponseSchema, type WatchResponse } from "./gen/adhesim/v1/view_service_pb";

export interface RecordedMessage {
  topic: string;
  timeNs: bigint;
  data: Uint8Array;
}

export interface RecordedFrame {
  timeNs: bigint;
  message: WatchResponse;
}

/** Messages in order of time, and single frames by time. */
interface Store {
  startNs: bigint;
  endNs: bigint;
  /** Newest frame not later than a time. */
  frameAt(timeNs: bigint): Promise<RecordedMessage | undefined>;
  /** Oldest frame not earlier than a time. */
  frameFrom(timeNs: bigint): Promise<RecordedMessage | undefined>;
  messages(topics: readonly string[]): AsyncIterable<RecordedMessage> | Iterable<RecordedMessage>;
}

const kFrames = "/frames";
const kTopology = "/topology";
const kFrameSchema = "adhesim.v1.WatchResponse";
const kPieceBytes = 1 << 20;
const kMagic = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];
// What a file without an index may take of the memory; a minute of a large scene is about 100 MiB.
const kUnindexedBytes = 1024 * 1024 * 1024;

export class RecordingFile {
  private constructor(
    readonly topology: Topology,
    /** Says what is missing of a recording that is not whole. */
    readonly notice: string | undefined,
    private readonly store: Store,
  ) {}

  /** Throws with a sentence for a person. */
  static async open(source: ByteSource): Promise<RecordingFile> {
    await expectMagic(source);
    let store: Store;
    let notice: string | undefined;
    try {
      store = await indexedStore(source);
    } catch (error) {
      if (error instanceof ForeignFile) throw error;
      [store, notice] = await readThrough(source);
    }
    for await (const { data } of store.messages([kTopology])) {
      const { response } = fromBinary(WatchResponseSchema, data);
      if (response.case === "topology") return new RecordingFile(response.value, notice, store);
    }
    throw new ForeignFile("It holds no topology: nothing of it can be shown.");
  }

  get startNs(): bigint {
    return this.store.startNs;
  }

  get endNs(): bigint {
    return this.store.endNs;
  }

  /** The newest frame not later than a time; the first one for a time before it. */
  async frameAt(timeNs: bigint): Promise<RecordedFrame | undefined> {
    return read((await this.store.frameAt(timeNs)) ?? (await this.store.frameFrom(this.startNs)));
  }

  /** The frame nearest to a time. */
  async frameNear(timeNs: bigint): Promise<RecordedFrame | undefined> {
    const before = await this.store.frameAt(timeNs);
    const after = await this.store.frameFrom(timeNs);
    if (!before || !after) return read(before ?? after);
    return read(timeNs - before.timeNs <= after.timeNs - timeNs ? before : after);
  }

  async frameAfter(timeNs: bigint): Promise<RecordedFrame | undefined> {
    return read(await this.store.frameFrom(timeNs + 1n));
  }

  async frameBefore(timeNs: bigint): Promise<RecordedFrame | undefined> {
    return read(await this.store.frameAt(timeNs - 1n));
  }

  messages(topics: readonly string[]): AsyncIterable<RecordedMessage> | Iterable<RecordedMessage> {
    return this.store.messages(topics);
  }
}

/** The file is no recording of ours. */
class ForeignFile extends Error {}

function read(message: RecordedMessage | undefined): RecordedFrame | undefined {
  return (
    message && { timeNs: message.timeNs, message: fromBinary(WatchResponseSchema, message.data) }
  );
}

async function expectMagic(source: ByteSource): Promise<void> {
  const size = await source.size();
  const head = await source.read(0n, size < 8n ? size : 8n);
  if (head.length < 8 || kMagic.some((byte, i) => head[i] !== byte)) {
    throw new ForeignFile(
      size === 0n ? "The file is empty." : "This is not a recording: it is no MCAP file.",
    );
  }
}

function expectFrames(channels: Iterable<{ topic: string; schema?: string }>): void {
  for (const { topic, schema } of channels) {
    if (topic === kFrames && schema === kFrameSchema) return;
  }
  throw new ForeignFile(
    `This MCAP file is not a recording of adhesim: it has no channel ${kFrames} of ${kFrameSchema}.`,
  );
}

async function indexedStore(source: ByteSource): Promise<Store> {
  const reader = await McapIndexedReader.Initialize({
    readable: source,
    messageIndexCacheSizeBytes: 16 << 20,
  });
  expectFrames(
    [...reader.channelsById.values()].map(({ topic, schemaId }) => ({
      topic,
      schema: reader.schemasById.get(schemaId)?.name,
    })),
  );
  if (reader.chunkIndexes.length === 0) throw new Error("no chunks");
  const topics = new Map([...reader.channelsById.values()].map(({ id, topic }) => [id, topic]));
  const message = (record: {
    channelId: number;
    logTime: bigint;
    data: Uint8Array;
  }): RecordedMessage => ({
    topic: topics.get(record.channelId) ?? "",
    timeNs: record.logTime,
    data: record.data,
  });
  const first = async (args: Parameters<typeof reader.readMessages>[0]) => {
    for await (const record of reader.readMessages({ topics: [kFrames], ...args }))
      return message(record);
    return undefined;
  };
  const [startNs, endNs] = [reader.statistics!.messageStartTime, reader.statistics!.messageEndTime];
  return {
    startNs,
    endNs,
    frameAt: (timeNs) => first({ endTime: timeNs, reverse: true }),
    frameFrom: (timeNs) => first({ startTime: timeNs }),
    async *messages(wanted) {
      for await (const record of reader.readMessages({ topics: wanted })) yield message(record);
    },
  };
}

// Reads records until the file ends or a record is damaged, and keeps the messages.
async function readThrough(source: ByteSource): Promise<[Store, string]> {
  const size = await source.size();
  const reader = new McapStreamReader({ noMagicPrefix: true });
  const channels = new Map<number, { topic: string; schemaId: number }>();
  const schemas = new Map<number, string>();
  const kept: RecordedMessage[] = [];
  let bytes = 0;
  const take = (records: Uint8Array) => {
    reader.append(records);
    for (let record; (record = reader.nextRecord());) {
      if (record.type === "Schema") schemas.set(record.id, record.name);
      else if (record.type === "Channel") channels.set(record.id, record);
      else if (record.type === "Message") {
        // The reader uses its buffer again.
        const data = record.data.slice();
        bytes += data.length;
        kept.push({
          topic: channels.get(record.channelId)?.topic ?? "",
          timeNs: record.logTime,
          data,
        });
      }
    }
  };
  const split = new RecordSplitter();
  let damage = "";
  try {
    for (let offset = BigInt(kMagic.length); offset < size; offset += BigInt(kPieceBytes)) {
      const length = size - offset < kPieceBytes ? size - offset : BigInt(kPieceBytes);
      take(split.add(await source.read(offset, length)));
      if (bytes > kUnindexedBytes) {
        damage = "This recording was not finished and is too large to be read without its index.";
      }
      if (damage || split.held > kUnindexedBytes) break;
    }
    if (!damage) take(recordsOfPartialChunk(split.rest()));
  } catch (error) {
    damage = `This recording is damaged: ${inWords(error)}.`;
  }
  expectFrames(
    [...channels.values()].map(({ topic, schemaId }) => ({ topic, schema: schemas.get(schemaId) })),
  );
  const store = memoryStore(kept);
  const until = (Number(store.endNs) / 1e9).toFixed(2);
  const what = damage || "This recording was not finished.";
  return [store, `${what} Shown up to its last whole record, at ${until} s.`];
}

// A record: opcode (1 byte), length of its content (8 bytes), content.
const kPrefixBytes = 9;
const kChunkOpcode = 0x06;
// Of a chunk's content, what stands before its records when they are not compressed: first and
// last time, size, checksum, the length of an empty name, length of the records.
const kChunkHeadBytes = 8 + 8 + 8 + 4 + 4 + 8;
const kCompressionOffset = 8 + 8 + 8 + 4;

/** The length of the record that begins at a place, with its prefix; Infinity without a prefix. */
function recordBytes(bytes: Uint8Array, at: number): number {
  if (bytes.length - at < kPrefixBytes) return Infinity;
  const view = new DataView(bytes.buffer, bytes.byteOffset + at, kPrefixBytes);
  return kPrefixBytes + Number(view.getBigUint64(1, true));
}

/** Where the last whole record ends, of records that begin at a place. */
function endOfWhole(bytes: Uint8Array, begin: number): number {
  let at = begin;
  for (let next; (next = at + recordBytes(bytes, at)) <= bytes.length;) at = next;
  return at;
}

/** Takes a file in pieces and gives it in whole records; knows what is left at the end. */
class RecordSplitter {
  /** Bytes that wait for the rest of their record. */
  held = 0;
  private pieces: Uint8Array[] = [];
  private needed = kPrefixBytes;

  add(piece: Uint8Array): Uint8Array {
    this.pieces.push(piece);
    this.held += piece.length;
    // Joined once a record, not once a piece: a record may be as long as the file.
    if (this.held < this.needed) return new Uint8Array();
    const bytes = this.rest();
    const whole = endOfWhole(bytes, 0);
    const left = bytes.subarray(whole);
    this.pieces = [left];
    this.held = left.length;
    const next = recordBytes(left, 0);
    this.needed = next === Infinity ? kPrefixBytes : next;
    return bytes.subarray(0, whole);
  }

  rest(): Uint8Array {
    const bytes = new Uint8Array(this.held);
    let at = 0;
    for (const piece of this.pieces) {
      bytes.set(piece, at);
      at += piece.length;
    }
    return bytes;
  }
}

/** The whole records of a chunk that was cut short; none of anything else. */
function recordsOfPartialChunk(bytes: Uint8Array): Uint8Array {
  const begin = kPrefixBytes + kChunkHeadBytes;
  if (bytes[0] !== kChunkOpcode || bytes.length < begin) return new Uint8Array();
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const compressed = view.getUint32(kPrefixBytes + kCompressionOffset, true) !== 0;
  if (compressed) return new Uint8Array();
  return bytes.subarray(begin, endOfWhole(bytes, begin));
}

/** What the reader says, without the name of the program that wrote the file. */
export function inWords(error: unknown): string {
  const text = error instanceof Error ? error.message : String(error);
  return text.replace(/ \[library=.*\]$/, "");
}

function memoryStore(kept: RecordedMessage[]): Store {
  const frames = kept.filter(({ topic }) => topic === kFrames);
  if (frames.length === 0) throw new ForeignFile("This recording ends before its first frame.");
  // The number of frames that are not later than a time.
  const until = (timeNs: bigint) => {
    let low = 0;
    let high = frames.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (frames[middle].timeNs <= timeNs) low = middle + 1;
      else high = middle;
    }
    return low;
  };
  return {
    startNs: kept[0].timeNs,
    endNs: kept.reduce((end, { timeNs }) => (timeNs > end ? timeNs : end), 0n),
    frameAt: async (timeNs) => frames[until(timeNs) - 1],
    frameFrom: async (timeNs) => frames[until(timeNs - 1n)],
    messages: (topics) => kept.filter(({ topic }) => topics.includes(topic)),
  };
}
