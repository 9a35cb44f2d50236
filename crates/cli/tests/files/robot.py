"""A robot for the tests that kill: `robot.py FOLDER` keeps its ledger there, and notes each beginning in `begun`
and each end in `done`, apart from the ledger. What it was doing goes on when it is started again. With the variable
UNEVEN, robot `s` takes a quarter longer than planned."""

import os
import sys

sys.path.insert(0, os.path.join(os.getcwd(), "clients", "python"))
from elbowroom_world import World  # noqa: E402

folder = sys.argv[1]
world = World("robot", speed=5, ledger=os.path.join(folder, "ledger"))


def note(file, line):
    with open(os.path.join(folder, file), "a", encoding="utf-8") as notes:
        notes.write(line + "\n")


with open(os.path.join(folder, "pid"), "w", encoding="utf-8") as pid:
    pid.write(str(os.getpid()))


@world.action("do", resumes=True)
def do(action):
    if not action.is_resumed:
        note("begun", f"{action.ticket} {action.text}")
    duration = action.duration
    if os.environ.get("UNEVEN") and action.arguments[0] == "s":
        duration *= 1.25
    if action.sleep((action.start or world.now()) + duration - world.now()):
        note("done", f"{action.ticket} {action.text}")
    else:
        world.fact(f"(idle {action.arguments[0]})", True)


@world.resumed
def again(under_way):
    busy = {action.arguments[0] for action in under_way}
    for robot in {"r", "s"} - busy:
        world.fact(f"(idle {robot})", True)


world.run()
