"""The robots of this project. Elbowroom starts this program, and both exchange lines of JSON.

Here each action only sleeps for about its planned duration, 10 times as fast as the real clock. Replace the bodies
of the functions by calls of your robots, and remove `speed`. Actions of several robots run at the same time: each
call has a thread of its own.
"""

import random

from elbowroom_world import Action, Failed, World

world = World("hospital", speed=10)
chance = random.Random(1)


def work(action: Action, factor: float = 1.0) -> bool:
    """Sleeps in ten steps and reports progress. Returns False if the action was cancelled."""
    for step in range(10):
        action.feedback(step / 10)
        if not action.sleep((action.duration or 0) * factor / 10):
            return False
    return True


@world.action("move")
def move(action: Action) -> None:
    robot, start, goal = action.arguments
    print(f"{robot} moves from {start} to {goal}")  # standard error: standard output belongs to the protocol
    work(action, chance.uniform(1.0, 1.2))


@world.action("load", "deliver")
def handle(action: Action) -> None:
    robot, item, place = action.arguments
    if not work(action) and not action.is_cancelled:
        raise Failed(f"{item} is not where it should be")


@world.action("charge")
def charge(action: Action) -> None:
    work(action)


world.run()
