import assert from "node:assert/strict";
import { test } from "node:test";
import { SessionClient } from "../src/session";
import { ServiceError } from "../src/streams";

Object.assign(globalThis, { window: globalThis });

test("SessionClient: pages that lose a restarted server end in one session", async () => {
  let sessions: { session: string; scene: string; state: number }[] = [];
  let next = 1;
  const streams = {
    call: async (name: string, { session, source }: any) => {
      await new Promise((resolve) => setTimeout(resolve, 2));
      if (name === "listSessions") return { sessions: [...sessions] };
      if (name === "listScenes") return { scenes: [{ name: "b" }] };
      if (name === "deleteSession") sessions = sessions.filter((one) => one.session !== session);
      if (name !== "createSession") return {};
      if (source.value !== "b") throw new ServiceError("no scene", 5, "SCENE_NOT_FOUND");
      sessions.push({ session: `s${next++}`, scene: "b", state: 1 });
      return { session: sessions.at(-1) };
    },
    open: () => ({ number: 1, send: () => true, end: () => {} }),
  } as any;
  const ignore = () => {};
  const events = {
    onTopology: ignore,
    onSample: ignore,
    onHeartbeat: ignore,
    onProblem: ignore,
    onLost: ignore,
  };
  sessions.push({ session: "old", scene: "a", state: 1 });
  const pages = [1, 2, 3].map(
    () => new SessionClient(streams, {}, events, { retryMs: 5, restartMs: 0 }),
  );
  await Promise.all(pages.map((page) => page.start()));
  assert.deepEqual(
    pages.map(({ id }) => id),
    ["old", "old", "old"],
  );
  for (const page of pages) page.stop();
  sessions = [];
  await Promise.all(pages.map((page) => page.start()));
  assert.equal(sessions.length, 1);
  assert.deepEqual(new Set(pages.map(({ id }) => id)), new Set([sessions[0].session]));
});
