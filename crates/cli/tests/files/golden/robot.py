"""The world of the recorded journals. It keeps no ledger: after a restart it remembers nothing."""

import os
import sys

sys.path.insert(0, os.path.join(os.getcwd(), "clients", "python"))
from elbowroom_world import World  # noqa: E402

world = World("robot", speed=20)


@world.action("do")
def do(action):
    if not action.sleep(action.duration):
        world.fact(f"(idle {action.arguments[0]})", True)


world.run()
