"""A simulation that writes down what it is told of what is believed, each time as a line: `listening.py FILE`."""

import json
import os
import sys

sys.path.insert(0, os.path.join(os.getcwd(), "clients", "python"))
from elbowroom_world import Simulation  # noqa: E402

world = Simulation("listening")


@world.lasts("*")
def lasts(action):
    return action.duration


@world.believed
def believed(facts, values):
    with open(sys.argv[1], "a", encoding="utf-8") as file:
        file.write(json.dumps({"facts": facts, "values": values}) + "\n")


world.run()
