import assert from "node:assert/strict";
import { test } from "node:test";
import { create, toBinary } from "@bufbuild/protobuf";
import { McapWriter, type IWritable } from "@mcap/core";
import { blobSource } from "../src/byte_source";
import { WatchResponseSchema } from "../src/gen/adhesim/v1/view_service_pb";
import { RecordingFile } from "../src/recording_file";

// 60 frames a second, in chunks of several frames.
const kFrames = 200;
const kPeriodNs = 16_666_667n;

class Memory implements IWritable {
  private readonly pieces: Uint8Array[] = [];
  private size = 0n;
  async write(piece: Uint8Array): Promise<void> {
    this.pieces.push(piece.slice());
    this.size += BigInt(piece.length);
  }
  position(): bigint {
    return this.size;
  }
  bytes(): Uint8Array<ArrayBuffer> {
    return new Uint8Array(Buffer.concat(this.pieces));
  }
}

interface Contents {
  frames: number;
  topology: boolean;
  schema: string;
  chunkSize: number;
}

async function record(contents: Partial<Contents> = {}): Promise<Uint8Array<ArrayBuffer>> {
  const { frames, topology, schema, chunkSize } = {
    frames: kFrames,
    topology: true,
    schema: "adhesim.v1.WatchResponse",
    chunkSize: 4096,
    ...contents,
  };
  const memory = new Memory();
  const writer = new McapWriter({ writable: memory, chunkSize });
  await writer.start({ profile: "", library: "test" });
  const schemaId = await writer.registerSchema({
    name: schema,
    encoding: "protobuf",
    data: new Uint8Array(),
  });
  const channel = (topic: string) =>
    writer.registerChannel({ topic, schemaId, messageEncoding: "protobuf", metadata: new Map() });
  const channels = { topology: await channel("/topology"), frames: await channel("/frames") };
  const add = (channelId: number, timeNs: bigint, message: Parameters<typeof toBinary>[1]) =>
    writer.addMessage({
      channelId,
      sequence: 0,
      logTime: timeNs,
      publishTime: timeNs,
      data: toBinary(WatchResponseSchema, message as never),
    });
  if (topology) {
    const value = { particles: 2, scene: "test" };
    await add(
      channels.topology,
      0n,
      create(WatchResponseSchema, { response: { case: "topology", value } }),
    );
  }
  for (let i = 0; i < frames; i++) {
    const value = { positions: new Uint8Array(new Float32Array([i, 0, 0, 0, i, 0]).buffer) };
    const message = { step: BigInt(i), timeS: i / 60, response: { case: "frame" as const, value } };
    await add(channels.frames, BigInt(i) * kPeriodNs, create(WatchResponseSchema, message));
  }
  await writer.end();
  return memory.bytes();
}

const open = (bytes: Uint8Array<ArrayBuffer>) => RecordingFile.open(blobSource(new Blob([bytes])));

async function stepAt(file: RecordingFile, timeNs: bigint): Promise<number> {
  return Number((await file.frameAt(timeNs))!.message.step);
}

async function expectFramesByTime(file: RecordingFile): Promise<void> {
  assert.equal(await stepAt(file, 0n), 0);
  assert.equal(await stepAt(file, -5n), 0);
  assert.equal(await stepAt(file, 10n * kPeriodNs), 10);
  assert.equal(await stepAt(file, 11n * kPeriodNs - 1n), 10);
  assert.equal(Number((await file.frameNear(11n * kPeriodNs - 2n))!.message.step), 11);
  assert.equal(Number((await file.frameNear(10n * kPeriodNs + 2n))!.message.step), 10);
  assert.equal(Number((await file.frameAfter(10n * kPeriodNs))!.message.step), 11);
  assert.equal(Number((await file.frameBefore(10n * kPeriodNs))!.message.step), 9);
  assert.equal(await file.frameBefore(0n).then((frame) => Number(frame?.message.step ?? -1)), -1);
}

test("RecordingFile finds frames by time through the index", async () => {
  const file = await open(await record());
  assert.equal(file.notice, undefined);
  assert.equal(file.topology.scene, "test");
  assert.equal(file.endNs, BigInt(kFrames - 1) * kPeriodNs);
  await expectFramesByTime(file);
  assert.equal(await stepAt(file, file.endNs * 2n), kFrames - 1);
  assert.equal(await file.frameAfter(file.endNs), undefined);
});

test("RecordingFile opens a file cut anywhere up to its last whole record", async () => {
  const bytes = await record();
  let before = -1;
  for (const part of [0.3, 0.5, 0.75, 0.99]) {
    const file = await open(bytes.slice(0, Math.floor(part * bytes.length)));
    assert.match(file.notice!, /not finished/);
    await expectFramesByTime(file);
    const last = await stepAt(file, file.endNs);
    assert.ok(last >= before && last < kFrames);
    before = last;
  }
});

/** Where each frame's message ends in a file, found without the reader: by its own bytes. */
function endsOfFrames(bytes: Uint8Array): number[] {
  const ends: number[] = [];
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const length = (at: number) => Number(view.getBigUint64(at + 1, true));
  for (let at = 8; at + 9 <= bytes.length - 8; at += 9 + length(at)) {
    if (bytes[at] !== 0x06) continue;
    // Of an uncompressed chunk, 40 bytes stand before the records.
    const end = at + 9 + length(at);
    for (let inner = at + 9 + 40; inner < end; inner += 9 + length(inner)) {
      // A message of the second channel.
      if (bytes[inner] === 0x05 && view.getUint16(inner + 9, true) === 1) {
        ends.push(inner + 9 + length(inner));
      }
    }
  }
  return ends;
}

test("RecordingFile shows every whole frame of a file cut in the middle of a chunk", async () => {
  const bytes = await record();
  const ends = endsOfFrames(bytes);
  assert.equal(ends.length, kFrames);
  const end = ends.at(-1)!;
  const cuts = new Set([end - 1, end, end + 1]);
  for (let i = 0; i < kFrames; i += 7)
    cuts
      .add(ends[i])
      .add(ends[i] - 1)
      .add(ends[i] + 1);
  for (let cut = ends[0]; cut <= end; cut += 61) cuts.add(cut);
  for (const cut of cuts) {
    if (cut < ends[0]) continue;
    const whole = ends.filter((place) => place <= cut).length;
    const file = await open(bytes.slice(0, cut));
    const frames = [...((await file.messages(["/frames"])) as Iterable<unknown>)];
    assert.equal(frames.length, whole, `cut at ${cut}`);
    assert.equal(file.endNs, BigInt(whole - 1) * kPeriodNs);
    const until = (Number(file.endNs) / 1e9).toFixed(2);
    assert.match(file.notice!, new RegExp(`not finished.* at ${until} s`));
  }
});

test("RecordingFile reads records that are longer than the pieces it reads", async () => {
  // One chunk of several pieces, cut short.
  const bytes = await record({ frames: 30000, chunkSize: 1 << 30 });
  const ends = endsOfFrames(bytes);
  assert.ok(ends[25000] > 1 << 20);
  const file = await open(bytes.slice(0, ends[25000] + 3));
  assert.equal(file.endNs, 25000n * kPeriodNs);
});

test("RecordingFile says that a file is no recording", async () => {
  await assert.rejects(open(new Uint8Array()), /empty/);
  await assert.rejects(open(new TextEncoder().encode("PK not an mcap file")), /no MCAP file/);
  await assert.rejects(
    open(await record({ schema: "foxglove.PointCloud" })),
    /not a recording of adhesim/,
  );
  await assert.rejects(open(await record({ topology: false })), /no topology/);
  await assert.rejects(open((await record()).slice(0, 60)), /not a recording|ends before|damaged/);
});

test("RecordingFile survives damage at any place: it opens with a notice, refuses, or fails on the frame", async () => {
  const bytes = await record();
  for (let place = 9; place < bytes.length; place += Math.floor(bytes.length / 40)) {
    const damaged = bytes.slice();
    damaged[place] ^= 0xff;
    try {
      const file = await open(damaged);
      for (let i = 0; i < kFrames; i += 20) await file.frameAt(BigInt(i) * kPeriodNs);
    } catch (error) {
      assert.ok(error instanceof Error && error.message.length > 0);
    }
  }
});
