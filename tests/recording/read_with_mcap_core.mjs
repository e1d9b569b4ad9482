// Reads a recording with @mcap/core, the reader that other people's tools use, and checks what it promises.
//
//   node read_with_mcap_core.mjs FILE.mcap
//
// Prints one JSON object and ends with 0 when all is right, else with 1. Needs the npm packages @mcap/core and
// @bufbuild/protobuf; they are looked for from this script upwards, in clients/web, and
// in the current directory.
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import process from 'node:process';

function load(name) {
  const viewer = new URL('../../clients/web/index.js', import.meta.url);
  for (const from of [import.meta.url, viewer, path.join(process.cwd(), 'index.js')]) {
    try {
      return createRequire(from)(name);
    } catch (error) {
      if (error.code !== 'MODULE_NOT_FOUND') throw error;
    }
  }
  throw new Error(`the npm package ${name} is not installed`);
}

const { McapIndexedReader, McapStreamReader } = load('@mcap/core');
const { createFileRegistry, fromBinary } = load('@bufbuild/protobuf');
const { FileDescriptorSetSchema } = load('@bufbuild/protobuf/wkt');

const SCHEMAS = {
  '/topology': 'adhesim.v1.WatchResponse',
  '/frames': 'adhesim.v1.WatchResponse',
  '/inputs': 'adhesim.v1.StepInputs',
  '/hashes': 'adhesim.v1.StateHashes',
  '/forces': 'adhesim.v1.ToolForces',
  '/events': 'adhesim.v1.Event',
};
const METADATA = ['build', 'format', 'rate_hz', 'scene', 'scene_name', 'seed', 'version'];

const problems = [];
function expect(condition, what) {
  if (!condition) problems.push(what);
}

// The message type of a schema, from the descriptors in the file alone.
function decoderOf(schema) {
  expect(schema.encoding === 'protobuf', `schema ${schema.name} is encoded as ${schema.encoding}`);
  const files = createFileRegistry(fromBinary(FileDescriptorSetSchema, schema.data));
  const type = files.getMessage(schema.name);
  return (data) => fromBinary(type, data);
}

function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (0xedb88320 & -(crc & 1));
  }
  return ~crc >>> 0;
}

// Front to back, checksums of chunks included: how many messages of each channel.
function readAsStream(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(bytes);
  const counts = new Map();
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) {
    if (record.type === 'Message') {
      counts.set(record.channelId, (counts.get(record.channelId) ?? 0) + 1);
    }
    if (record.type === 'Attachment') {
      expect(record.data.byteLength > 0, `attachment ${record.name} is empty`);
    }
  }
  expect(reader.done(), 'the stream reader does not find the end of the file');
  return counts;
}

// Through the index, decoded; in the order of the file's times.
async function readIndexed(bytes) {
  const readable = {
    size: async () => BigInt(bytes.byteLength),
    read: async (offset, size) =>
      new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const decoders = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    expect(schema?.name === SCHEMAS[channel.topic], `${channel.topic} has schema ${schema?.name}`);
    expect(channel.messageEncoding === 'protobuf', `${channel.topic}: ${channel.messageEncoding}`);
    decoders.set(channel.id, decoderOf(schema));
  }
  const topics = [...reader.channelsById.values()].map((channel) => channel.topic).sort();
  expect(topics.join() === Object.keys(SCHEMAS).sort().join(), `channels are ${topics}`);

  const found = { counts: new Map(), steps: 0n, frames: 0, lastTime: 0n };
  for await (const message of reader.readMessages()) {
    found.counts.set(message.channelId, (found.counts.get(message.channelId) ?? 0) + 1);
    expect(message.logTime >= found.lastTime, `time goes back at ${message.logTime}`);
    expect(message.logTime === message.publishTime, `times differ at ${message.logTime}`);
    found.lastTime = message.logTime;
    const decode = decoders.get(message.channelId);
    check(reader.channelsById.get(message.channelId).topic, decode(message.data), found);
  }
  await checkMetadata(reader);
  return { reader, found };
}

// What one message must be, beside decodable.
function check(topic, message, found) {
  if (topic === '/topology') {
    const topology = message.response.value;
    found.particles = topology.particles;
    expect(found.frames === 0, 'the topology comes after a frame');
    expect(topology.restPositions.length === 12 * found.particles, 'rest positions');
  }
  if (topic === '/frames') {
    ++found.frames;
    const frame = message.response.value;
    expect(frame.positions.length === 12 * found.particles, `frame ${found.frames}`);
  }
  if (topic === '/hashes') {
    expect(message.firstIndex === found.steps + 1n,
      `hashes from ${message.firstIndex} after ${found.steps} steps`);
    found.steps += BigInt(message.hashes.length);
  }
}

async function checkMetadata(reader) {
  let found;
  for await (const record of reader.readMetadata({ name: 'adhesim' })) found = record.metadata;
  expect(found, 'no metadata record "adhesim"');
  for (const key of METADATA) expect(found?.has(key), `metadata has no ${key}`);
  let scene;
  for await (const attachment of reader.readAttachments({ name: 'scene.binpb' })) scene = attachment;
  expect(scene?.data.byteLength > 0, 'no attachment scene.binpb');
}

const bytes = new Uint8Array(await readFile(process.argv[2]));
const streamed = readAsStream(bytes);
const { reader, found } = await readIndexed(bytes);
const { statistics } = reader;
let total = 0n;
for (const channel of reader.channelsById.values()) {
  const promised = statistics.channelMessageCounts.get(channel.id) ?? 0n;
  total += promised;
  for (const [way, counts] of [['stream', streamed], ['index', found.counts]]) {
    const counted = counts.get(channel.id) ?? 0;
    expect(BigInt(counted) === promised,
      `${channel.topic}: ${counted} messages by ${way}, the statistics say ${promised}`);
  }
}
expect(total === statistics.messageCount, `${statistics.messageCount} messages in all, not ${total}`);
expect(statistics.messageEndTime === found.lastTime, 'the last time differs from the statistics');
expect(statistics.chunkCount === reader.chunkIndexes.length, 'chunks without an index');
// The footer's checksum, which the library leaves to its user: from the summary's start.
const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const crcAt = bytes.byteLength - 12;
const summaryStart = Number(view.getBigUint64(crcAt - 16, true));
expect(view.getUint32(crcAt, true) === crc32(bytes.subarray(summaryStart, crcAt)),
  'the checksum of the summary is wrong');

console.log(JSON.stringify({
  file: process.argv[2],
  messages: Number(total),
  steps: Number(found.steps),
  frames: found.frames,
  particles: found.particles,
  chunks: statistics.chunkCount,
  seconds: Number(found.lastTime) / 1e9,
  problems: problems.slice(0, 20),
}));
process.exit(problems.length === 0 ? 0 : 1);
