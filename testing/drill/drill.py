#!/usr/bin/env python3
"""Adds an executor to a copy of the sources: one file (drill.rs) and one line of the registry, with its `mod`.

The executor must then appear in help, documents, contract test, rollouts, odds and Python, with no other change.
It is built with the artefacts of the crates below `execution` in target/, and without optimisation.

Run in the root of the sources: python3 testing/drill/drill.py [--python INTERPRETER]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPY = ROOT / "target/drill/sources"
TARGET = ROOT / "target"
EXECUTORS = "crates/execution/src/executors"

# The crates that contain the registry, or are built on it.
REBUILT = (
    "execution sim report mdp learning selection export laboratory page executive cli python".split()
)

# The features of the artefacts in target/ after .ci/run; ELBOWROOM_DRILL_FEATURES replaces them.
FEATURES = "elbowroom-plansys2/dds,elbowroom-python/extension-module"

DELAY = """
[[delay]]
action = "weld-quickly"
uniform = { from = 0, to = 0.001 }
"""
PLAN = "0: (weld-quickly left) [4]\n4.001: (weld-quickly right) [4]\n"


def copy_sources() -> None:
    """Copies all files of the repository with their times, so that unchanged crates need not be built."""
    shutil.rmtree(COPY, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, COPY / name)


def add_executor() -> None:
    shutil.copy(ROOT / "testing/drill/drill.rs", COPY / EXECUTORS / "drill.rs")
    registry = COPY / f"{EXECUTORS}.rs"
    text = registry.read_text(encoding="utf-8")
    head, rest = text.split("mod esterel;\n", 1)
    entries, tail = rest.split("    policy::REGISTERED,\n", 1)
    text = f"{head}mod drill;\nmod esterel;\n{entries}    policy::REGISTERED,\n    drill::REGISTERED,\n{tail}"
    registry.write_text(text, encoding="utf-8")


def cargo(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    packages = ["elbowroom", *(f"elbowroom-{name}" for name in REBUILT)]
    # Their own optimisation level gives these artefacts their own names beside those of the unchanged sources.
    settings = [it for name in packages for it in ("--config", f"profile.dev.package.{name}.opt-level=0")]
    line = ["cargo", *arguments[:1], *settings, "--workspace"]
    line += ["--features", os.environ.get("ELBOWROOM_DRILL_FEATURES", FEATURES), *arguments[1:]]
    settings = {"CARGO_TARGET_DIR": str(TARGET), "CARGO_INCREMENTAL": "0", **environment}
    return subprocess.run(line, cwd=COPY, text=True, env={**os.environ, **settings}, capture_output=True)


def built(*arguments: str, **environment: str) -> str:
    done = cargo(*arguments, **environment)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}\n{done.stderr}\ndrill: `cargo {' '.join(arguments)}` failed")
    return done.stdout + done.stderr


def check(holds: bool, place: str) -> None:
    if not holds:
        sys.exit(f"drill: the executor does not appear in {place}")
    print(f"drill: appears in {place}", flush=True)


def documents_and_contract() -> None:
    """The document of executors is out of date until it is generated again; the contract test covers the executor."""
    tests = ("test", "--test", "execution", "--")
    stale = cargo(*tests, "executors_page")
    check(stale.returncode != 0 and "docs/reference/executors.md is out of date" in stale.stdout, "the check of the documents")
    built(*tests, "executors_page", ELBOWROOM_UPDATE_DOCS="1")
    page = (COPY / "docs/reference/executors.md").read_text(encoding="utf-8")
    check("### `drill`" in page and "| `drill` | partial order |  | yes | yes |" in page, "the documents")
    built(*tests)
    own = COPY / EXECUTORS / "drill.rs"
    text = own.read_text(encoding="utf-8")
    broken = text.replace("        let decided = self.inner.decide(context);", BROKEN)
    assert broken != text
    own.write_text(broken, encoding="utf-8")
    refused = cargo(*tests, "contract")
    check(refused.returncode != 0 and "drill" in refused.stdout, "the contract test, which rejects a broken version")
    own.write_text(text, encoding="utf-8")


# Replans for ever.
BROKEN = """        if self.inner.decide(context).reason.cause != crate::reason::Cause::GoalReached {
            return super::without_plan();
        }
        let decided = self.inner.decide(context);"""


def command() -> None:
    program = TARGET / "drill/elbowroom"
    folder = TARGET / "drill/files"
    folder.mkdir(exist_ok=True)
    world, plan = folder / "world.toml", folder / "weld.plan"
    weld = COPY / "experiments/weld"
    plan.write_text(PLAN, encoding="utf-8")
    # There is no table of action values for worlds with delays.
    world.write_text((weld / "world.toml").read_text(encoding="utf-8") + DELAY, encoding="utf-8")

    def output(*arguments: object) -> str:
        line = [str(program), *map(str, arguments)]
        done = subprocess.run(line, capture_output=True, text=True, cwd=folder, stdin=subprocess.DEVNULL)
        return done.stdout + done.stderr

    check("drill\n      Tests the registry" in output("run", "--help"), "the help of `run`")
    check("`drill` by default" in " ".join(output("odds", "--help").split()), "the help of `odds`")
    problem = (weld / "domain.pddl", weld / "problem.pddl", plan)
    check("drill" in output("run", *problem[:2], "--executor", "dril").split("choose one of")[-1], "the list of a wrong name")

    def reasons(executor: str, world: Path) -> str:
        trace = folder / "trace.jsonl"
        run = ("run", *problem, "--world", world, "--executor", executor, "--max-replans", "0", "--seed", "2")
        output(*run, "--planning-time", "1", "--trace", trace)
        return trace.read_text(encoding="utf-8")

    check("drill with action values" in reasons("drill", weld / "world.toml"), "runs with a table of action values")
    check("drill with rollouts" in reasons("drill", world), "runs with rollouts")
    check("drill alone" in reasons("policy", world), "the choices of rollouts, which hand the plan over to it")
    odds = ("odds", *problem, "--likelihoods", weld / "likelihoods.toml", "--world", weld / "world.toml")
    found = json.loads(output(*odds, "--samples", "20", "--json"))
    check("drill" in [it["executor"] for it in found["executed"]], "the answer of `odds`")


SCRIPT = """
import elbowroom, sys
folder, world, plan = sys.argv[1:]
assert "drill" in [it.name for it in elbowroom.executors()]
problem = elbowroom.read(f"{folder}/domain.pddl", f"{folder}/problem.pddl")
run = problem.run(plan, executor="drill", world=world, seed=2)
assert "drill with rollouts" in run.trace_text, run
"""


def python(interpreter: str) -> None:
    package = TARGET / "drill/python/elbowroom"
    shutil.rmtree(package, ignore_errors=True)
    shutil.copytree(COPY / "crates/python/python/elbowroom", package)
    shutil.copy(TARGET / "drill/libelbowroom_python.so", package / "_native.abi3.so")
    files = TARGET / "drill/files"
    line = [interpreter, "-c", SCRIPT, str(COPY / "experiments/weld"), str(files / "world.toml"), str(files / "weld.plan")]
    done = subprocess.run(line, env={**os.environ, "PYTHONPATH": str(package.parent)}, text=True, capture_output=True)
    print(done.stderr, end="")
    check(done.returncode == 0, "the Python module")


def nothing_else_changed() -> None:
    changed = set()
    for path in COPY.rglob("*"):
        if path.is_file():
            own = ROOT / path.relative_to(COPY)
            if not own.is_file() or own.read_bytes() != path.read_bytes():
                changed.add(str(path.relative_to(COPY)))
    allowed = {f"{EXECUTORS}.rs", f"{EXECUTORS}/drill.rs", "docs/reference/executors.md"}
    if changed != allowed:
        sys.exit(f"drill: other files were changed: {sorted(changed - allowed)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable, help="the interpreter that loads the Python module")
    arguments = parser.parse_args()
    copy_sources()
    add_executor()
    documents_and_contract()
    # Cargo puts both programs beside those of the unchanged sources, which are put back.
    names = ("elbowroom", "libelbowroom_python.so")
    kept = {name: TARGET / "drill" / f"{name}.kept" for name in names if (TARGET / "debug" / name).exists()}
    for name, copy in kept.items():
        shutil.copy2(TARGET / "debug" / name, copy)
    built("build", "--bin", "elbowroom", "--lib", "--test", "execution")
    for name in names:
        shutil.move(TARGET / "debug" / name, TARGET / "drill" / name)
    for name, copy in kept.items():
        shutil.move(copy, TARGET / "debug" / name)
    command()
    python(arguments.python)
    nothing_else_changed()


if __name__ == "__main__":
    main()
