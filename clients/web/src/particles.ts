// What a frame says about particles, in arrays that live as long as the scene: nothing is allocated
// per frame.
//
// `bytes` fields are views into the received message and start at any offset, so a typed array
// cannot be laid over them; they are copied bytewise into arrays that are aligned. Frames are
// little-endian, as is every browser's machine.

import { PositionEncoding, type Frame, type Topology } from "./gen/adhesim/v1/frame_pb";

const kContactBytes = 16;

export class Particles {
  readonly count: number;
  /** Now, m. [3 x count] */
  readonly position: Float32Array<ArrayBuffer>;
  /** At the start, m; the first frame's where the server does not send it. [3 x count] */
  readonly rest: Float32Array<ArrayBuffer>;
  /** Id of the zone, -1: none. [count] */
  readonly zone: Int32Array<ArrayBuffer>;
  /** Magnitude of the contact force, N. [count] */
  readonly contactForceN: Float32Array<ArrayBuffer>;
  /** Share of the elastic energy, J. [count] */
  readonly strainEnergyJ: Float32Array<ArrayBuffer>;
  hasStrainEnergy = false;
  /** Particles in contact. */
  contactCount = 0;
  /** Their numbers. [contactCount of capacity count] */
  readonly contactParticle: Uint32Array<ArrayBuffer>;
  /** The forces of contact on them, N. [3 x contactCount] */
  readonly contactVectorN: Float32Array<ArrayBuffer>;

  private readonly positionBytes: Uint8Array;
  private readonly zoneBytes: Uint8Array;
  private readonly strainBytes: Uint8Array;
  private readonly quantised: Uint16Array<ArrayBuffer>;
  /** False until it is known where the particles are at rest. */
  restKnown: boolean;

  constructor(topology: Topology) {
    const n = topology.particles;
    this.count = n;
    this.position = new Float32Array(3 * n);
    this.rest = new Float32Array(3 * n);
    this.zone = new Int32Array(n).fill(-1);
    this.contactForceN = new Float32Array(n);
    this.strainEnergyJ = new Float32Array(n);
    this.contactParticle = new Uint32Array(n);
    this.contactVectorN = new Float32Array(3 * n);
    this.positionBytes = new Uint8Array(this.position.buffer);
    this.zoneBytes = new Uint8Array(this.zone.buffer);
    this.strainBytes = new Uint8Array(this.strainEnergyJ.buffer);
    this.quantised = new Uint16Array(3 * n);
    this.restKnown = topology.restPositions.length === 12 * n;
    if (this.restKnown) new Uint8Array(this.rest.buffer).set(topology.restPositions);
    else expectLength("rest_positions", topology.restPositions.length, 12 * n, true);
    this.position.set(this.rest);
  }

  /**
   * Takes a frame over. Throws, before anything changes, when a field does not fit the topology.
   */
  update(frame: Frame): void {
    const n = this.count;
    const q16 = frame.encoding === PositionEncoding.Q16;
    expectLength("positions", frame.positions.length, (q16 ? 6 : 12) * n, false);
    expectLength("zone_of", frame.zoneOf.length, 4 * n, true);
    expectLength("strain_energy", frame.strainEnergy.length, 4 * n, true);
    if (q16) expectLength("box_min_m", frame.boxMinM.length + frame.boxSizeM.length, 6, false);
    const contacts = this.readableContacts(frame.contactForces);

    if (q16) this.dequantise(frame);
    else this.positionBytes.set(frame.positions);
    if (!this.restKnown) {
      this.rest.set(this.position);
      this.restKnown = true;
    }
    if (frame.zoneOf.length > 0) this.zoneBytes.set(frame.zoneOf);
    else this.zone.fill(-1);
    this.hasStrainEnergy = frame.strainEnergy.length > 0;
    if (this.hasStrainEnergy) this.strainBytes.set(frame.strainEnergy);
    else this.strainEnergyJ.fill(0);
    this.updateContacts(contacts);
  }

  /** How far a particle is from where it was at rest, m. */
  displacementM(particle: number): number {
    const i = 3 * particle;
    return Math.hypot(
      this.position[i] - this.rest[i],
      this.position[i + 1] - this.rest[i + 1],
      this.position[i + 2] - this.rest[i + 2],
    );
  }

  private dequantise(frame: Frame): void {
    new Uint8Array(this.quantised.buffer).set(frame.positions);
    for (let axis = 0; axis < 3; axis++) {
      const min = frame.boxMinM[axis];
      const scale = frame.boxSizeM[axis] / 65535;
      for (let i = axis; i < this.position.length; i += 3) {
        this.position[i] = min + this.quantised[i] * scale;
      }
    }
  }

  private readableContacts(bytes: Uint8Array): DataView {
    if (bytes.length % kContactBytes !== 0 || bytes.length > kContactBytes * this.count) {
      throw new Error(
        `contact_forces has ${bytes.length} bytes; ${kContactBytes} a particle in contact`,
      );
    }
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let offset = 0; offset < bytes.length; offset += kContactBytes) {
      const particle = view.getUint32(offset, true);
      if (particle >= this.count) {
        throw new Error(`contact_forces names particle ${particle} of ${this.count}`);
      }
    }
    return view;
  }

  private updateContacts(view: DataView): void {
    for (let c = 0; c < this.contactCount; c++) this.contactForceN[this.contactParticle[c]] = 0;
    this.contactCount = view.byteLength / kContactBytes;
    for (let c = 0; c < this.contactCount; c++) {
      const offset = kContactBytes * c;
      const particle = view.getUint32(offset, true);
      const x = view.getFloat32(offset + 4, true);
      const y = view.getFloat32(offset + 8, true);
      const z = view.getFloat32(offset + 12, true);
      this.contactParticle[c] = particle;
      this.contactVectorN[3 * c] = x;
      this.contactVectorN[3 * c + 1] = y;
      this.contactVectorN[3 * c + 2] = z;
      this.contactForceN[particle] = Math.hypot(x, y, z);
    }
  }
}

/** The triangles of a topology: three particles each. Throws when they do not fit. */
export function readTriangles(topology: Topology): Uint32Array<ArrayBuffer> {
  const bytes = topology.triangles;
  if (bytes.length % 12 !== 0)
    throw new Error(`triangles has ${bytes.length} bytes; 12 a triangle`);
  const triangles = new Uint32Array(bytes.length / 4);
  new Uint8Array(triangles.buffer).set(bytes);
  for (const particle of triangles) {
    if (particle >= topology.particles) {
      throw new Error(`a triangle names particle ${particle} of ${topology.particles}`);
    }
  }
  return triangles;
}

function expectLength(field: string, length: number, expected: number, mayBeAbsent: boolean): void {
  if (length === expected || (mayBeAbsent && length === 0)) return;
  throw new Error(`${field} has ${length} bytes, not ${expected}`);
}
