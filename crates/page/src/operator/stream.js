// The state of the executive, kept up to date by the differences that it streams, and its clock between two messages.

const SILENT_AFTER = 2000;
const RETRY_AFTER = 1000;
const SAMPLED = 10000;

// Applies a JSON merge patch (RFC 7396).
function merge(target, patch) {
  for (const [name, value] of Object.entries(patch)) {
    if (value === null) delete target[name];
    else if (typeof value !== "object") target[name] = value;
    else {
      if (typeof target[name] !== "object") target[name] = {};
      merge(target[name], value);
    }
  }
}

// The world's clock: its last time, and its rate according to the last messages.
function worldClock() {
  let samples = [], rate = 1;
  const now = () => {
    const last = samples.at(-1);
    return last ? last.time + rate * (performance.now() - last.at) / 1000 : 0;
  };
  return {
    now,
    // After a clock stood still, was restarted or jumped, its rate is measured again.
    set(time) {
      const at = performance.now();
      const last = samples.at(-1);
      const isSteady = last && time > last.time && Math.abs(time - now()) < 0.25 * Math.max(1, rate);
      samples = [...(isSteady ? samples : samples.slice(-1)), { at, time }].filter((it) => at - it.at < SAMPLED);
      const first = samples[0];
      if (samples.length > 1) rate = Math.max(0, (time - first.time) / (at - first.at) * 1000);
    },
    restart() { [samples, rate] = [[], 1]; },
    stop() { rate = 0; },
  };
}

// Splits a stream of bytes into server-sent events.
async function readEvents(body, receive) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const parts = (rest + value).split("\n\n");
    rest = parts.pop();
    for (const text of parts) {
      const lines = text.split("\n");
      const field = (name) => lines.find((line) => line.startsWith(name))?.slice(name.length);
      receive(field("event: "), field("data: "));
    }
  }
}

// Follows the executive. `changed` is called after each message.
function follow(changed) {
  const view = { state: null, clock: worldClock(), received: performance.now(), isConnected: false, isOver: false, refused: null };
  const receive = (event, data) => {
    view.received = performance.now();
    view.isConnected = true;
    view.refused = null;
    if (event === "over") view.isOver = true;
    else if (event === "document") {
      view.state = JSON.parse(data);
      view.isOver = false;
      view.clock.restart();
    } else if (event === "change") merge(view.state, JSON.parse(data));
    if (event !== "over") view.clock.set(view.state.now);
    if (view.isOver) view.clock.stop();
    changed();
  };
  (async () => {
    for (;;) {
      try {
        const answer = await fetch("v1/state/events", { headers: authorization(), cache: "no-store" });
        if (answer.ok) await readEvents(answer.body, receive);
        else view.refused = (await answer.json()).error;
      } catch { /* The executive has gone away, or its machine. */ }
      view.isConnected = false;
      changed();
      await new Promise((done) => setTimeout(done, RETRY_AFTER));
    }
  })();
  return view;
}

// The state of the connection, and true if it is a warning.
function connection(view) {
  const silent = performance.now() - view.received;
  if (view.isOver) return { words: "the executive has ended", isBad: false };
  if (view.refused) return { words: view.refused, isBad: true };
  if (view.isConnected && silent < SILENT_AFTER) return { words: "connected", isBad: false };
  if (!view.state && silent < SILENT_AFTER) return { words: "not connected", isBad: false };
  return { words: `no answer for ${Math.floor(silent / 1000)} s`, isBad: true };
}
