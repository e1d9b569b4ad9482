// The WebSocket to the server: opened, watched and opened again.

import { create, fromBinary, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import {
  ClientMessageSchema,
  ServerMessageSchema,
  type ServerMessage,
} from "./gen/adhesim/v1/connection_pb";

export type ConnectionState = "connecting" | "connected" | "reconnecting" | "closed";

export interface ConnectionHandlers {
  onState(state: ConnectionState): void;
  onMessage(message: ServerMessage): void;
  /** A message that could not be read or acted on; the connection goes on. */
  onError(error: unknown): void;
}

const kSubprotocol = "adhesim.v1.pb";
const kRetryMs = 1000;

export class Connection {
  private socket?: WebSocket;
  private timer = 0;
  private closed = false;

  constructor(
    private readonly url: string,
    private readonly handlers: ConnectionHandlers,
  ) {}

  open(): void {
    this.handlers.onState("connecting");
    this.connect();
  }

  /** For good. */
  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    this.socket?.close();
    this.handlers.onState("closed");
  }

  /** False when there is no connection to send it on. */
  send(message: MessageInitShape<typeof ClientMessageSchema>): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(toBinary(ClientMessageSchema, create(ClientMessageSchema, message)));
    return true;
  }

  private connect(): void {
    const socket = new WebSocket(this.url, kSubprotocol);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.handlers.onState("connected");
    socket.onmessage = (event) => this.receive(event.data);
    // An error is always followed by a close.
    socket.onclose = () => {
      if (this.closed || this.socket !== socket) return;
      this.handlers.onState("reconnecting");
      this.timer = window.setTimeout(() => this.connect(), kRetryMs);
    };
  }

  private receive(data: unknown): void {
    try {
      if (!(data instanceof ArrayBuffer))
        throw new Error("the server sent text; messages are binary");
      this.handlers.onMessage(fromBinary(ServerMessageSchema, new Uint8Array(data)));
    } catch (error) {
      this.handlers.onError(error);
    }
  }
}

/** The server's WebSocket, seen from the page it served. */
export function webSocketUrl(location: Location): string {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  return `${scheme}//${location.host}/v1/ws`;
}
