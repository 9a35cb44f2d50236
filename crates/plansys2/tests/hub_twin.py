"""Plays scripts to the `Hub` of `examples/plansys2_world.py`.

Each line of the input is a script: a JSON list of events. Each line of the output lists the hub's reactions to them.
"""

import json
import os
import sys
from types import SimpleNamespace

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..", "examples"))
from plansys2_world import Hub  # noqa: E402


class Asked:
    def __init__(self, play, it):
        self.play, self.ticket = play, it["ticket"]
        self.name, self.arguments = it["action"], it["arguments"]
        self.duration = None if it["instantaneous"] else 1.0

    def tell(self, *what):
        key = " ".join([self.name, *self.arguments])
        self.play.effects.append([key, "tell", self.ticket, *what])

    def started(self):
        self.tell("started")

    def succeeded(self):
        self.tell("succeeded")

    def failed(self, why):
        self.tell("failed", why)

    def was_cancelled(self):
        self.tell("cancelled")

    def feedback(self, completion, note):
        self.tell("feedback", completion, note)


class Play:
    def __init__(self):
        self.now, self.effects, self.begun = 0.0, [], {}
        self.hub = Hub(self.send, lambda: self.now)

    def send(self, kind, node, action, arguments):
        self.effects.append([" ".join([action, *arguments]), "send", kind, node])

    def step(self, it):
        self.now, what = it["at"], it["what"]
        if what == "begin":
            action = self.begun[it["ticket"]] = Asked(self, it)
            self.hub.begin(action)
        elif what == "cancel":
            self.hub.cancel(self.begun[it["ticket"]])
        elif what == "tick":
            self.hub.tick()
        elif what == "message":
            self.hub.message(SimpleNamespace(**it["message"]))
        else:
            self.hub.status(SimpleNamespace(**it["status"]))
        effects, self.effects = self.effects, []
        return effects


for line in sys.stdin:
    play = Play()
    print(json.dumps([play.step(it) for it in json.loads(line)]))
