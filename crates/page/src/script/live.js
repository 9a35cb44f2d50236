// Live page of a run: fetches new data from the executing program, at most twice a second.

const OFTEN = 500;
const SOON = 50;

// The page is not replaced while the user presses a button or drags.
let released = Promise.resolve();
if ("live" in document.documentElement.dataset) {
  addEventListener("pointerdown", () => {
    released = new Promise((done) => {
      // The click event follows the release of the pointer.
      for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => setTimeout(done), { once: true });
    });
  }, { capture: true });
}

// Saves the open elements and the keyboard focus. The returned function restores them in the new elements.
function place(main) {
  const key = (section) => section.querySelector("h2")?.textContent;
  const within = (section) => [...section.querySelectorAll("a, button, input, select, summary, [tabindex]")];
  const open = new Map([...main.children].map((section) => [key(section), [...section.querySelectorAll("details")].map((it) => it.open)]));
  const focused = document.activeElement;
  const section = [...main.children].find((it) => it.contains(focused));
  const index = section ? within(section).indexOf(focused) : -1;
  const selected = focused?.type === "search" ? [focused.selectionStart, focused.selectionEnd] : null;
  const [across, down] = [scrollX, scrollY];
  return () => {
    for (const part of main.children) {
      const before = open.get(key(part)) ?? [];
      for (const [at, details] of [...part.querySelectorAll("details")].entries()) {
        if (at < before.length) details.open = before[at];
      }
      if (!section || key(part) !== key(section)) continue;
      const node = within(part)[index];
      node?.focus({ preventScroll: true });
      if (selected) node?.setSelectionRange?.(...selected);
    }
    scrollTo(across, down);
  };
}

// `follow` is called with each new document.
function liveView(update) {
  const status = element("p", { class: "note", role: "status" }, "The page is not connected yet.");
  const following = element("input", { type: "checkbox", checked: true, onchange: () => { if (following.checked) refresh(); } });
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  // Sends a request to the run. The next document shows whether it was accepted.
  async function ask(what, button) {
    button.disabled = true;
    const answer = await fetch(what, { method: "POST", headers: { authorization: `Bearer ${token}` } }).catch(() => null);
    const text = answer ? await answer.text() : "the executive does not answer";
    let words = text.trim();
    try { words = JSON.parse(text).error ?? words; } catch { /* It was no JSON. */ }
    if (!isOver) status.textContent = words;
    button.disabled = answer?.ok ? what === "stop" || what === "cancel" : false;
  }
  const button = (words, title, onclick) => element("button", { type: "button", title, onclick }, words);
  const pause = token && button("pause", "No further actions are started; running actions continue", () => ask(data.is_paused ? "resume" : "pause", pause));
  const cancel = token && button("cancel", "No further actions are started, and the goal is abandoned; running actions continue to their ends", () => ask("cancel", cancel));
  const stop = token && button("stop the run", "Running actions are cancelled, and the run ends", () => ask("stop", stop));
  const follow = (newer) => {
    update(newer);
    if (pause) pause.textContent = newer.is_paused ? "continue" : "pause";
  };
  let isStale = false, isBusy = false, isOver = false;

  async function refresh() {
    if (isBusy || isOver || !following.checked) return;
    isBusy = true;
    while (isStale && following.checked && !isOver) {
      // The message `over` follows the last change immediately, and the server does not answer after it.
      await new Promise((done) => setTimeout(done, SOON));
      if (isOver) break;
      isStale = false;
      const answer = await fetch("document").catch(() => null);
      const newer = answer?.ok && (await answer.json());
      await released;
      if (newer && !isOver) follow(newer);
      await new Promise((done) => setTimeout(done, OFTEN));
    }
    isBusy = false;
  }

  const events = new EventSource("events");
  events.addEventListener("change", () => {
    isStale = true;
    refresh();
  });
  events.addEventListener("over", async (event) => {
    isOver = true;
    events.close();
    await released;
    update(JSON.parse(event.data));
    status.textContent = "The run is over.";
    following.disabled = true;
    for (const own of [pause, cancel, stop]) own?.remove();
  });
  events.addEventListener("error", () => {
    if (!isOver) status.textContent = "The executive does not answer. The page shows the last known state.";
  });
  events.addEventListener("open", () => { status.textContent = "The run continues."; });
  if (pause && data.is_paused) pause.textContent = "continue";
  return element("div", { class: "controls", id: "live" }, status, element("label", {}, following, "follow"), pause, cancel, stop);
}
