// Rebuilds the page after each message, and advances its clock between messages.

const TICK = 100;
let announcedBefore = null, isChanged = false;

// Announces changes to screen readers: the activity, the connection, and warnings, without counting times.
function announce(texts) {
  if (announcedBefore) {
    const news = texts.filter((it) => !announcedBefore.includes(it));
    if (news.length > 0) byId("announced").textContent = news.join(". ");
  }
  announcedBefore = texts;
}

function showWarnings(state, view, now) {
  const { words: link, isBad } = connection(view);
  const found = warnings(state, now);
  if (isBad) found.unshift({ key: "connection", kind: "the executive does not answer", words: `${link}: the page shows the last known state; the clock is estimated` });
  const create = () => element("li", {}, element("span", { "data-part": "words" }), element("strong", { "data-part": "left" }));
  reconcile(byId("warning-list"), found, (it) => it.key, create, (node, it) => {
    setText(part(node, "words"), it.words);
    setText(part(node, "left"), it.until === undefined ? "" : ` (${distance(it.until, now)})`);
  });
  byId("warnings").hidden = found.length === 0;
  setText(byId("connection"), link);
  byId("connection").classList.toggle("bad", isBad);
  document.body.classList.toggle("stale", isBad);
  return found.map((it) => it.kind);
}

function showDecision(state, now) {
  const next = state.next ?? {};
  let text = next.decision ?? "no decision yet";
  if (next.until !== undefined) text += ` until ${nearest(next.until)}`;
  setText(byId("decision"), next.why ? `${text}: ${next.why}` : text);
  setText(byId("decided"), next.decided === undefined ? "" : `decided at ${nearest(next.decided)}, ${distance(next.decided, now)}`);
  const step = next.step;
  const duration = step?.duration === undefined ? "" : ` [${nearest(step.duration)}]`;
  setText(byId("next"), step ? `${nearest(step.start)}: ${step.action}${duration} ${step.state}` : "none");
}

function show() {
  const { state } = view;
  const now = view.clock.now();
  if (!state) {
    showWarnings({}, view, now);
    return;
  }
  // As in `ctl state`; the documents keep their older word.
  const activity = state.activity === "resting" ? "idle" : state.activity;
  setText(byId("activity"), activity);
  byId("activity").className = `activity ${state.activity}`;
  setText(byId("clock"), now.toFixed(1));
  setText(byId("plans"), String(state.plans));
  setText(byId("why"), state.why ? `: ${state.why}` : "");
  document.title = `${activity} – Mission control`;
  const kinds = showWarnings(state, view, now);
  announce([activity, ...kinds]);
  showGoals(state, now);
  showLanes(state, now, isChanged);
  showSlack(state, now);
  showDecision(state, now);
  showControls(state, view.isOver);
  isChanged = false;
}

const showControls = controlsView(() => { isChanged = true; });
const view = follow(() => { isChanged = true; });
setInterval(show, TICK);
document.documentElement.dataset.ready = "true";
