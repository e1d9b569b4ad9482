import assert from "node:assert/strict";
import { test } from "node:test";
import {
  kShades,
  niceCeiling,
  paintValues,
  srgbToLinear,
  viridis,
  zoneColour,
} from "../src/colour_map";

test("viridis has the colours that matplotlib gives it", () => {
  const known: [number, number[]][] = [
    [0, [0.267, 0.005, 0.329]],
    [0.25, [0.229, 0.322, 0.546]],
    [0.5, [0.128, 0.567, 0.551]],
    [0.75, [0.369, 0.789, 0.383]],
    [1, [0.993, 0.906, 0.144]],
  ];
  for (const [t, expected] of known) {
    // The fit is good to about 0.01 of full brightness; at its ends to twice that.
    viridis(t).forEach((value, c) =>
      assert.ok(Math.abs(value - expected[c]) < 0.025, `${t}: ${value}`),
    );
  }
});

test("viridis grows brighter all the way, so that it reads without colour", () => {
  let before = -1;
  for (let shade = 0; shade < kShades; shade++) {
    const [r, g, b] = viridis(shade / (kShades - 1)).map(srgbToLinear);
    const luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    assert.ok(luminance > before, `shade ${shade}`);
    before = luminance;
  }
});

test("paintValues clamps outside of the range and has a colour for an empty one", () => {
  const colours = new Float32Array(12);
  paintValues(new Float32Array([-1, 0, 2, 5]), { min: 0, max: 2 }, colours);
  assert.deepEqual([...colours.subarray(0, 3)], [...colours.subarray(3, 6)]);
  assert.deepEqual([...colours.subarray(6, 9)], [...colours.subarray(9, 12)]);
  assert.notEqual(colours[0], colours[6]);
  paintValues(new Float32Array(4), { min: 0, max: 0 }, colours);
  assert.ok(colours.every(Number.isFinite));
});

test("zoneColour differs between neighbouring ids and gives no zone its own", () => {
  for (let id = 0; id < 50; id++) {
    assert.notDeepEqual(zoneColour(id), zoneColour(id + 1));
    assert.notDeepEqual(zoneColour(id), zoneColour(-1));
  }
});

test("niceCeiling is the next round number", () => {
  const cases: [number, number][] = [
    [0, 0],
    [0.3, 0.3],
    [0.31, 0.5],
    [1.2, 1.5],
    [8, 10],
    [7.6e-9, 1e-8],
    [1e6, 1e6],
  ];
  for (const [value, expected] of cases) {
    assert.ok(
      Math.abs(niceCeiling(value) - expected) <= 1e-12 * expected,
      `${value}: ${niceCeiling(value)}`,
    );
  }
  for (const bad of [-1, Number.NaN, Infinity]) assert.equal(niceCeiling(bad), 0);
});
