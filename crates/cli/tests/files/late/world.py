"""A world in which walking takes as long as the command line says. Whoever stops walking leaves the path."""

import os
import sys

sys.path.insert(0, os.path.join(os.getcwd(), "clients", "python"))
from elbowroom_world import Simulation  # noqa: E402


class Slow(Simulation):
    def _cancel(self, action):
        super()._cancel(action)
        self._take({"type": "fact", "fact": "(path)", "becomes": True}, self.now())


world = Slow()


@world.lasts("*")
def lasts(action):
    return float(sys.argv[1]) if action.name == "walk" else action.duration


world.run()
