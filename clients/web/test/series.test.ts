import assert from "node:assert/strict";
import { test } from "node:test";
import { Series } from "../src/series";

test("Series keeps the newest rows in order of time", () => {
  const series = new Series(2, 8);
  for (let i = 0; i < 50; i++) {
    series.push(i, 10 * i);
    const [time, value] = series.columns();
    assert.equal(time.at(-1), i);
    assert.ok(series.rows <= 8);
    for (let row = 0; row < series.rows; row++) {
      assert.equal(value[row], 10 * time[row]);
      if (row > 0) assert.ok(time[row] > time[row - 1]);
    }
  }
});

test("Series leaves out rows that are not later, which a plot could not draw", () => {
  const series = new Series(2, 8);
  series.push(1, 1);
  series.push(1, 2);
  series.push(0.5, 3);
  assert.deepEqual([...series.columns()[1]], [1]);
  series.clear();
  series.push(0, 4);
  assert.deepEqual([...series.columns()[1]], [4]);
});
