"""A world in which the first action hangs. If it is cancelled, it reports its end, or nothing with `deaf`.

With `stuck`, it reports for ever that half of it is done.
"""

import os
import sys

sys.path.insert(0, os.path.join(os.getcwd(), "clients", "python"))
from elbowroom_world import Simulation  # noqa: E402


class Hanging(Simulation):
    hung = None

    def _launch(self, found, action):
        super()._launch(found, action)
        if self.hung is action.ticket and "stuck" in sys.argv:
            for turn in range(1, 1000):
                report = {"type": "feedback", "ticket": action.ticket, "completion": 0.5}
                self._coming.append((self.now() + 50 * turn, action.ticket, report))

    def _cancel(self, action):
        if self.hung != action.ticket or "deaf" not in sys.argv:
            super()._cancel(action)


world = Hanging()


@world.lasts("*")
def lasts(action):
    if world.hung is None:
        world.hung = action.ticket
        return 1e9
    return action.duration


world.run()
