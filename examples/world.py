#!/usr/bin/env python3
"""A world for `elbowroom run --world-process "python3 examples/world.py"`: each action takes 10 %
longer than planned. docs/reference/formats/world-protocol.md describes the messages."""
import json
import sys

now, ends, news = 0.0, {}, []  # the time, the end times of running actions, and unsent reports

def report(**message):
    news.append(dict(message, time=now))

def start(ticket, action, duration):
    report(type="started", ticket=ticket)
    if duration is not None:  # an instantaneous action ends with its start
        ends[ticket] = now + 1.1 * duration["decimal"]

def cancel(ticket):
    if ends.pop(ticket, None) is not None:
        report(type="ended", ticket=ticket, outcome="cancelled")

def wait(until):  # until the next event, at most until the time `until`
    global now
    ticket = min(ends, key=ends.get, default=None)
    if news:  # the results of commands are reported at once
        return
    if ticket is not None and ends[ticket] <= until:
        now = max(now, ends.pop(ticket))
        report(type="ended", ticket=ticket, outcome="succeeded")
    else:
        now = max(now, until)

for message in map(json.loads, sys.stdin):
    if message["type"] == "start":
        start(message["ticket"], message["action"], message["duration"])
    elif message["type"] == "cancel":
        cancel(message["ticket"])
    elif message["type"] == "wait":
        wait(message["until"]["decimal"])
    if message["type"] in ("wait", "look"):  # this world sees no more than what it reports
        for answer in news + [{"type": "time", "now": now}]:
            print(json.dumps(answer), flush=True)
        news.clear()
    elif message["type"] == "stop":
        break
