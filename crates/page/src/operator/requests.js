// Requests of the operator: pause, stop and the cancellation of goals. They need the executive's token.

let token = new URLSearchParams(location.hash.slice(1)).get("token");
const authorization = () => (token ? { authorization: `Bearer ${token}` } : {});

// Sends a request, and shows the answer as `elbowroom ctl` prints it.
async function request(method, path) {
  const answer = await fetch(path, { method, headers: authorization() }).catch(() => null);
  const body = await answer?.json().catch(() => null);
  let words = "the executive does not answer";
  if (body?.error) words = `${body.error}: ${body.help}`;
  else if (body) words = (body.name ? `${body.name}: ` : "") + (body.taken ? "done" : `pending: it is processed as soon as ${body.until ?? "possible"}`);
  byId("reply").textContent = words;
  return answer?.status ?? 0;
}

// Requests a confirmation before an irreversible action. The focus is on "no" first, and returns afterwards.
function confirmed(title, text, verb) {
  const dialog = byId("question");
  byId("question-title").textContent = title;
  byId("question-text").textContent = text;
  byId("yes").textContent = verb;
  dialog.returnValue = "";
  dialog.showModal();
  byId("no").focus();
  answerQuestion(false);
  return new Promise((done) => { answerQuestion = done; });
}
// The event `close` is sent some time after the dialog is closed, and may arrive when the next question is already open.
let answerQuestion = () => {};
byId("question").addEventListener("close", (event) => { if (!event.target.open) answerQuestion(event.target.returnValue === "yes"); });
byId("no").addEventListener("click", () => byId("question").close("no"));
byId("yes").addEventListener("click", () => byId("question").close("yes"));

async function stop() {
  const text = "Running actions are cancelled and have five seconds to stop; then the executive ends.";
  if (await confirmed("Stop the executive?", text, "stop the executive")) await request("POST", "v1/stop");
}

async function cancelGoal(goal) {
  const text = `${goal.goal} is abandoned. The executive plans for the other goals; without others, it starts nothing more.`;
  if (await confirmed(`Cancel the goal ${goal.name}?`, text, "cancel the goal")) await request("DELETE", `v1/goals/${goal.name}`);
}

// Asks for the outcome of a hypothetical goal, and shows the answer as `elbowroom ctl what-if` prints it.
async function whatIf(event) {
  event.preventDefault();
  const goal = { goal: byId("hypothetical").value.trim() };
  if (byId("hypothetical-within").value) goal.within = byId("hypothetical-within").valueAsNumber;
  byId("what-if-answer").textContent = "the run is simulated …";
  const headers = { ...authorization(), "content-type": "application/json" };
  const answer = await fetch("v1/what-if", { method: "POST", headers, body: JSON.stringify(goal) }).catch(() => null);
  const body = await answer?.json().catch(() => null);
  byId("what-if-answer").textContent = body ? (body.error ? `${body.error}: ${body.help}` : whatIfWords(body)) : "the executive does not answer";
}
byId("what-if").addEventListener("submit", whatIf);

function whatIfWords(answer) {
  const percent = (share) => `${nearest(100 * share.decimal)} %`;
  let text = answer.done ? `done at ${nearest(answer.done.decimal)}` : answer.verdict.replace("-", " ");
  if (answer.slack_then) text += answer.slack_now ? `, least slack ${percent(answer.slack_now)} to ${percent(answer.slack_then)}` : `, least slack ${percent(answer.slack_then)}`;
  if (answer.why) text += `: ${answer.why}`;
  return [text, ...answer.missed.map((name) => `${name} would be missed`)].join("; ");
}

// Shows the buttons, or asks for the token.
function controlsView(changed) {
  const controls = byId("controls");
  const pause = element("button", { type: "button", id: "pause", onclick: () => request("POST", pause.textContent === "pause" ? "v1/pause" : "v1/resume") }, "pause");
  const stopping = element("button", { type: "button", id: "stop", class: "danger", onclick: stop }, "stop");
  const field = element("input", { type: "password", id: "token", autocomplete: "off", size: 12 });
  const give = (event) => {
    event.preventDefault();
    token = field.value.trim();
    if (token) show();
  };
  const form = element("form", { class: "token", onsubmit: give }, element("label", { for: "token" }, "token for requests "), field, element("button", { type: "submit" }, "use"));
  function show() {
    controls.replaceChildren(...(token ? [pause, stopping] : [form]));
    byId("what-if").hidden = !token;
    if (token) byId("trace").href = `run#token=${token}`;
    changed();
  }
  show();
  return (state, isOver) => {
    setText(pause, state.activity === "paused" ? "resume" : "pause");
    for (const button of [pause, stopping]) button.disabled = isOver;
  };
}
