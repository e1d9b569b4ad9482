import assert from "node:assert/strict";
import { test } from "node:test";
import { Roster } from "../src/roster";

test("Roster does not take a tool for held again because of a heartbeat from before its release", () => {
  const roster = new Roster();
  roster.hear(["needle", "hook"], 0);
  roster.release("needle", 1000);
  assert.deepEqual(roster.tools, ["hook"]);
  roster.hear(["needle", "hook"], 1010);
  assert.deepEqual(roster.tools, ["hook"]);
  roster.hear(["hook"], 1250);
  assert.deepEqual(roster.tools, ["hook"]);
});

test("Roster hears of somebody else who took the tool after its release", () => {
  const roster = new Roster();
  roster.release("needle", 1000);
  roster.hear(["needle"], 1010);
  assert.deepEqual(roster.tools, []);
  roster.hear(["needle"], 1500);
  assert.deepEqual(roster.tools, ["needle"]);
  // A refusal says it at once.
  roster.release("needle", 2000);
  roster.take("needle");
  roster.hear(["needle"], 2010);
  assert.deepEqual(roster.tools, ["needle"]);
});
