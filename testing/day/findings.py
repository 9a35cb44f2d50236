"""Checks of a shift: the executive's reports, compared with the world's log of the actual events."""

import json
import subprocess

import depot

FINAL = {"achieved", "failed", "cancelled"}


class Findings:
    """Broken promises and figures of a shift."""

    def __init__(self):
        self.problems, self.stops, self.kills = [], [], 0
        self.figures = {}

    def broken(self, what):
        self.problems.append(what)

    def lines(self):
        for name, figure in self.figures.items():
            yield f"{name}: {figure}"
        yield f"{len(self.problems)} broken promises"


def read_truth(shift):
    """The entries of the world's own log."""
    found = []
    for line in (shift.folder / "truth.jsonl").read_text().splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            shift.findings.broken(f"the world's log has a damaged line: {line[:80]}")
    return found


def check_starts(shift, truth):
    """Nothing is started twice, and no robot does two things at once."""
    findings, busy, tickets = shift.findings, {}, set()
    for entry in truth:
        if "start" in entry:
            ticket, robot = entry["ticket"], entry["start"].strip("()").split()[1]
            if ticket in tickets:
                findings.broken(f"ticket {ticket} {entry['start']} was started twice")
            if robot in busy.values():
                findings.broken(f"{robot} does two things at once at {entry['at']:.1f}: {entry['start']}")
            tickets.add(ticket)
            busy[ticket] = robot
        elif "end" in entry:
            busy.pop(entry["ticket"], None)
    ordered = set()
    for entry in shift.executive.entries():
        command = entry.get("command", {}) if entry.get("event") == "command" else {}
        if command.get("type") == "start":
            if command["ticket"] in ordered:
                findings.broken(f"ticket {command['ticket']} was commanded twice")
            ordered.add(command["ticket"])
    if tickets - ordered:
        findings.broken(f"started, but not in the journal: {sorted(tickets - ordered)}")
    findings.figures["actions started"] = len(tickets)


def history(truth, fact, initial):
    """Intervals of the world's time in which a fact that tasks ask for was true."""
    words = fact.strip("()").split()
    found, since = [], 0.0 if fact in initial else None
    for entry in truth:
        text = entry.get("start", entry.get("end", "")).strip("()").split()
        # A load that fails or is cancelled leaves the tote where it was.
        maker = {"stored": "unload", "checked": "check"}.get(words[0])
        makes = "end" in entry and text[2:] == words[1:] and (
            (text[0] == maker and entry["outcome"] == "succeeded")
            or (words[0] == "stored" and text[0] == "load" and entry["outcome"] != "succeeded")
        )
        deletes = fact in entry.get("undone", []) or (
            "start" in entry and words[0] == "stored" and text[0] == "load" and text[2:] == words[1:]
        )
        if makes and since is None:
            since = entry["at"]
        elif deletes and since is not None:
            found.append((since, entry["at"]))
            since = None
    return found + ([(since, float("inf"))] if since is not None else [])


def check_goals(shift, truth):
    """Each task has a final state with a reason, and the state is true."""
    findings = shift.findings
    path = shift.folder / "goals.json"
    if not path.exists():
        findings.broken("the goals were not read")
        return
    goals = json.loads(path.read_text())
    listed = {goal["name"]: goal for goal in goals["goals"]}
    counts, value, possible = {}, 0.0, 0.0
    initial = depot.initial_facts(shift.robots)
    for task in shift.tasks:
        goal = listed.get(task.name)
        if goal is None:
            findings.broken(f"{task.name} is lost: it is not in the list of goals")
            continue
        state = goal["state"]
        counts[state] = counts.get(state, 0) + 1
        if state not in FINAL or goal.get("since") is None:
            findings.broken(f"{task.name} has no final state: {goal}")
        if state != "achieved" and not goal.get("why"):
            findings.broken(f"{task.name} is {state} without a reason")
        at = goal["since"]["decimal"] if goal.get("since") else None
        reached = [
            (since, until)
            for since, until in history(truth, task.goal, initial)
            if since <= task.deadline and until > task.release
        ]
        if state == "achieved":
            value += task.value
            if task.kind in ("vault", "torn"):
                findings.broken(f"{task.name} is impossible, and reported as achieved")
            elif not any(since <= at + 5 and until >= at - 5 for since, until in reached):
                findings.broken(f"{task.name} {task.goal} is reported as achieved at {at:.1f}, true at {reached}")
        elif state == "failed" and any(task.release + 5 < since < task.deadline - 5 for since, _ in reached):
            findings.broken(f"{task.name} {task.goal} failed ({goal['why']}), true at {reached}, due {task.deadline:.1f}")
        if task.kind not in ("vault", "torn"):
            possible += task.value
    findings.figures["tasks"] = ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
    findings.figures["value on time"] = f"{value:.0f} of {possible:.0f} possible ({100 * value / possible:.0f} %)"
    findings.value, findings.possible = value, possible


def check_records(shift):
    """Each segment of the journal can be replayed, and the executive has reported no panic."""
    segments = shift.executive.segments()
    for segment in segments:
        line = [shift.executive.program, "run", "--replay", segment]
        done = subprocess.run([str(it) for it in line], capture_output=True, text=True)
        if done.returncode != 0:
            said = (done.stdout + done.stderr)[-300:]
            shift.findings.broken(f"the replay of {segment.name} ends with exit code {done.returncode}: {said}")
    shift.findings.figures["segments of the journal"] = len(segments)
    if "panicked" in (shift.folder / "stderr.txt").read_text():
        shift.findings.broken("the executive has panicked")


def examine(shift):
    """All checks of a shift that has ended."""
    truth = read_truth(shift)
    check_starts(shift, truth)
    check_goals(shift, truth)
    check_records(shift)
    findings = shift.findings
    times = sorted(shift.executive.latencies) or [0.0]
    findings.figures["requests, ms, median / 99 % / worst"] = " / ".join(
        f"{1000 * times[(len(times) - 1) * share // 100]:.1f}" for share in (50, 99, 100)
    )
    findings.figures["stops, s"] = ", ".join(f"{it:.2f}" for it in findings.stops)
    caused = [entry for entry in truth if "trouble" in entry]
    findings.figures["troubles"] = ", ".join(f"{it['trouble']} at {it['at']:.0f}" for it in caused) + (
        f"; {findings.kills} kills"
    )
    findings.figures["longest delay of this driver, s"] = f"{shift.starved:.2f}"
