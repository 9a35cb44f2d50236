"""Executive in this process: it pursues goals, is killed, and resumes. `python restart.py JOURNAL` in the repository"""

import os
import subprocess
import sys

import elbowroom

CASE = ("cases/delivery/domain.pddl", "cases/delivery/problem.pddl")


class Robot(elbowroom.SteppedWorld):
    speed = 20.0  # simulated seconds in one second
    ends = {}  # the time at which each running action ends

    def begin(self, action):
        self.ends[action] = self.now + action.duration

    def step(self, dt):
        for action in [it for it, end in self.ends.items() if end <= self.now]:
            del self.ends[action]
            self.succeeded(action)

    def cancel(self, action):
        del self.ends[action]

    def resume(self, now, actions):  # this robot has finished its actions on its own
        return now, [elbowroom.ended(action, now) for action in actions]


if len(sys.argv) > 2:  # the process that is killed
    executive = elbowroom.Executive(*CASE, world=Robot(), journal=sys.argv[1])
    executive.wait("problem", timeout=60)
    executive.submit("(at rover depot)", name="home")
    os.kill(os.getpid(), 9)

subprocess.run([sys.executable, __file__, sys.argv[1], "first"])
with elbowroom.Executive.resume(sys.argv[1], Robot()) as executive:
    print(executive.wait("home", timeout=60))
