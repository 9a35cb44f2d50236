"""Worlds for `elbowroom world-check`: `right`, and those that each do one thing wrong."""

import json
import os
import sys

fault = sys.argv[1]
now, ends, starts, news, held, known = 0.0, {}, 0, [], [], {}
# Worlds that claim to know the actions that were running when they were killed.
REMEMBER = ["right", "forgets", "does not say what became of it", "begins again", "invents a start",
            "never ends what was under way", "does not start again", "loses its time", "forgets what is over",
            "claims it only once"]
ledger = __file__ + ".ledger"


def report(kind, ticket, time=None, **more):
    news.append(dict(more, type=kind, ticket=ticket, time=now if time is None else time))


def say(message):
    print(message if isinstance(message, str) else json.dumps(message), flush=True)


def greet(again):
    if fault == "speaks of feedback without greeting":
        return
    if fault == "speaks version 3":
        say({"type": "hello", "version": 3})
    elif fault == "greets twice":
        say({"type": "hello", "version": 2, "can": ["cancel"]})
        say({"type": "hello", "version": 2, "can": ["cancel"]})
    else:
        can = ["cancel", "feedback"]
        can += ["resume"] if fault in REMEMBER and not (again and fault == "claims it only once") else []
        can += ["beliefs"] if fault in ["right", "dies of beliefs", "answers beliefs"] else []
        say({"type": "hello", "version": 2, "name": fault, "can": can})


def note(ticket, end):
    """So that it is known to whoever is started again."""
    with open(ledger, "a", encoding="utf-8") as file:
        file.write(json.dumps([ticket, now, end]) + "\n")


def remember(time, opened):
    global now
    if fault == "does not start again":
        sys.exit(5)
    if fault != "loses its time":
        now = time
    if fault == "forgets":
        return
    with open(ledger, encoding="utf-8") as file:
        for ticket, begun, end in map(json.loads, file):
            if ticket in opened:
                known[ticket] = begun, end
    for ticket, (_, end) in known.items():
        if end > now:
            ends[ticket] = 1e9 if fault == "never ends what was under way" else end


def recall(ticket):
    if fault == "does not say what became of it":
        return
    if fault == "forgets what is over" and ticket not in ends:
        news.append({"type": "unknown", "ticket": ticket})
    elif ticket in known and ticket not in ends:
        report("ended", ticket, time=known[ticket][1], outcome="succeeded")
    elif ticket in known or fault == "invents a start":
        begun = now + 0.5 if fault == "begins again" else known.get(ticket, (now, None))[0]
        held.append((begun, ticket))
    else:
        news.append({"type": "unknown", "ticket": ticket})
    news.extend({"type": "started", "ticket": it, "time": at} for at, it in held if at <= now)
    held[:] = [it for it in held if it[0] > now]


def start(ticket, duration):
    global starts
    starts += 1
    if fault == "dies when it has to work":
        sys.exit(3)
    if fault == "does one thing at a time" and ends:
        return report("ended", ticket, outcome="failed", why="busy")
    if fault == "never starts":
        return None
    if fault == "finishes what has not started":
        return report("ended", ticket, outcome="succeeded")
    report("started", ticket)
    if fault == "starts after it ends":
        return report("ended", ticket, time=now - 0.5, outcome="succeeded")
    if fault == "speaks of feedback without greeting" or fault == "right":
        report("feedback", ticket, completion=0.0, note="begun")
    if fault == "knows other tickets":
        report("started", 99)
    if fault == "is ahead of time":
        return report("ended", ticket, time=now + duration, outcome="succeeded")
    ends[ticket] = now + (1e9 if fault == "never ends" else duration)
    if fault in REMEMBER:
        note(ticket, ends[ticket])
    return None


def cancel(ticket):
    if fault == "dies of a cancel that comes too late" and ticket not in ends:
        sys.exit(4)
    if fault != "never answers a cancel" and ends.pop(ticket, None) is not None:
        report("ended", ticket, outcome="cancelled")
    if fault == "answers each cancel" and ticket not in ends:
        report("ended", ticket, outcome="cancelled")


def wait(until):
    global now
    if fault == "reports late":
        news.extend(held)
        held.clear()
    if fault == "begins again" and held:
        now = max(now, held[0][0])
        news.extend({"type": "started", "ticket": it, "time": at} for at, it in held)
        held.clear()
    if news:
        return
    ticket = min(ends, key=ends.get, default=None)
    if fault == "stands still":
        return
    if ticket is not None and ends[ticket] <= until:
        now = max(now, ends.pop(ticket))
        if fault == "never answers a cancel" and starts > 3:
            return
        report("ended", ticket, outcome="succeeded")
        if fault == "repeats itself":
            report("ended", ticket, outcome="succeeded")
        if fault == "reports late":
            held.extend(news)
            news.clear()
            now = max(now, until) + 3
    else:
        now = max(now, until) + (60 if fault == "oversleeps" else 0)
    if fault == "goes back in time" and starts:
        now -= 1.5


def answer(question):
    for message in news:
        say(message)
    news.clear()
    if fault == "is silent" and starts:
        return
    if fault == "writes no JSON" and starts:
        say("INFO: all is well")
    time = {"type": "time", "now": now, "question": question}
    if fault == "answers another question":
        time["question"] = question + 1
    say(time)


for line in sys.stdin:
    message = json.loads(line)
    kind = message["type"]
    if kind == "hello":
        greet("resumed" in message)
        if "resumed" in message:
            remember(message["resumed"]["now"]["decimal"], [it["ticket"] for it in message["resumed"]["open"]])
        elif os.path.exists(ledger):
            os.remove(ledger)
    elif kind == "believed":
        if fault == "dies of beliefs":
            sys.exit(6)
        if fault == "answers beliefs":
            say({"type": "time", "now": now})
    elif kind == "start":
        start(message["ticket"], message["duration"]["decimal"])
    elif kind == "cancel":
        cancel(message["ticket"])
    elif kind == "wait":
        wait(message["until"]["decimal"])
        answer(message["question"])
    elif kind == "look":
        for ticket in message.get("tickets", []):
            recall(ticket)
        answer(message["question"])
    elif kind == "stop":
        if fault == "does not stop":
            continue
        break
    elif fault == "dies of what it does not know":
        raise ValueError(kind)
while fault == "does not stop":
    pass
