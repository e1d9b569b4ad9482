import assert from "node:assert/strict";
import { test } from "node:test";
import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { anyPack } from "@bufbuild/protobuf/wkt";
import { ServerMessageSchema, type ServerMessage } from "../src/gen/adhesim/v1/connection_pb";
import { ErrorInfoSchema } from "../src/gen/google/rpc/error_details_pb";
import { kConnectionLost, ServiceError, Streams } from "../src/streams";

type Response = MessageInitShape<typeof ServerMessageSchema>["response"];

function message(stream: number, response: Response): ServerMessage {
  return create(ServerMessageSchema, { stream, response });
}

function setUp() {
  const sent: { stream?: number; request?: { case?: string } }[] = [];
  const streams = new Streams((out) => sent.push(out) > 0);
  return { sent, streams };
}

test("Streams.call is answered on its own stream, in whatever order answers come", async () => {
  const { sent, streams } = setUp();
  const first = streams.call("listScenes", {});
  const second = streams.call("listScenes", {});
  const [a, b] = sent.map(({ stream }) => stream!);
  assert.notEqual(a, b);
  streams.receive(message(b, { case: "listScenes", value: { scenes: [{ name: "b" }] } }));
  streams.receive(message(a, { case: "listScenes", value: { scenes: [{ name: "a" }] } }));
  assert.equal((await first).scenes[0].name, "a");
  assert.equal((await second).scenes[0].name, "b");
});

test("Streams.call fails with the service's reason", async () => {
  const { sent, streams } = setUp();
  const call = streams.call("stepSession", { session: "s" });
  const info = create(ErrorInfoSchema, { reason: "SESSION_NOT_PAUSED", domain: "adhesim" });
  const details = [anyPack(ErrorInfoSchema, info)];
  streams.receive(
    message(sent[0].stream!, { case: "ended", value: { code: 9, message: "no", details } }),
  );
  await assert.rejects(call, (error: ServiceError) => {
    return error.reason === "SESSION_NOT_PAUSED" && error.code === 9 && error.message === "no";
  });
});

test("Streams.call refuses an answer to another question", async () => {
  const { sent, streams } = setUp();
  const call = streams.call("listScenes", {});
  streams.receive(message(sent[0].stream!, { case: "listSessions", value: {} }));
  await assert.rejects(call, /answered with listSessions/);
});

test("Streams.open hears nothing after it ended its stream", () => {
  const { sent, streams } = setUp();
  let heard = 0;
  let ended = 0;
  const stream = streams.open(
    { case: "watch", value: {} },
    () => heard++,
    () => ended++,
  );
  streams.receive(message(stream.number, { case: "watch", value: {} }));
  stream.end();
  stream.end();
  assert.deepEqual(
    sent.map(({ request }) => request?.case),
    ["watch", "end"],
  );
  streams.receive(message(stream.number, { case: "watch", value: {} }));
  streams.receive(message(stream.number, { case: "ended", value: { code: 0 } }));
  assert.deepEqual([heard, ended], [1, 0]);
});

test("Streams ends everything once when the connection is lost", async () => {
  const { streams } = setUp();
  const call = streams.call("listSessions", {});
  const reasons: (string | undefined)[] = [];
  streams.open(
    { case: "watch", value: {} },
    () => {},
    (error) => reasons.push(error?.reason),
  );
  streams.loseAll();
  streams.loseAll();
  await assert.rejects(call, (error: ServiceError) => error.reason === kConnectionLost);
  assert.deepEqual(reasons, [kConnectionLost]);
});

test("Streams fails calls at once when there is no connection", async () => {
  const streams = new Streams(() => false);
  await assert.rejects(streams.call("listSessions", {}), /connection to the server is lost/);
});
