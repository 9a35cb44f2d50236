// The history of the run, page by page, also from earlier segments of its journal.

let historyBefore = null;

function historyEntries(page) {
  const goals = page.goals.map((it) => ({ at: it.since.decimal, name: it.name, text: `${stateWords(it.state)}: ${it.goal}${it.why ? ` (${it.why})` : ""}` }));
  const actions = page.actions.map((it) => ({ at: it.end.decimal, name: it.action, text: `${it.state}, from ${nearest(it.since.decimal)}` }));
  return [...goals, ...actions].sort((a, b) => b.at - a.at);
}

// Reads the entries before a time, or the latest ones.
async function showHistory(before) {
  const path = before === null ? "v1/history" : `v1/history?before=${encodeURIComponent(before)}`;
  const answer = await fetch(path).catch(() => null);
  const page = await answer?.json().catch(() => null);
  if (!page || page.error) {
    setText(byId("history-note"), page ? `${page.error}: ${page.help}` : "the executive does not answer");
    return;
  }
  const entries = historyEntries(page).map((it) => element("li", {}, element("time", {}, nearest(it.at)), " ", element("strong", {}, it.name), ` ${it.text}`));
  if (before === null) byId("history-entries").replaceChildren(...entries);
  else byId("history-entries").append(...entries);
  historyBefore = page.next?.exact ?? null;
  setText(byId("history-note"), byId("history-entries").children.length ? "" : "nothing is closed or ended yet");
  byId("earlier").hidden = historyBefore === null;
}

byId("history").addEventListener("toggle", () => { if (byId("history").open) showHistory(null); });
byId("earlier").addEventListener("click", () => showHistory(historyBefore));
