// Colours for numbers: a perceptually uniform scale for quantities, distinct colours for ids. Both
// keep their order or difference for colour-blind eyes (viridis; Okabe and Ito 2008).

import type { Particles } from "./particles";

export type ColourMapName = "none" | "displacement" | "contact-force" | "strain-energy" | "zone";

export interface ColourMap {
  name: ColourMapName;
  label: string;
  /** Unit of the legend. */
  unit: string;
  /** Legend units per SI unit. */
  scale: number;
}

export const kColourMaps: readonly ColourMap[] = [
  { name: "none", label: "none", unit: "", scale: 1 },
  { name: "displacement", label: "displacement", unit: "mm", scale: 1000 },
  { name: "contact-force", label: "contact force", unit: "N", scale: 1 },
  { name: "strain-energy", label: "strain energy", unit: "J", scale: 1 },
  { name: "zone", label: "zone", unit: "", scale: 1 },
];

export function colourMap(name: string): ColourMap {
  return kColourMaps.find((map) => map.name === name) ?? kColourMaps[0];
}

/** Entries of the table. */
export const kShades = 256;

// Sixth-degree fits to matplotlib's viridis (van der Walt and Smith 2015), coefficients by Matt
// Zucker (public domain); within 0.01 of the original.
const kViridis = [
  [0.2777273272234177, 0.005407344544966578, 0.3340998053353061],
  [0.1050930431085774, 1.404613529898575, 1.384590162594685],
  [-0.3308618287255563, 0.214847559468213, 0.09509516302823659],
  [-4.634230498983486, -5.799100973351585, -19.33244095627987],
  [6.228269936347081, 14.17993336680509, 56.69055260068105],
  [4.776384997670288, -13.74514537774601, -65.35303263337234],
  [-5.435455855934631, 4.645852612178535, 26.3124352495832],
];

/** The scale's colour at t in [0, 1]: sRGB, each 0 to 1. */
export function viridis(t: number): [number, number, number] {
  const at = Math.min(1, Math.max(0, t));
  const channel = (c: number) => {
    let value = 0;
    for (let power = kViridis.length - 1; power >= 0; power--)
      value = value * at + kViridis[power][c];
    return Math.min(1, Math.max(0, value));
  };
  return [channel(0), channel(1), channel(2)];
}

/** One channel of sRGB as a linear value, which is what lighting is computed with. */
export function srgbToLinear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

/** "#rrggbb" as linear values. */
export function linearOfHex(hex: string): [number, number, number] {
  const value = Number.parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255].map((c) => srgbToLinear(c / 255)) as [
    number,
    number,
    number,
  ];
}

const kLinearViridis = (() => {
  const table = new Float32Array(3 * kShades);
  for (let shade = 0; shade < kShades; shade++) {
    table.set(viridis(shade / (kShades - 1)).map(srgbToLinear), 3 * shade);
  }
  return table;
})();

/** Colours of ids, "#rrggbb". */
export const kZoneColours = [
  "#e69f00",
  "#56b4e9",
  "#009e73",
  "#f0e442",
  "#0072b2",
  "#d55e00",
  "#cc79a7",
];
/** Colour of particles in no zone. */
export const kNoZoneColour = "#8d8d8d";

const kLinearZones = kZoneColours.map(linearOfHex);
const kLinearNoZone = linearOfHex(kNoZoneColour);

/** The colour of a zone id, linear; -1 is no zone. */
export function zoneColour(id: number): readonly number[] {
  return id < 0 ? kLinearNoZone : kLinearZones[id % kLinearZones.length];
}

/** Writes the quantity of a map for each particle, in SI units. */
export function readValues(name: ColourMapName, particles: Particles, values: Float32Array): void {
  if (name === "displacement") {
    for (let p = 0; p < particles.count; p++) values[p] = particles.displacementM(p);
  } else if (name === "contact-force") {
    values.set(particles.contactForceN);
  } else if (name === "strain-energy") {
    values.set(particles.strainEnergyJ);
  } else {
    values.fill(0);
  }
}

export interface Range {
  min: number;
  max: number;
}

/**
 * A range for the legend: 0 to the next round number above the greatest value. Rounding keeps the
 * colours calm from frame to frame without any memory of earlier ones.
 */
export function niceRange(values: Float32Array): Range {
  let max = 0;
  for (const value of values) if (value > max) max = value;
  return { min: 0, max: niceCeiling(max) };
}

/** The least of 1, 1.5, 2, 3, 5, 7.5 times a power of ten that is not below `value`; 0 for 0. */
export function niceCeiling(value: number): number {
  if (!(value > 0) || !Number.isFinite(value)) return 0;
  const power = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 1.5, 2, 3, 5, 7.5, 10]) {
    // A hair of tolerance, so that 0.3 does not become 0.5 by its last bit.
    if (step * power >= value * (1 - 1e-9)) return step * power;
  }
  return 10 * power;
}

/** Writes linear colours [3 x #values] for values in a range. */
export function paintValues(values: Float32Array, range: Range, colours: Float32Array): void {
  const scale = range.max > range.min ? (kShades - 1) / (range.max - range.min) : 0;
  for (let p = 0; p < values.length; p++) {
    const shade =
      3 * Math.min(kShades - 1, Math.max(0, Math.round((values[p] - range.min) * scale)));
    colours[3 * p] = kLinearViridis[shade];
    colours[3 * p + 1] = kLinearViridis[shade + 1];
    colours[3 * p + 2] = kLinearViridis[shade + 2];
  }
}

/** Writes the colours of zones [3 x #particles]. */
export function paintZones(zone: Int32Array, colours: Float32Array): void {
  for (let p = 0; p < zone.length; p++) {
    const colour = zoneColour(zone[p]);
    colours[3 * p] = colour[0];
    colours[3 * p + 1] = colour[1];
    colours[3 * p + 2] = colour[2];
  }
}
