"""Experiments: comparison of executors in many runs, on one machine, with Ray, or with Slurm.

The results do not depend on the machines, the number of parts, or the number of workers: trials
are numbered, each has its own seed, and the results consist of counts.
"""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native, _plots
from ._errors import CampaignError, DamagedWarning, InterruptedWarning
from ._texts import Text, named_text
from ._tables import Progress, ProgressCallback, Table, html_table, listener

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Cell(NamedTuple):
    """Successes and costs of one executor in one column."""

    row: str
    """The executor; for worlds without time, with its case."""
    column: str
    """The world."""
    runs: int
    successes: int
    replans: int


class Experiment:
    """An experiment file with all files that it names; it can be sent to other machines.

    Raises:
        ReadError: if it, or a file that it names, cannot be read.
        OSError: if there is no such file.
    """

    def __init__(self, experiment: Text, folder: str | os.PathLike[str] | None = None) -> None:
        self.name, self.text = named_text(experiment, "experiment")
        beside = os.path.dirname(self.name) if folder is None else os.fspath(folder)
        self.files: dict[str, str] = _native.experiment_files(self.name, self.text, beside)
        self._native = _native.Experiment(self.name, self.text, self.files)

    @property
    def trials(self) -> int:
        """Returns the number of trials of each problem, case or column."""
        return self._native.trials()

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.name, self.text, self.files)

    def make(
        self,
        trials: int | None = None,
        shard: tuple[int, int] = (0, 1),
        jobs: int = 0,
        progress: ProgressCallback | bool | None = None,
    ) -> str:
        """Runs one part of the trials. Returns ``results.json`` as the command writes it.

        Raises:
            KeyboardInterrupt: at Ctrl-C. There are no incomplete parts.
        """
        results, is_interrupted = self._make(trials, shard, jobs, progress)
        if is_interrupted:
            raise KeyboardInterrupt
        return results

    def _make(
        self,
        trials: int | None,
        shard: tuple[int, int],
        jobs: int,
        progress: ProgressCallback | bool | None,
    ) -> tuple[str, bool]:
        count = self.trials if trials is None else trials
        return self._native.make(count, shard, jobs, listener(progress))

    def merge(self, parts: Sequence[str]) -> str:
        """Merges parts.

        Raises:
            RequestError: if a part belongs to another experiment, or occurs twice.
        """
        return self._native.merge(list(parts))


def _again(name: str, text: str, files: dict[str, str]) -> Experiment:
    experiment = Experiment.__new__(Experiment)
    experiment.name, experiment.text, experiment.files = name, text, files
    experiment._native = _native.Experiment(name, text, files)
    return experiment


class Comparison(Table):
    """Results of an experiment."""

    def __init__(self, experiment: Experiment, results: str) -> None:
        self.results: str = results
        """``results.json``, byte for byte as the command writes it."""
        self.document: dict[str, Any] = json.loads(results)
        """The parsed ``results.json``."""
        self.csv, self.markdown, self.text = experiment._native.tables(results)

    @property
    def is_interrupted(self) -> bool:
        """``True`` if it was interrupted before all trials had run."""
        return bool(self.document.get("is_interrupted", False))

    def rows(self) -> list[Cell]:
        """A row for each executor and column."""
        found = self.document
        if "cells" in found:
            return [
                Cell(row, column, cell["runs"], cell["successes"], cell["replans"])
                for row, cells in zip(found["rows"], found["cells"])
                for column, cell in zip(found["columns"], cells)
            ]
        return [
            Cell(
                f"{row['executor']}, {row['case']}",
                str(row["world"]),
                int(row.get("trials", row.get("runs", 0))),
                int(row["successes"]),
                0,
            )
            for row in found["rows"]
        ]

    def _fields(self) -> Sequence[str]:
        return Cell._fields

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        rows = [
            (c.row, c.column, str(c.runs), f"{100 * c.successes / max(c.runs, 1):.1f} %")
            for c in self.rows()
        ]
        heads = ("executor", "world", "runs", "reached the goal")
        return html_table(heads, rows, str(self.document["title"]))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the success rate of each executor."""
        return _plots.rates(self, ax)

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Writes ``results.json``, ``table.csv``, ``table.md``, and, where pyarrow is installed,
        ``results.parquet``."""
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        _keep(path / "results.json", self.results)
        _keep(path / "table.csv", self.csv)
        _keep(path / "table.md", self.markdown)
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            return
        cells = self.rows()
        columns = {field: [cell[i] for cell in cells] for i, field in enumerate(Cell._fields)}
        pyarrow.parquet.write_table(pyarrow.table(columns), path / "results.parquet")


def compare(
    experiment: Text | Experiment,
    *,
    engine: str = "local",
    trials: int | None = None,
    shards: int | None = None,
    jobs: int = 0,
    folder: str | os.PathLike[str] | None = None,
    address: str | None = None,
    retries: int = 3,
    sbatch: Sequence[str] = (),
    wait: bool = True,
    progress: ProgressCallback | bool | None = None,
) -> Comparison:
    """Runs an experiment, which compares executors in many runs.

    Args:
        experiment: an experiment file (``docs/reference/formats/experiment.md``).
        engine: ``"local"``: threads of this process; ``"ray"``: tasks of a Ray cluster;
            ``"slurm"``: a job array.
        trials: the number of trials of each problem and column; by default that of the experiment.
        shards: the number of parts; by default 1 locally, otherwise 8.
        jobs: the number of threads; by default one for each processor (1 with Ray and Slurm).
        folder: the folder for parts and results. Existing parts are not computed again, unless
            their bytes have changed since they were written; a :class:`DamagedWarning` reports
            that. Slurm needs a folder that all nodes share.
        address: the address of the Ray cluster; by default a running one, or one on this machine.
        retries: the number of times that a part is computed again if its worker dies.
        sbatch: further options of ``sbatch``, such as ``["--partition=short"]``.
        wait: with Slurm, ``True`` to wait for the jobs. Otherwise call again to collect the parts.
        progress: receives the number of finished trials or parts; ``True`` shows a bar.

    Returns:
        The results. Their bytes do not depend on the engine and the number of parts.

    Raises:
        ReadError: if the experiment cannot be read.
        CampaignError: if parts are missing; it names them.
    """
    read = experiment if isinstance(experiment, Experiment) else Experiment(experiment)
    if engine not in ("local", "ray", "slurm"):
        raise ValueError(f"unknown engine {engine!r}; expected local, ray or slurm")
    count = shards if shards is not None else (1 if engine == "local" else 8)
    if count < 1:
        raise ValueError(f"{count} parts; expected at least one")
    keep = None if folder is None else Path(folder)
    parts = _Parts(read, trials, count, keep)
    if engine == "local":
        comparison = _local(parts, jobs, progress)
    elif engine == "ray":
        comparison = _ray(parts, jobs or 1, address, retries, progress)
    else:
        comparison = _slurm(parts, jobs or 1, sbatch, wait, progress)
    if keep is not None and not comparison.is_interrupted:
        comparison.write(keep)
    return comparison


class _Parts:
    """The parts of an experiment, in memory or in a folder."""

    def __init__(
        self, experiment: Experiment, trials: int | None, shards: int, folder: Path | None
    ) -> None:
        self.experiment, self.trials, self.shards = experiment, trials, shards
        self.folder = folder
        self.made: dict[int, str] = {}
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            self.collect()

    def path(self, shard: int) -> Path:
        assert self.folder is not None
        return self.folder / f"part-{shard}-of-{self.shards}.json"

    def collect(self) -> None:
        """Reads the existing parts. Damaged parts are reported, and have to be computed again."""
        for shard in range(self.shards):
            path = self.path(shard)
            if shard in self.made or not path.exists():
                continue
            damage = _damage(path)
            if damage is None:
                self.made[shard] = self._checked(path)
            else:
                warnings.warn(f"{path} is damaged ({damage}); it is computed again", DamagedWarning, 4)

    def _checked(self, path: Path) -> str:
        text = path.read_bytes().decode("utf-8")
        wanted = self.experiment.trials if self.trials is None else self.trials
        try:
            self.experiment.merge([text])
            if json.loads(text)["trials"] != wanted:
                raise CampaignError(f"it has {json.loads(text)['trials']} trials, not {wanted}")
        except Exception as error:
            raise CampaignError(
                f"{path} is not a part of this experiment ({error}); use another folder, or remove the file"
            ) from error
        return text

    def keep(self, shard: int, results: str) -> None:
        self.made[shard] = results
        if self.folder is not None:
            path = self.path(shard)
            _keep(path, results)
            # In the format of `sha256sum`. The sum is written last: a part with an older sum is
            # computed again.
            _keep(_sum_of(path), f"{hashlib.sha256(results.encode()).hexdigest()}  {path.name}\n")

    def missing(self) -> list[int]:
        return [shard for shard in range(self.shards) if shard not in self.made]

    def merged(self, why: dict[int, str] | None = None) -> Comparison:
        missing = self.missing()
        if missing:
            reasons = why or {}
            named = "; ".join(
                f"part {shard} of {self.shards}"
                + (f" ({reasons[shard]})" if shard in reasons else "")
                for shard in missing
            )
            kept = f"; the other parts are in {self.folder}" if self.folder is not None else ""
            raise CampaignError(f"missing: {named}{kept}; call again to compute only these")
        parts = [self.made[shard] for shard in range(self.shards)]
        results = parts[0] if self.shards == 1 else self.experiment.merge(parts)
        return Comparison(self.experiment, results)


def _sum_of(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _damage(path: Path) -> str | None:
    """The error in the bytes of a part; ``None`` for parts without a checksum."""
    found = path.read_bytes()
    beside = _sum_of(path)
    if beside.exists():
        if beside.read_text(encoding="utf-8", errors="replace").split()[:1] != [
            hashlib.sha256(found).hexdigest()
        ]:
            return f"its content differs from {beside.name}"
        return None
    try:
        json.loads(found)
    except ValueError:
        return "it is not a JSON document"
    return None


def _keep(path: Path, text: str) -> None:
    """Writes a file atomically."""
    unfinished = path.with_name(f"{path.name}.{os.getpid()}.unfinished")
    unfinished.write_text(text, encoding="utf-8", newline="\n")
    unfinished.replace(path)


def _local(parts: _Parts, jobs: int, progress: ProgressCallback | bool | None) -> Comparison:
    for shard in parts.missing():
        made, is_interrupted = parts.experiment._make(
            parts.trials, (shard, parts.shards), jobs, progress
        )
        if is_interrupted:
            warnings.warn("interrupted by Ctrl-C; these are the trials so far", InterruptedWarning, 3)
            whole = [*parts.made.values(), made]
            merged = made if len(whole) == 1 else parts.experiment.merge(whole)
            return Comparison(parts.experiment, merged)
        parts.keep(shard, made)
    return parts.merged()


def _ray(
    parts: _Parts,
    jobs: int,
    address: str | None,
    retries: int,
    progress: ProgressCallback | bool | None,
) -> Comparison:
    try:
        import ray
        import ray.exceptions
    except ImportError as error:
        raise ImportError('engine="ray" needs Ray: `pip install ray`') from error
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    tell = listener(progress)
    make = ray.remote(num_cpus=jobs, max_retries=retries)(_make_part)
    experiment = ray.put(parts.experiment)
    waiting = {
        make.remote(experiment, parts.trials, (shard, parts.shards), jobs): shard
        for shard in parts.missing()
    }
    why: dict[int, str] = {}
    while waiting:
        ready, _ = ray.wait(list(waiting), num_returns=1)
        for task in ready:
            shard = waiting.pop(task)
            try:
                parts.keep(shard, ray.get(task))
            except ray.exceptions.RayError as error:
                why[shard] = type(error).__name__
        if tell is not None:
            tell(*Progress("parts", len(parts.made), parts.shards, ""))
    return parts.merged(why)


def _make_part(
    experiment: Experiment, trials: int | None, shard: tuple[int, int], jobs: int
) -> str:
    return experiment.make(trials, shard, jobs)


SCRIPT = """\
#!/bin/sh
#SBATCH --job-name=elbowroom
#SBATCH --array={array}
#SBATCH --cpus-per-task={jobs}
#SBATCH --requeue
#SBATCH --output={folder}/part-%a.log
# One part each; existing parts are not computed again.
exec {python} -m elbowroom._job {folder} "$SLURM_ARRAY_TASK_ID" {shards} {jobs} {trials}
"""
"""The job script, which is written to ``job.sh`` in the folder."""


def _slurm(
    parts: _Parts,
    jobs: int,
    options: Sequence[str],
    wait: bool,
    progress: ProgressCallback | bool | None,
) -> Comparison:
    if parts.folder is None:
        raise ValueError('engine="slurm" needs a folder shared by all nodes: folder="…"')
    missing = parts.missing()
    if not missing:
        return parts.merged()
    folder = parts.folder.resolve()
    experiment = parts.experiment
    inputs = {"name": experiment.name, "text": experiment.text, "files": experiment.files}
    _keep(folder / "experiment.json", json.dumps(inputs))
    script = SCRIPT.format(
        array=",".join(map(str, missing)),
        jobs=jobs,
        folder=shlex.quote(str(folder)),
        python=shlex.quote(sys.executable),
        shards=parts.shards,
        trials=experiment.trials if parts.trials is None else parts.trials,
    )
    _keep(folder / "job.sh", script)
    command = ["sbatch", *(["--wait"] if wait else []), *options, str(folder / "job.sh")]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise CampaignError(
            f"sbatch was not found; on a machine of the cluster, `sbatch {folder}/job.sh` "
            "computes the missing parts"
        ) from error
    parts.collect()
    tell = listener(progress)
    if tell is not None:
        tell(*Progress("parts", len(parts.made), parts.shards, done.stdout.strip()))
    if done.returncode != 0 and parts.missing() and not done.stdout.strip():
        raise CampaignError(f"sbatch rejected the job: {done.stderr.strip()}")
    if not wait and parts.missing():
        raise CampaignError(
            f"{done.stdout.strip()}: {len(parts.missing())} of {parts.shards} parts are "
            "pending; call again after the jobs to collect them"
        )
    return parts.merged({shard: f"see {folder}/part-{shard}.log" for shard in parts.missing()})


def make_part(arguments: Sequence[str]) -> None:
    """Computes one part, in a job of Slurm (``python -m elbowroom._job``)."""
    folder, (shard, shards, jobs, trials) = Path(arguments[0]), map(int, arguments[1:5])
    inputs = json.loads((folder / "experiment.json").read_text(encoding="utf-8"))
    experiment = _again(inputs["name"], inputs["text"], inputs["files"])
    parts = _Parts(experiment, trials, shards, folder)
    if shard in parts.missing():
        parts.keep(shard, experiment.make(trials, (shard, shards), jobs))
