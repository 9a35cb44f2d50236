"""The process `elbowroom serve` of an executive node."""

import ctypes
import os
import secrets
import signal
import subprocess
import sys
import time

PR_SET_PDEATHSIG = 1


class ServerProcess:
    """Starts `elbowroom serve`, or resumes it from its journal. Its socket and token are in a folder that only the owner can
    read.

    `options` has the members `elbowroom`, `domain`, `problem`, `plan`, `world` (a command line), `executor`, `journal`,
    `http`, `restarts` and `arguments` (a list)."""

    def __init__(self, options, folder):
        self._options = options
        self.socket = os.path.join(folder, "socket")
        self._token_file = os.path.join(folder, "token")
        self.token = secrets.token_hex(16)
        with open(os.open(self._token_file, os.O_CREAT | os.O_WRONLY, 0o600), "w", encoding="utf-8") as file:
            file.write(self.token)
        self._process = None

    def start(self):
        """Starts the program."""
        if os.path.exists(self.socket):
            os.remove(self.socket)
        # A killed node must not leave a program that nobody can stop. With a journal it can be resumed after a kill,
        # but not after an orderly end.
        at_death = signal.SIGKILL if self._options["journal"] else signal.SIGTERM
        library = ctypes.CDLL(None)

        def tie_to_parent():
            library.prctl(PR_SET_PDEATHSIG, at_death)

        on_linux = sys.platform == "linux"
        self._process = subprocess.Popen(self.command(), stdin=subprocess.DEVNULL, start_new_session=True,
                                         preexec_fn=tie_to_parent if on_linux else None)  # fmt: skip

    def command(self):
        """Returns the command line. An unfinished journal is resumed; a finished one is kept under another name."""
        it = self._options
        common = ["--token", self._token_file, "--socket", self.socket, "--http", it["http"]]
        common += ["--restart-world", str(it["restarts"])]
        # A resumed run has the other options in its journal.
        if self.is_resumable():
            return [it["elbowroom"], "serve", "--resume", it["journal"], *common]
        if has_contents(it["journal"]):
            os.rename(it["journal"], f"{it['journal']}.{time.time_ns() // 1_000_000}")
        line = [it["elbowroom"], "serve", *(it[name] for name in ("domain", "problem", "plan") if it[name]), *common]
        line += ["--world-process", it["world"], "--executor", it["executor"]]
        line += ["--journal", it["journal"]] if it["journal"] else []
        return [*line, *it["arguments"]]

    def is_resumable(self):
        """Returns `True` if there is the journal of a run that was not stopped."""
        journal = self._options["journal"]
        return has_contents(journal) and not is_finished(journal)

    def exit_code(self):
        """Returns the exit code, or `None` while the program runs."""
        return self._process.poll()

    def stop(self, within):
        """Ends the program in order: running actions are cancelled. It is killed after `within` seconds."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(within)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def has_contents(path):
    return bool(path) and os.path.exists(path) and os.path.getsize(path) > 0


def is_finished(journal):
    """Returns `True` if the run of a journal was stopped, so that it cannot be resumed."""
    with open(journal, "rb") as file:
        file.seek(max(0, os.path.getsize(journal) - 1_000_000))
        return b'{"verdict":"interrupted"' in file.read().rstrip(b"\n").rpartition(b"\n")[2]
