#!/usr/bin/env python3
"""Executes the blocks of docs/guide, each document in an empty folder of its own.

  testing/guide.py PROGRAM [DOCUMENT…]     PROGRAM is the command elbowroom

The `sh` blocks of a document are one script, which ends at the first error; a line that begins with `! ` has to fail.
`python` blocks are executed if the package elbowroom can be imported. Blocks with `skip` after the language are not
executed, because they install something or need ROS.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(sh|python)( skip)?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
SECONDS = 300


def has_package() -> bool:
    found = subprocess.run([sys.executable, "-c", "import elbowroom"], capture_output=True)
    return found.returncode == 0


def script(text: str, with_python: bool) -> tuple[str, int, int]:
    """Returns the script of a document, and the numbers of executed and skipped blocks."""
    parts, executed, skipped = ["set -eu"], 0, 0
    for language, skip, code in BLOCK.findall(text):
        if skip or (language == "python" and not with_python):
            skipped += 1
            continue
        executed += 1
        if language == "python":
            parts.append(f"'{sys.executable}' - <<'END-OF-PYTHON'\n{code}END-OF-PYTHON")
        else:
            parts.append(re.sub(r"^! (.*)$", r"if \1; then echo 'this must fail' >&2; exit 1; fi", code, flags=re.MULTILINE))
    return "\n".join(parts) + "\n", executed, skipped


def follow(document: pathlib.Path, program: pathlib.Path, with_python: bool) -> bool:
    code, executed, skipped = script(document.read_text(encoding="utf-8"), with_python)
    environment = dict(os.environ, NO_COLOR="1")
    begin = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="elbowroom-guide-") as folder:
        # The program may be called elbowroom-1.0 or lie in a folder with others.
        tools = pathlib.Path(folder, "tools")
        work = pathlib.Path(folder, "work")
        tools.mkdir()
        work.mkdir()
        (tools / "elbowroom").symlink_to(program)
        environment["PATH"] = f"{tools}{os.pathsep}{environment['PATH']}"
        log = pathlib.Path(folder, "log")
        with log.open("wb") as output:
            shell = subprocess.Popen(
                ["bash", "-c", code], cwd=work, env=environment, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, start_new_session=True,
            )
            try:
                status = shell.wait(SECONDS)
            except subprocess.TimeoutExpired:
                status = None
            # Services that a failed document has left running belong to its session.
            try:
                os.killpg(shell.pid, 15)
            except ProcessLookupError:
                pass
        took = time.monotonic() - begin
        word = "ok" if status == 0 else "FAILED" if status is not None else "TIMED OUT"
        print(f"{word:9} {document.name:20} {executed} blocks, {skipped} skipped, {took:.1f} s", flush=True)
        if status != 0:
            print(log.read_text(encoding="utf-8", errors="replace")[-4000:])
    return status == 0


def main() -> int:
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    program = pathlib.Path(sys.argv[1]).resolve()
    documents = [pathlib.Path(name) for name in sys.argv[2:]] or sorted((ROOT / "docs/guide").glob("*.md"))
    with_python = has_package()
    if not with_python:
        print("skipped: python blocks: the package elbowroom cannot be imported")
    results = [follow(document, program, with_python) for document in documents]
    print(f"{sum(results)} of {len(results)} documents of the guide work")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
