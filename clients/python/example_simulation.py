"""A world for `elbowroom run --world-process "python3 clients/python/example_simulation.py"`: time jumps
from event to event, and each action takes 10 % longer than planned."""

from elbowroom_world import Simulation

world = Simulation()


@world.lasts("*")
def lasts(action):
    return 1.1 * action.duration


world.run()
