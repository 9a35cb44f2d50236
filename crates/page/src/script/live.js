// A run that goes on: what is new is fetched from the program that runs it, at most twice a second.

const OFTEN = 500;

// `follow` is called with each new document.
function liveView(update) {
  const status = element("p", { class: "note", role: "status" }, "The run goes on.");
  const following = element("input", { type: "checkbox", checked: true, onchange: () => { if (following.checked) refresh(); } });
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  const stop = token && element("button", { type: "button", onclick: async () => {
    stop.disabled = true;
    const answer = await fetch("stop", { method: "POST", headers: { authorization: `Bearer ${token}` } }).catch(() => null);
    const text = answer ? await answer.text() : "the program does not answer";
    status.textContent = text.trim();
    stop.disabled = answer?.ok ?? false;
  } }, "stop the run");
  let isStale = false, isBusy = false, isOver = false;

  async function refresh() {
    if (isBusy || isOver || !following.checked) return;
    isBusy = true;
    while (isStale && following.checked && !isOver) {
      isStale = false;
      const answer = await fetch("document").catch(() => null);
      if (answer?.ok && !isOver) update(await answer.json());
      await new Promise((done) => setTimeout(done, OFTEN));
    }
    isBusy = false;
  }

  const events = new EventSource("events");
  events.addEventListener("change", () => {
    isStale = true;
    refresh();
  });
  events.addEventListener("over", (event) => {
    isOver = true;
    events.close();
    update(JSON.parse(event.data));
    status.textContent = "The run is over.";
    following.disabled = true;
    stop?.remove();
  });
  events.addEventListener("error", () => {
    if (!isOver) status.textContent = "The program that runs this does not answer: below is what was heard last.";
  });
  events.addEventListener("open", () => { status.textContent = "The run goes on."; });
  return element("div", { class: "controls", id: "live" }, status, element("label", {}, following, "follow"), stop);
}
