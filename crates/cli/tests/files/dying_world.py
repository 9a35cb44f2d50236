"""A world whose program ends at its START-th start, in the first LIVES of its lives. Each action takes as long as planned.

    python3 dying_world.py FILE START LIVES

FILE counts the lives.
"""

import json
import pathlib
import sys

counter, fatal, lives = pathlib.Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
life = int(counter.read_text()) if counter.exists() else 0
counter.write_text(str(life + 1))
now, starts, ends = 0.0, 0, {}


def say(**message):
    print(json.dumps(message), flush=True)


for line in sys.stdin:
    message = json.loads(line)
    kind = message["type"]
    if kind == "start":
        starts += 1
        if starts == fatal and life < lives:
            sys.exit(7)
        ends[message["ticket"]] = now + message["duration"]["decimal"]
    elif kind == "wait":
        until = message["until"]["decimal"]
        ticket, end = min(ends.items(), key=lambda it: it[1], default=(None, float("inf")))
        if end <= until:
            now = max(now, end)
            del ends[ticket]
            say(type="ended", ticket=ticket, outcome="succeeded", time=now)
        else:
            now = max(now, min(until, now + 1000))
    if kind in ("wait", "look"):
        say(type="time", now=now, question=message["question"])
    elif kind == "stop":
        break
