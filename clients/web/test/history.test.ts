import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { FrameSchema } from "../src/gen/adhesim/v1/frame_pb";
import { History, type Sample } from "../src/history";

function sample(step: number, bytes = 12): Sample {
  const frame = create(FrameSchema, { positions: new Uint8Array(bytes) });
  return { session: "s", step, timeS: step / 1000, frame };
}

test("History keeps the newest and numbers them on", () => {
  const history = new History(3);
  for (let step = 0; step < 5; step++) history.push(sample(step));
  assert.equal(history.oldest, 2);
  assert.equal(history.newest, 4);
  assert.equal(history.at(2)?.step, 2);
  assert.equal(history.at(4)?.step, 4);
  assert.equal(history.at(1), undefined);
  assert.equal(history.at(5), undefined);
});

test("History is bounded by bytes but never loses the newest", () => {
  const history = new History(100, 1000);
  for (let step = 0; step < 20; step++) history.push(sample(step, 300));
  assert.equal(history.newest - history.oldest + 1, 3);
  assert.equal(history.bytes, 900);
  history.push(sample(20, 5000));
  assert.equal(history.oldest, history.newest);
  assert.equal(history.at(history.newest)?.step, 20);
});

test("History is empty after it was cleared and goes on numbering", () => {
  const history = new History(3);
  for (let step = 0; step < 4; step++) history.push(sample(step));
  history.clear();
  assert.equal(history.bytes, 0);
  assert.ok(history.newest < history.oldest);
  history.push(sample(9));
  assert.equal(history.at(history.newest)?.step, 9);
  assert.equal(history.newest, 4);
});
