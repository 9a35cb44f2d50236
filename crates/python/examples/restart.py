"""Executive in this process: it pursues a goal, is killed, and resumes. Run it in the root of the repository."""

import os
import signal
import subprocess
import sys
import tempfile

import elbowroom


class Robot(elbowroom.SteppedWorld):
    speed = 20.0  # simulated seconds in one second

    def __init__(self):
        super().__init__()
        self.left = {}  # seconds until each action ends

    def begin(self, action):
        self.left[action] = float(action.duration)

    def step(self, dt):
        for action in [*self.left]:
            self.left[action] -= dt
            if self.left[action] < dt / 2:
                del self.left[action]
                self.succeeded(action)

    def cancel(self, action):
        del self.left[action]

    def resume(self, now, actions):  # this robot has finished its actions without the executive
        return now, [elbowroom.ended(action, now) for action in actions]


if len(sys.argv) > 1:  # the process that is killed
    case = "cases/delivery/domain.pddl", "cases/delivery/problem.pddl"
    executive = elbowroom.Executive(*case, world=Robot(), journal=sys.argv[1])
    executive.wait("problem", timeout=60)
    executive.submit("(at rover depot)", name="home")
    os.kill(os.getpid(), signal.SIGKILL)

journal = os.path.join(tempfile.mkdtemp(), "robot.journal")
subprocess.run([sys.executable, __file__, journal])
with elbowroom.Executive.resume(journal, Robot()) as executive:
    print(executive.wait("home", timeout=60))
