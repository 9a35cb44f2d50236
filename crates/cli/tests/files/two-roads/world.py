"""A world in which the short road takes much longer than planned."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "../../../../../clients/python"))

from elbowroom_world import Simulation

world = Simulation()


@world.lasts("*")
def lasts(action):
    return 12 if action.name == "short-road" else action.duration


world.run()
