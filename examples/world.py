#!/usr/bin/env python3
"""A world for `elbowroom run --world-process "python3 examples/world.py"`: everything takes 10 %
longer than planned. docs/formats/world-protocol.md describes the messages."""
import json
import sys

now, ends = 0.0, {}  # the time, and for each running action when it will have ended

def say(**message):
    print(json.dumps(message), flush=True)

def start(ticket, action, duration):
    say(type="started", ticket=ticket, time=now)
    if duration is not None:  # an instantaneous action is over when it has started
        ends[ticket] = now + 1.1 * duration["decimal"]

def cancel(ticket):
    if ends.pop(ticket, None) is not None:
        say(type="ended", ticket=ticket, outcome="cancelled", time=now)

def wait(until):  # until something happens, but not beyond `until`
    global now
    ticket = min(ends, key=ends.get, default=None)
    if ticket is not None and ends[ticket] <= until:
        now = max(now, ends.pop(ticket))
        say(type="ended", ticket=ticket, outcome="succeeded", time=now)
    else:
        now = max(now, until)

for message in map(json.loads, sys.stdin):
    if message["type"] == "start":
        start(message["ticket"], message["action"], message["duration"])
    elif message["type"] == "cancel":
        cancel(message["ticket"])
    elif message["type"] == "wait":
        wait(message["until"]["decimal"])
        say(type="time", now=now)
    elif message["type"] == "look":  # this world has nothing to add
        say(type="time", now=now)
    elif message["type"] == "stop":
        break
