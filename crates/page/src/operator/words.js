// Words and times of the page. They are those of `elbowroom ctl`.

const byId = (id) => document.getElementById(id);

// Sets the text of an element if it has changed, so that selections and screen readers are not disturbed.
function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

// A number with at most three decimal digits, half rounded away from zero. `toFixed` alone rounds the binary number: 154.5065
// to 154.506.
function nearest(value) {
  if (typeof value !== "number") return value === undefined ? "" : String(value);
  const size = Math.abs(value);
  const rounded = size >= 1e-6 && size < 1e15 ? Math.round(Number(`${size}e3`)) / 1e3 : size;
  const text = rounded.toFixed(3).replace(/\.?0+$/, "");
  return value < 0 && text !== "0" ? `-${text}` : text;
}

// Formats a duration that changes while it is displayed, with one decimal digit.
const seconds = (value) => `${value.toFixed(1)} s`;

const stateWords = (state) => state.replaceAll("-", " ");

// The time from now until `time`.
const distance = (time, now) => (time >= now ? `in ${seconds(time - now)}` : `${seconds(now - time)} ago`);

// Reconciles the children of `list` with `items`, so that elements that stay keep their focus.
function reconcile(list, items, keyOf, create, update) {
  const known = new Map([...list.children].map((node) => [node.dataset.key, node]));
  let place = list.firstElementChild;
  for (const item of items) {
    const key = keyOf(item);
    let node = known.get(key);
    known.delete(key);
    if (!node) {
      node = create(item);
      node.dataset.key = key;
    }
    update(node, item);
    if (node === place) place = place.nextElementSibling;
    else list.insertBefore(node, place);
  }
  for (const node of known.values()) node.remove();
}

// The members of an object of the document, in the order of their keys.
const members = (object) => Object.values(object ?? {});

// Returns the part with this role in an element of one of the views.
const part = (node, name) => node.querySelector(`[data-part="${name}"]`);

// An action that runs, as `ctl state` writes it.
function runningWords(it) {
  let text = `since ${nearest(it.since)}`;
  if (it.planned !== undefined) text += `, planned ${nearest(it.planned)}`;
  if (it.times_out !== undefined) text += `; without progress, it times out at ${nearest(it.times_out)}`;
  if (it.needed !== undefined) text += `; if it continues, a new plan is needed at ${nearest(it.needed)}`;
  return it.note ? `${text}: ${it.note}` : text;
}

// The warnings of the state: each with its words and, if it has one, the time left to react.
function warnings(state, now) {
  const found = [];
  if (state.restarting !== undefined) found.push({ key: "restarting", kind: "world restarting", words: `world restarting: ${state.restarting}` });
  if (state.unanswered !== undefined) {
    found.push({ key: "unanswered", kind: "the world does not answer", words: `the world has not answered for ${state.unanswered} s: until it does, no action is started and no request is processed` });
  }
  for (const it of members(state.running)) {
    if (it.times_out !== undefined) found.push({ key: `out ${it.ticket}`, kind: `${it.action} times out`, words: `${it.action}: without progress, it times out at ${nearest(it.times_out)}`, until: it.times_out });
    if (it.needed !== undefined) found.push({ key: `plan ${it.ticket}`, kind: `${it.action} is late`, words: `${it.action}: if it continues, a new plan is needed at ${nearest(it.needed)}`, until: it.needed });
  }
  for (const it of members(state.goals)) {
    const left = it.deadline - now;
    if (!isClosed(it) && left < SOON_DUE) found.push({ key: `goal ${it.name}`, kind: `the deadline of ${it.name} is near`, words: `goal ${it.name}: by ${nearest(it.deadline)}`, until: it.deadline });
  }
  for (const it of members(state.in_doubt)) {
    found.push({ key: `doubt ${it.name} ${it.since}`, kind: `${it.name} is in doubt`, words: `${it.name} is in doubt since ${nearest(it.since)}: ${it.why}` });
  }
  return found;
}

// A deadline is a warning during the last minute before it, on the world's clock.
const SOON_DUE = 60;
const isClosed = (goal) => ["achieved", "cancelled", "failed"].includes(goal.state);
