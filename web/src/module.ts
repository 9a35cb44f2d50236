// The library as a WebAssembly module: docs/reference/web.md describes its interface.

/** What the library replies. */
export interface Reply {
  exit: number;
  document: string;
  trace?: string;
  stn?: string;
  page?: string;
}

interface Exports {
  memory: WebAssembly.Memory;
  elbowroom_reserve(length: number): number;
  elbowroom_release(start: number, length: number): void;
  elbowroom_ask(start: number, length: number): number;
}

/** Makes an instance; the function that comes back asks it. */
export async function instance(module: WebAssembly.Module): Promise<(question: unknown) => Reply> {
  const { exports } = await WebAssembly.instantiate(module, { elbowroom: { now: () => performance.now() } });
  const library = exports as unknown as Exports;
  return (question) => {
    const bytes = new TextEncoder().encode(JSON.stringify(question));
    const room = library.elbowroom_reserve(bytes.length);
    new Uint8Array(library.memory.buffer, room, bytes.length).set(bytes);
    const start = library.elbowroom_ask(room, bytes.length);
    library.elbowroom_release(room, bytes.length);
    // The memory may have grown and moved, so a new view is needed.
    const length = new DataView(library.memory.buffer).getUint32(start, true);
    const text = new TextDecoder().decode(new Uint8Array(library.memory.buffer, start + 4, length));
    library.elbowroom_release(start, length + 4);
    return JSON.parse(text) as Reply;
  };
}
