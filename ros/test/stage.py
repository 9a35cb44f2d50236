"""Environment of the scenarios: robots, executives, and a client."""

import json
import os
import sys

import bags
from client import Client

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..")
sys.path.insert(0, os.path.join(ROOT, "testing"))
import ros2_stage  # noqa: E402
from ros2_stage import PATIENCE, end, play_all  # noqa: E402

__all__ = [
    "DOMAIN", "ELBOWROOM", "INTERFACES", "MAPPING", "PATIENCE", "PROBLEM", "Stage", "end", "executable", "play_all",
    "processes",
]  # fmt: skip

ELBOWROOM = os.path.abspath(sys.argv[1])
CONFIG = os.path.join(ROOT, "ros", "elbowroom_ros", "config")
DOMAIN, PROBLEM, MAPPING = (os.path.join(CONFIG, it) for it in ("domain.pddl", "problem.pddl", "nav2.yaml"))
INTERFACES = os.path.join(ROOT, "crates", "plansys2", "tests", "ros2", "plansys2_msgs", "msg")


class Stage(ros2_stage.Stage):
    """Environment of one scenario: robots, executives, and a client."""

    def __init__(self, domain_id, folder):
        super().__init__(domain_id, folder)
        self.domain_id, self._there, self._client = domain_id, [], None
        self.console = os.path.join(folder, "console")

    def robots(self, fleet, *arguments):
        """Starts action servers."""
        return self._begin([sys.executable, os.path.join(HERE, "fleet.py"), json.dumps(fleet), self.log_file, *arguments])

    def executive(self, *arguments, name="executive", **parameters):
        """Starts the node."""
        values = {"domain": DOMAIN, "problem": PROBLEM, "mapping": MAPPING, "elbowroom": ELBOWROOM, **parameters}
        words = [word for key, value in values.items() for word in ("-p", f"{key}:={value}")]
        return self._begin([executable("executive"), "--ros-args", *words, "-r", f"__node:={name}", *arguments])

    def _begin(self, command):
        with open(self.console, "a", encoding="utf-8") as console:
            process = self.start(command, stdout=console, stderr=console)
        self._there.append(process)
        return process

    def close(self):
        """Ends all processes of the scenario, the executives first, as they use the robots."""
        if self._client is not None:
            self._client.close()
        end(*reversed(self._there))

    def client(self, is_idle=True):
        """Returns the client, once the executive is idle."""
        if self._client is None:
            self._client = Client(self.domain_id, PATIENCE)
        if is_idle:
            self.until("an idle executive", lambda: self._client.activity() == "resting")
        return self._client

    def until(self, what, holds):
        return self.wait_for(what, holds, *(it for it in self._there if it.poll() is None))

    def result(self, goal):
        """Waits for the end of a goal. Returns its status and result."""
        self.until("a result", lambda: goal.result is not None)
        return goal.status, goal.result

    def said(self):
        with open(self.console, encoding="utf-8") as file:
            return file.read()

    def count(self, event, robot=None):
        return sum(it["event"] == event and robot in (None, it["robot"]) for it in self.log())

    def when(self, event, robot):
        """Returns the time of an event that must have happened exactly once."""
        (at,) = [it["at"] for it in self.log() if (it["event"], it["robot"]) == (event, robot)]
        return at

    def trace(self, client):
        """Returns the lines of the trace that a client has received."""
        return [it["line"] for it in bags.events(client.raw)]

    def file(self, name):
        return os.path.join(self.folder, name)

    def __str__(self):
        said = self.said() if os.path.exists(self.console) else ""
        return f"{super().__str__()}\n{said}"


def executable(name):
    """Returns the path of an installed program of the package."""
    for prefix in os.environ["AMENT_PREFIX_PATH"].split(":"):
        path = os.path.join(prefix, "lib", "elbowroom_ros", name)
        if os.path.exists(path):
            return path
    raise AssertionError(f"{name} is not installed")


def processes(word, domain_id):
    """Returns the processes of a scenario with a word in their command line."""
    found = []
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{process}/cmdline", "rb") as file:
                words = file.read().split(b"\0")
            with open(f"/proc/{process}/environ", "rb") as file:
                is_ours = f"ROS_DOMAIN_ID={domain_id}".encode() in file.read().split(b"\0")
        except OSError:
            continue
        if is_ours and word.encode() in words:
            found.append(int(process))
    return found
