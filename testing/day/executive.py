"""The executive of the demonstration "a day": its process, its requests, and its journal."""

import http.client
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import threading
import time

TOKEN = "a-token-of-some-length"
HERE = pathlib.Path(__file__).resolve().parent


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Executive:
    """`elbowroom serve` in a folder with `domain.pddl` and `problem.pddl`."""

    def __init__(self, program, folder, options):
        self.program, self.folder = program, folder
        self.port = free_port()
        self.journal = folder / "day.journal"
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        world = f"{sys.executable} {HERE / 'world.py'} {folder}"
        begin = [folder / "domain.pddl", folder / "problem.pddl", "--world-process", world]
        begin += ["--journal", self.journal, *options]
        self.latencies = []
        self.errors = []
        self.launch(begin)

    def launch(self, line):
        line = [self.program, "serve", *line, "--restart-world", "1000000", "--answer-within", "60"]
        line += ["--journal-size", "500K", "--journal-segments", "1000"]
        line += ["--http", str(self.port), "--token", self.folder / "token"]
        self.stderr = open(self.folder / "stderr.txt", "a", encoding="utf-8")
        self.process = subprocess.Popen([str(it) for it in line], stdout=subprocess.DEVNULL, stderr=self.stderr)

    def resume(self):
        self.launch(["--resume", self.journal])

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def ask(self, verb, path, body=None, timeout=30):
        """Sends a request; returns status and answer, or status 0 if there is no answer."""
        begin = time.monotonic()
        try:
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
            headers = {"Authorization": f"Bearer {TOKEN}"}
            connection.request(verb, path, json.dumps(body) if body is not None else "", headers)
            response = connection.getresponse()
            answer = json.loads(response.read())
            connection.close()
        except (OSError, http.client.HTTPException, ValueError) as error:
            return 0, {"error": repr(error)}
        self.latencies.append(time.monotonic() - begin)
        return response.status, answer

    def await_answer(self, seconds=60):
        """Waits until the executive answers; returns `False` if its process ends or time is over."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and self.process.poll() is None:
            if self.ask("GET", "/v1/state")[0] == 200:
                return True
            time.sleep(0.05)
        return False

    def segments(self):
        """Paths of all segments of the journal, oldest first."""
        earlier = [path for path in self.folder.glob("day.journal.*") if path.suffix[1:].isdigit()]
        earlier.sort(key=lambda path: -int(path.suffix[1:]))
        return [*earlier, self.journal]

    def entries(self):
        """All entries of the journal."""
        for path in self.segments():
            for line in path.read_text(encoding="utf-8").splitlines():
                try:
                    yield json.loads(line[9:])
                except ValueError:
                    return
