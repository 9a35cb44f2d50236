"""The examples in docstrings are run."""

from __future__ import annotations

import doctest
import importlib

import pytest
from conftest import names

MODULES = ["", "._answers", "._errors", "._executable", "._execution", "._executive", "._numbers", "._odds", "._problem",
           "._stepped", "._stop", "._tables", "._world"]  # fmt: skip


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name: str) -> None:
    module = importlib.import_module(f"elbowroom{name}")
    globs = {**vars(module), **names()}
    failed, _ = doctest.testmod(module, globs=globs, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0


def test_there_are_examples() -> None:
    finder = doctest.DocTestFinder()
    modules = [importlib.import_module(f"elbowroom{name}") for name in MODULES]
    examples = [e for m in modules for found in finder.find(m) for e in found.examples]
    assert len(examples) > 30
