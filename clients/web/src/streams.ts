// Numbered streams over one connection: each is one call of a service (connection.proto).

import type { MessageInitShape } from "@bufbuild/protobuf";
import { anyUnpack } from "@bufbuild/protobuf/wkt";
import type { ClientMessageSchema, ServerMessage } from "./gen/adhesim/v1/connection_pb";
import { ErrorInfoSchema } from "./gen/google/rpc/error_details_pb";
import type { Status } from "./gen/google/rpc/status_pb";

type ClientMessageInit = MessageInitShape<typeof ClientMessageSchema>;
export type Request = NonNullable<ClientMessageInit["request"]>;
export type Response = ServerMessage["response"];
/** The response to a call, by the name of its field. */
type Answer<C extends string> =
  Extract<Response, { case: C }> extends { value: infer V } ? V : never;

/** An error of the service: what it says, and the machine-readable reason (server/errors.h). */
export class ServiceError extends Error {
  constructor(
    message: string,
    readonly code: number,
    readonly reason: string,
  ) {
    super(message);
  }

  static from(status: Status): ServiceError {
    let reason = "";
    for (const detail of status.details)
      reason ||= anyUnpack(detail, ErrorInfoSchema)?.reason ?? "";
    return new ServiceError(status.message, status.code, reason);
  }
}

/** Reason of calls that a lost connection ended. */
export const kConnectionLost = "CONNECTION_LOST";

interface Listener {
  onMessage(response: Response): void;
  onEnd(error: ServiceError | undefined): void;
}

export interface Stream {
  readonly number: number;
  send(request: Request): boolean;
  /** Says that no more comes from here and listens no longer. */
  end(): void;
}

export class Streams {
  private next = 1;
  private readonly listeners = new Map<number, Listener>();

  constructor(private readonly send: (message: ClientMessageInit) => boolean) {}

  /** A stream of messages both ways. `onEnd` is called once: undefined for a good end. */
  open(
    request: Request,
    onMessage: (response: Response) => void,
    onEnd: (error: ServiceError | undefined) => void,
  ): Stream {
    const number = this.next++;
    this.listeners.set(number, { onMessage, onEnd });
    const send = (next: Request) => this.send({ stream: number, request: next });
    if (!send(request)) {
      this.listeners.delete(number);
      queueMicrotask(() => onEnd(lost()));
    }
    return {
      number,
      send,
      end: () => {
        if (this.listeners.delete(number)) send({ case: "end", value: {} });
      },
    };
  }

  /** One request, one response. */
  call<C extends Request["case"] & string>(
    name: C,
    value: Extract<Request, { case: C }>["value"],
  ): Promise<Answer<C>> {
    return new Promise((resolve, reject) => {
      const stream = this.open(
        { case: name, value } as Request,
        (response) => {
          this.listeners.delete(stream.number);
          if (response.case === name) resolve(response.value as Answer<C>);
          else
            reject(new ServiceError(`${name} was answered with ${response.case}`, 13, "INTERNAL"));
        },
        (error) =>
          reject(error ?? new ServiceError(`${name} ended without an answer`, 13, "INTERNAL")),
      );
    });
  }

  /** Messages of streams that ended here are still under way when they ended: they are nobody's. */
  receive(message: ServerMessage): void {
    const listener = this.listeners.get(message.stream);
    if (!listener) return;
    if (message.response.case === "ended") {
      this.listeners.delete(message.stream);
      const status = message.response.value;
      listener.onEnd(status.code === 0 ? undefined : ServiceError.from(status));
    } else {
      listener.onMessage(message.response);
    }
  }

  /** The connection is gone, and all streams with it. */
  loseAll(): void {
    const listeners = [...this.listeners.values()];
    this.listeners.clear();
    for (const listener of listeners) listener.onEnd(lost());
  }
}

function lost(): ServiceError {
  return new ServiceError("the connection to the server is lost", 14, kConnectionLost);
}
