// Bytes of a recording, from a file of this machine or from the server.

export interface ByteSource {
  size(): Promise<bigint>;
  read(offset: bigint, length: bigint): Promise<Uint8Array>;
}

export function blobSource(blob: Blob): ByteSource {
  return {
    size: async () => BigInt(blob.size),
    read: async (offset, length) => {
      const piece = blob.slice(Number(offset), Number(offset + length));
      return whole(new Uint8Array(await piece.arrayBuffer()), length);
    },
  };
}

/** Asks the server for ranges; takes the whole file when it answers with that. */
export async function urlSource(url: string): Promise<ByteSource> {
  const fetchRange = async (first: bigint, last: bigint) => {
    const response = await fetch(url, { headers: { Range: `bytes=${first}-${last}` } });
    if (response.ok || response.status === 416) return response;
    throw new Error(
      response.status === 404
        ? `The server has no recording ${url}.`
        : `The server answered ${response.status} for ${url}.`,
    );
  };
  const head = await fetchRange(0n, 0n);
  if (head.status === 416) return blobSource(new Blob());
  if (head.status !== 206) return blobSource(await head.blob());
  const size = BigInt(head.headers.get("Content-Range")?.split("/")[1] ?? "0");
  await head.arrayBuffer();
  return cached({
    size: async () => size,
    read: async (offset, length) => {
      if (length === 0n) return new Uint8Array();
      const response = await fetchRange(offset, offset + length - 1n);
      return whole(new Uint8Array(await response.arrayBuffer()), length);
    },
  });
}

const kCachedPieces = 16;

// Frames that follow one another are in the same piece.
function cached(source: ByteSource): ByteSource {
  const pieces = new Map<string, Promise<Uint8Array>>();
  return {
    size: source.size,
    read: (offset, length) => {
      const key = `${offset}+${length}`;
      const piece = pieces.get(key) ?? source.read(offset, length);
      pieces.delete(key);
      pieces.set(key, piece);
      piece.catch(() => pieces.delete(key));
      if (pieces.size > kCachedPieces) pieces.delete(pieces.keys().next().value!);
      return piece;
    },
  };
}

function whole(bytes: Uint8Array, length: bigint): Uint8Array {
  if (BigInt(bytes.length) !== length)
    throw new Error(`read ${bytes.length} bytes where ${length} should be`);
  return bytes;
}
