"""The robot of this project. Elbowroom starts this program, and both exchange lines of JSON.

Here each action only sleeps for about its planned duration, 5 times as fast as the real clock. Replace the bodies
of the functions by calls of your robot, and remove `speed`.
"""

from elbowroom_world import Action, Failed, World

world = World("rover", speed=5)
grip_is_closed = False


def work(action: Action, factor: float = 1.0) -> bool:
    """Sleeps in ten steps and reports progress. Returns False if the action was cancelled."""
    for step in range(10):
        action.feedback(step / 10)
        if not action.sleep((action.duration or 0) * factor / 10):
            return False
    return True


@world.action("drive")
def drive(action: Action) -> None:
    robot, start, goal = action.arguments
    print(f"{robot} drives from {start} to {goal}")  # standard error: standard output belongs to the protocol
    work(action, 1.2)  # 20 % longer than planned


@world.action("pick")
def pick(action: Action) -> None:
    global grip_is_closed
    grip_is_closed = work(action)
    if not grip_is_closed and not action.is_cancelled:
        raise Failed("the parcel slipped")


@world.action("drop", "unlock")
def other(action: Action) -> None:
    work(action)


world.run()
