import assert from "node:assert/strict";
import { test } from "node:test";
import { create, fromBinary, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import {
  FrameSchema,
  PositionEncoding,
  TopologySchema,
  type Frame,
} from "../src/gen/adhesim/v1/frame_pb";
import { Particles, readTriangles } from "../src/particles";

const bytesOf = (array: { buffer: ArrayBufferLike }) => new Uint8Array(array.buffer);

function topology(particles: number, rest?: Float32Array) {
  return create(TopologySchema, {
    particles,
    restPositions: rest ? bytesOf(rest) : new Uint8Array(),
  });
}

// As it arrives: its bytes fields are views into one buffer, at whatever offset they have there.
// `shift` moves them all.
function received(init: MessageInitShape<typeof FrameSchema>, shift: number): Frame {
  const wire = toBinary(FrameSchema, create(FrameSchema, init));
  const buffer = new Uint8Array(wire.length + shift);
  buffer.set(wire, shift);
  return fromBinary(FrameSchema, buffer.subarray(shift));
}

function contact(particle: number, x: number, y: number, z: number): Uint8Array {
  const view = new DataView(new ArrayBuffer(16));
  view.setUint32(0, particle, true);
  [x, y, z].forEach((value, axis) => view.setFloat32(4 + 4 * axis, value, true));
  return bytesOf(view);
}

test("Particles reads float32 positions at every alignment", () => {
  const position = new Float32Array([1, 2, 3, -4, 5.5, 1e-7]);
  const offsets = new Set<number>();
  for (let shift = 0; shift < 4; shift++) {
    const frame = received({ positions: bytesOf(position) }, shift);
    offsets.add(frame.positions.byteOffset % 4);
    const particles = new Particles(topology(2));
    particles.update(frame);
    assert.deepEqual([...particles.position], [...position]);
  }
  // Otherwise the test would show nothing.
  assert.equal(offsets.size, 4);
});

test("Particles reads 16-bit positions within the box", () => {
  const q = new Uint16Array([0, 65535, 32768, 65535, 0, 0]);
  const particles = new Particles(topology(2));
  particles.update(
    received(
      {
        encoding: PositionEncoding.Q16,
        positions: bytesOf(q),
        boxMinM: [-1, 0, 2],
        boxSizeM: [2, 4, 0],
      },
      1,
    ),
  );
  // float32 keeps 24 bits; the box is 4 m wide.
  const expected = [-1, 4, 2, 1, 0, 2];
  expected.forEach((value, i) => assert.ok(Math.abs(particles.position[i] - value) < 4e-7));
});

test("Particles takes contacts, and forgets those of the frame before", () => {
  const particles = new Particles(topology(3));
  const positions = new Uint8Array(36);
  particles.update(received({ positions, contactForces: contact(2, 0, 3, 4) }, 3));
  assert.equal(particles.contactCount, 1);
  assert.equal(particles.contactForceN[2], 5);
  assert.deepEqual([...particles.contactVectorN.subarray(0, 3)], [0, 3, 4]);
  particles.update(received({ positions, contactForces: contact(0, 1, 0, 0) }, 0));
  assert.deepEqual([...particles.contactForceN], [1, 0, 0]);
});

test("Particles takes zones, and none when the field is absent", () => {
  const particles = new Particles(topology(2));
  const positions = new Uint8Array(24);
  particles.update(received({ positions, zoneOf: bytesOf(new Int32Array([-1, 7])) }, 1));
  assert.deepEqual([...particles.zone], [-1, 7]);
  particles.update(received({ positions }, 0));
  assert.deepEqual([...particles.zone], [-1, -1]);
});

test("Particles measures displacement from rest, or from the first frame when rest is not sent", () => {
  const known = new Particles(topology(1, new Float32Array([1, 1, 1])));
  known.update(received({ positions: bytesOf(new Float32Array([1, 4, 5])) }, 0));
  assert.equal(known.displacementM(0), 5);
  const unknown = new Particles(topology(1));
  unknown.update(received({ positions: bytesOf(new Float32Array([1, 1, 1])) }, 0));
  assert.equal(unknown.displacementM(0), 0);
  unknown.update(received({ positions: bytesOf(new Float32Array([1, 1, 3])) }, 0));
  assert.equal(unknown.displacementM(0), 2);
});

test("Particles refuses frames that do not fit, and keeps what it had", () => {
  const particles = new Particles(topology(2, new Float32Array(6).fill(9)));
  const positions = new Uint8Array(24);
  const bad: MessageInitShape<typeof FrameSchema>[] = [
    {},
    { positions: new Uint8Array(23) },
    { positions, zoneOf: new Uint8Array(4) },
    { positions, strainEnergy: new Uint8Array(12) },
    { positions, contactForces: new Uint8Array(15) },
    { positions, contactForces: new Uint8Array(48) },
    { positions, contactForces: contact(2, 0, 0, 0) },
    { positions: new Uint8Array(12), encoding: PositionEncoding.Q16, boxMinM: [0, 0, 0] },
  ];
  for (const init of bad) assert.throws(() => particles.update(received(init, 0)));
  assert.deepEqual([...particles.position], new Array(6).fill(9));
});

test("readTriangles refuses corners that do not exist", () => {
  const message = create(TopologySchema, {
    particles: 3,
    triangles: bytesOf(new Uint32Array([0, 1, 2])),
  });
  assert.deepEqual([...readTriangles(message)], [0, 1, 2]);
  message.particles = 2;
  assert.throws(() => readTriangles(message), /particle 2 of 2/);
});
