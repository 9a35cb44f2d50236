// Asks the module, as docs/reference/web.md says.

export const asker = (library) => (question) => {
  const asked = new TextEncoder().encode(JSON.stringify(question));
  const room = library.elbowroom_reserve(asked.length);
  new Uint8Array(library.memory.buffer, room, asked.length).set(asked);
  const start = library.elbowroom_ask(room, asked.length);
  library.elbowroom_release(room, asked.length);
  const length = new DataView(library.memory.buffer).getUint32(start, true);
  const reply = new TextDecoder().decode(new Uint8Array(library.memory.buffer, start + 4, length));
  library.elbowroom_release(start, length + 4);
  return JSON.parse(reply);
};
