"""Experiments, whole and in parts."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import ROOT

import elbowroom

TEXT = """
format = "elbowroom-experiment"
version = 1
title = "Late drives"
domain = "delivery/domain.pddl"
problem = "delivery/problem.pddl"
trials = 100
seed = 1
executors = ["guarded", "stn"]
planner_states = 256
improve_states = 1

[[column]]
name = "drives"
world = "delivery/world.toml"
"""
TABLE = elbowroom.Experiment(TEXT, ROOT / "cases")


@pytest.fixture(scope="module")
def whole() -> elbowroom.Comparison:
    return elbowroom.compare(TABLE, trials=4)


def test_parts_add_up_to_the_same_bytes(whole: elbowroom.Comparison, tmp_path: Path) -> None:
    parts = elbowroom.compare(TABLE, trials=4, shards=3, folder=tmp_path)
    assert parts.results == whole.results
    assert (tmp_path / "results.json").read_bytes() == whole.results.encode()


def test_parts_that_are_done_are_not_made_again(
    whole: elbowroom.Comparison, tmp_path: Path
) -> None:
    elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path)
    (tmp_path / "part-1-of-2.json").unlink()
    kept = (tmp_path / "part-0-of-2.json").stat().st_mtime_ns
    again = elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path)
    assert again.results == whole.results
    assert (tmp_path / "part-0-of-2.json").stat().st_mtime_ns == kept


def test_parts_of_another_experiment_are_refused(tmp_path: Path) -> None:
    (tmp_path / "part-0-of-2.json").write_text("{}")
    with pytest.raises(elbowroom.CampaignError, match="part-0-of-2.json"):
        elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path)


@pytest.mark.parametrize("change", ["cut", "digit", "empty"])
def test_a_damaged_part_is_named_and_made_again(
    whole: elbowroom.Comparison, tmp_path: Path, change: str
) -> None:
    elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path)
    path = tmp_path / "part-1-of-2.json"
    written = path.read_text()
    at = written.index('"successes": ') + len('"successes": ')
    digit = str((int(written[at]) + 1) % 10)
    damaged = {"cut": written[: len(written) // 2], "empty": "", "digit": written[:at] + digit + written[at + 1 :]}
    path.write_text(damaged[change])
    with pytest.warns(elbowroom.DamagedWarning, match="part-1-of-2.json is damaged"):
        again = elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path)
    assert again.results == whole.results
    assert path.read_text() == written


def test_a_part_that_the_command_has_made_is_taken(
    whole: elbowroom.Comparison, tmp_path: Path
) -> None:
    # This part has no checksum.
    (tmp_path / "part-0-of-2.json").write_text(TABLE.make(4, (0, 2)))
    kept = (tmp_path / "part-0-of-2.json").stat().st_mtime_ns
    assert elbowroom.compare(TABLE, trials=4, shards=2, folder=tmp_path).results == whole.results
    assert (tmp_path / "part-0-of-2.json").stat().st_mtime_ns == kept


def test_without_a_scheduler_the_script_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(elbowroom.CampaignError, match="sbatch"):
        elbowroom.compare(TABLE, trials=4, shards=2, engine="slurm", folder=tmp_path)
    script = (tmp_path / "job.sh").read_text()
    assert "#SBATCH --array=0,1\n" in script and len(script.splitlines()) <= 10


def test_a_job_of_the_script_makes_its_part(
    whole: elbowroom.Comparison, tmp_path: Path
) -> None:
    """A scheduler that runs the array here, but for one element."""
    scheduler = tmp_path / "bin" / "sbatch"
    scheduler.parent.mkdir()
    scheduler.write_text(
        '#!/bin/sh\nfor i in $(sed -n "s/^#SBATCH --array=//p" "$2" | tr , " "); do\n'
        f'  if [ $i = 1 ] && [ ! -e {tmp_path}/again ]; then touch {tmp_path}/again; continue; fi\n'
        '  SLURM_ARRAY_TASK_ID=$i sh "$2"\ndone\necho "Submitted batch job 7"\n'
    )
    scheduler.chmod(0o755)
    folder = tmp_path / "parts"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", f"{scheduler.parent}:/usr/bin:/bin")
        with pytest.raises(elbowroom.CampaignError, match="part 1 of 2"):
            elbowroom.compare(TABLE, trials=4, shards=2, engine="slurm", folder=folder)
        done = elbowroom.compare(TABLE, trials=4, shards=2, engine="slurm", folder=folder)
    assert done.results == whole.results


def _has_idle_node() -> bool:
    if shutil.which("sbatch") is None or shutil.which("sinfo") is None:
        return False
    found = subprocess.run(
        ["sinfo", "--noheader", "--states=idle"], capture_output=True, text=True, check=False
    )
    return found.returncode == 0 and bool(found.stdout.strip())


@pytest.mark.skipif(not _has_idle_node(), reason="there is no Slurm here with an idle node")
def test_slurm_itself_makes_the_parts(whole: elbowroom.Comparison, tmp_path: Path) -> None:
    made = elbowroom.compare(TABLE, trials=4, shards=3, engine="slurm", folder=tmp_path)
    assert made.results == whole.results


def test_results_are_tables(whole: elbowroom.Comparison, tmp_path: Path) -> None:
    rows = whole.rows()
    assert rows and all(row.successes <= row.runs for row in rows)
    assert whole._repr_html_().startswith("<table>")
    whole.write(tmp_path)
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(tmp_path / "results.parquet")
    assert table.num_rows == len(rows)


@pytest.mark.parametrize("reader", ["pandas", "polars", "duckdb"])
def test_the_parquet_of_a_campaign_is_read(
    whole: elbowroom.Comparison, tmp_path: Path, reader: str
) -> None:
    pytest.importorskip("pyarrow")
    library = pytest.importorskip(reader)
    whole.write(tmp_path)
    path = str(tmp_path / "results.parquet")
    if reader == "duckdb":
        asked = f"SELECT sum(runs), sum(successes) FROM '{path}'"
        sums = library.connect().execute(asked).fetchone()
    else:
        frame = library.read_parquet(path)
        sums = (frame["runs"].sum(), frame["successes"].sum())
    rows = whole.rows()
    assert tuple(sums) == (sum(row.runs for row in rows), sum(row.successes for row in rows))


def test_progress_is_told() -> None:
    heard: list[elbowroom.Progress] = []
    elbowroom.compare(TABLE, trials=2, progress=heard.append)
    assert heard and heard[-1].done == heard[-1].total


def test_ctrl_c_gives_the_trials_until_then() -> None:
    def interrupt(_: elbowroom.Progress) -> None:
        raise KeyboardInterrupt

    with pytest.warns(elbowroom.InterruptedWarning):
        comparison = elbowroom.compare(TABLE, trials=2000, progress=interrupt)
    assert comparison.is_interrupted


def test_an_unknown_engine_is_named() -> None:
    with pytest.raises(ValueError, match="local, ray or slurm"):
        elbowroom.compare(TABLE, engine="cloud")
    with pytest.raises(elbowroom.RequestError, match="part 3 of 3 does not exist"):
        TABLE.make(2, (3, 3))
