"""Converts rosbag2 recordings to logs for `elbowroom learn`.

The topics `events` and `header` of an executive become traces. If lines are missing in the recording, and for the topic
`action_execution_info` of PlanSys2, the attempts to execute actions become a table."""

import argparse
import csv
import importlib
import json
import os
import sys

from .bags import BagError, messages

EVENT, INFO = "elbowroom_msgs/msg/Event", "plansys2_msgs/msg/ActionExecutionInfo"
COLUMNS = ("action", "commanded", "start", "end", "outcome", "planned")
# plansys2_msgs/msg/ActionExecutionInfo
INFO_OUTCOMES = {2: "running", 3: "failed", 4: "succeeded", 5: "cancelled"}


class Runs:
    """Traces of an executive, by number of the line. A line may be recorded several times."""

    def __init__(self):
        self.runs, self.headers = [{}], []
        # Lines since the last header: those of another run, as soon as one of them differs.
        self._recent = {}

    def add(self, number, line):
        """Adds a line."""
        if number == 1:
            self._recent = {}
        self._recent[number] = line
        if self.runs[-1].setdefault(number, line) != line:
            self.runs.append(dict(self._recent))

    def traces(self):
        """Returns the lines of each run, and whether none is missing before the last one."""
        for run in self.runs:
            if run and 1 not in run and self.headers:
                run[1] = self.headers[-1]
            numbers = sorted(run)
            yield [run[it] for it in numbers], numbers == list(range(1, len(numbers) + 1))


def attempts_of(lines):
    """Returns the attempts to execute actions in lines of a trace. Those whose command is missing are left out."""
    rows, running, last = [], {}, 0.0
    for line in lines:
        entry = json.loads(line)
        event, command, seen = entry.get("event"), entry.get("command", {}), entry.get("observation", {})
        last = max(last, decimal(entry.get("now")) or 0.0)
        if event == "command" and command.get("type") == "start":
            planned = decimal(command.get("duration"))
            running[command["ticket"]] = dict(action=command["action"], commanded=last, planned=planned, start=None)
        elif event == "observed" and seen.get("ticket") in running:
            row = running[seen["ticket"]]
            if seen["type"] == "started":
                row["start"] = decimal(seen["time"])
            if seen["type"] == "ended" or seen["type"] == "started" and row["planned"] is None:
                row.update(end=decimal(seen["time"]), outcome=seen.get("outcome", "succeeded"))
                if row["outcome"] == "succeeded" and row["start"] is None:
                    row["start"] = row["commanded"]
                rows.append(running.pop(seen["ticket"]))
    rows += [dict(row, end=last, outcome="running") for row in running.values()]
    return rows


def decimal(number):
    """Returns a number of a trace, or `None`."""
    return number.get("decimal") if isinstance(number, dict) else number


class Infos:
    """Executions of PlanSys2's executor: the last message of each counts."""

    def __init__(self):
        self._last = {}

    def add(self, message):
        """Adds a message."""
        if message.status in INFO_OUTCOMES:
            self._last[message.action_full_name, seconds(message.start_stamp)] = message

    def attempts(self):
        """Returns the attempts to execute actions."""
        zero = min((start for _, start in self._last), default=0.0)
        for (_, start), it in self._last.items():
            planned = seconds(it.duration)
            yield dict(
                action=f"({' '.join([it.action, *it.arguments])})", start=start - zero, end=seconds(it.status_stamp) - zero,
                outcome=INFO_OUTCOMES[it.status], planned=planned if planned > 0 else None,
            )  # fmt: skip


def seconds(stamp):
    return stamp.sec + stamp.nanosec / 1e9


def convert(path, folder):
    """Writes the logs in a recording to a folder. Returns the number of files."""
    from rclpy.serialization import deserialize_message

    executives, infos, classes = {}, {}, {}
    for topic, kind, data in messages(path, (EVENT, INFO)):
        if kind not in classes:
            package, _, name = kind.rpartition("/")
            classes[kind] = getattr(importlib.import_module(package.replace("/", ".")), name)
        message = deserialize_message(data, classes[kind])
        node, _, last = topic.rpartition("/")
        if kind == INFO:
            infos.setdefault(node, Infos()).add(message)
        elif last == "header":
            executives.setdefault(node, Runs()).headers.append(message.line)
        else:
            executives.setdefault(node, Runs()).add(message.number, message.line)
    base = os.path.join(folder, os.path.basename(os.path.normpath(path)).removesuffix(".mcap").removesuffix(".db3"))
    written = 0
    for node, runs in executives.items():
        for index, (lines, is_complete) in enumerate(runs.traces(), 1):
            name = f"{base}-{file_name(node)}-{index}"
            if is_complete and len(lines) > 1:
                write_trace(f"{name}.jsonl", lines)
                written += 1
            else:
                written += write_table(f"{name}.csv", attempts_of(lines))
    for node, found in infos.items():
        written += write_table(f"{base}-{file_name(node)}-plansys2.csv", list(found.attempts()))
    return written


def file_name(node):
    return node.strip("/").replace("/", "-") or "root"


def write_trace(path, lines):
    with open(path, "w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in lines)
    print(f"{path}: {len(lines)} lines")


def write_table(path, rows):
    """Writes a table. Returns the number of files: none without rows."""
    if not rows:
        return 0
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: "" if row.get(name) is None else row[name] for name in COLUMNS} for row in rows)
    print(f"{path}: {len(rows)} actions (a table, because the recording is no complete trace)")
    return 1


def main():
    """Entry point of the command."""
    parser = argparse.ArgumentParser(prog="bag_to_trace", description=__doc__)
    parser.add_argument("bags", nargs="+", metavar="BAG", help="a recording: a folder, or a file in it")
    parser.add_argument("-o", "--output", default=".", metavar="FOLDER", help="folder for the logs (the present one)")
    options = parser.parse_args()
    os.makedirs(options.output, exist_ok=True)
    try:
        written = [convert(path, options.output) for path in options.bags]
    except BagError as error:
        sys.exit(f"error: {error}")
    if 0 in written:
        empty = ", ".join(path for path, count in zip(options.bags, written) if not count)
        sys.exit(f"error: no message of {EVENT} or {INFO} with an action in {empty}")


if __name__ == "__main__":
    main()
