"""The robot of this project. Elbowroom starts this program, and both exchange lines of JSON.

Here each action only sleeps for about its planned duration, 2000 times as fast as the real clock. Replace the bodies
of the functions by calls of your robot, and remove `speed`.
"""

from elbowroom_world import Action, Failed, World

world = World("courier", speed=2000)


def work(action: Action, factor: float = 1.0) -> bool:
    """Sleeps in ten steps and reports progress. Returns False if the action was cancelled."""
    for step in range(10):
        action.feedback(step / 10)
        if not action.sleep((action.duration or 0) * factor / 10):
            return False
    return True


@world.action("drive")
def drive(action: Action) -> None:
    start, goal = action.arguments
    print(f"drive from {start} to {goal}")  # standard error: standard output belongs to the protocol
    work(action, 1.1)  # 10 % longer than planned


@world.action("fetch")
def fetch(action: Action) -> None:
    goods, shop = action.arguments
    if not work(action) and not action.is_cancelled:
        raise Failed(f"{shop} has no {goods}")


@world.action("unload")
def unload(action: Action) -> None:
    work(action)


world.run()
