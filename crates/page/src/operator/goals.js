// The list of goals: the open ones, and those that were closed last.

const MAX_CLOSED = 100;

function goalCard(goal) {
  const card = element("li", { class: "card goal" },
    element("div", { class: "head" }, element("h3", { "data-part": "name" }), element("span", { class: "badge", "data-part": "state" })),
    element("p", { class: "pddl", "data-part": "goal" }),
    element("p", { class: "note", "data-part": "terms" }),
    element("p", { class: "why", "data-part": "why" }));
  if (!isClosed(goal)) card.append(element("button", { type: "button", class: "cancel", hidden: true, "data-part": "cancel", onclick: () => cancelGoal(card.goal) }, "cancel"));
  return card;
}

function showGoal(card, goal, now) {
  card.goal = goal;
  setText(part(card, "name"), goal.name);
  const badge = part(card, "state");
  setText(badge, stateWords(goal.state));
  badge.className = `badge ${goal.state}`;
  const text = part(card, "goal");
  if (text.dataset.text !== goal.goal) {
    text.dataset.text = goal.goal;
    text.replaceChildren(words(goal.goal));
  }
  let terms = `since ${nearest(goal.since)}`;
  if (goal.given !== undefined) terms += `, given at ${nearest(goal.given)}`;
  if (goal.by !== undefined) terms += ` by ${goal.by}`;
  if (goal.keep) terms += ", to be kept";
  if (goal.release !== undefined) {
    terms += `, from ${nearest(goal.release)}`;
    if (goal.release > now) terms += ` (${distance(goal.release, now)})`;
  }
  if (goal.value !== 1) terms += `, value ${nearest(goal.value)}`;
  if (goal.deadline !== undefined) {
    terms += `, deadline ${nearest(goal.deadline)}`;
    if (!isClosed(goal)) terms += ` (${distance(goal.deadline, now)})`;
  }
  setText(part(card, "terms"), terms);
  setText(part(card, "why"), goal.why ?? "");
  const cancel = part(card, "cancel");
  if (cancel) {
    cancel.hidden = !token;
    cancel.setAttribute("aria-label", `cancel the goal ${goal.name}`);
  }
}

function showGoals(state, now) {
  const goals = members(state.goals);
  const open = goals.filter((it) => !isClosed(it)).sort((a, b) => (a.given ?? -1) - (b.given ?? -1));
  const closed = goals.filter(isClosed).sort((a, b) => b.since - a.since);
  const show = (id, some) => reconcile(byId(id), some, (it) => `${it.name} ${it.given} ${isClosed(it)} ${it.since * isClosed(it)}`, goalCard, (node, it) => showGoal(node, it, now));
  show("open-goals", open);
  show("closed-goals", closed.slice(0, MAX_CLOSED));
  byId("no-goal").hidden = open.length > 0;
  byId("closed").hidden = closed.length === 0;
  setText(byId("closed-count"), closed.length > MAX_CLOSED ? `${closed.length}, the last ${MAX_CLOSED} are shown` : String(closed.length));
}
