"""The robot of this project, simulated. Elbowroom starts this program, and both exchange lines of JSON.

The clock jumps from event to event, so that hours take a second. For a robot, replace `Simulation` by `World`, and each
function by one with `@world.action(NAME)` that returns when the action is done; the projects of the other templates
have such a program.
"""

from elbowroom_world import Action, Failed, Simulation

world = Simulation("courier")
visits = 0


@world.lasts("drive")
def drive(action: Action) -> float:
    start, goal = action.arguments
    print(f"drive from {start} to {goal}")  # standard error: standard output belongs to the protocol
    return 1.1 * action.duration  # 10 % longer than planned


@world.lasts("fetch")
def fetch(action: Action) -> float:
    global visits
    visits += 1
    if visits > 100:
        raise Failed("the battery is empty")  # the action does not start
    return action.duration


@world.lasts("unload")
def unload(action: Action) -> float:
    return 60.0


world.run()
