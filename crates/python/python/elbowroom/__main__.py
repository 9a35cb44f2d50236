"""The command ``elbowroom``, also as ``python -m elbowroom``."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> int:
    """Runs the command with this program's arguments. Returns the exit code."""
    # By default, Python handles Ctrl-C only after native code has returned.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    program, *arguments = sys.argv
    if program.endswith("__main__.py"):
        program = "elbowroom"
    return _native.command([program, *arguments])


if __name__ == "__main__":
    sys.exit(main())
