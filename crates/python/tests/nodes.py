"""A campaign on a local Ray cluster of several nodes, one of which is killed on the way.

    python crates/python/tests/nodes.py EXPERIMENT.toml|table1 TRIALS PARTS

``table1`` stands for a slice of Table 1: its 100 problems, its first column, two executors; 500 trials are
100,000 runs. It needs Ray. It says whether the results are the bytes that one process makes, and fails if they are not.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import ray
from ray.cluster_utils import Cluster

import elbowroom

MEMORY = 80 * 2**20


def slice_of_table1() -> elbowroom.Experiment:
    """The first column, for `guarded` and `fixed:30`, and without the executor that knows the future."""
    folder = Path(__file__).parents[3] / "experiments"
    text = (folder / "table1.toml").read_text()
    columns = text.split("[[column]]")
    head = re.sub(r"executors = \[.*?\]", 'executors = ["guarded", "fixed:30"]', columns[0], flags=re.DOTALL)
    head = head.replace("clairvoyant = true", "clairvoyant = false")
    return elbowroom.Experiment(f"{head}[[column]]{columns[1]}", folder)


def main(path: str, trials: int, parts: int) -> None:
    experiment = slice_of_table1() if path == "table1" else elbowroom.Experiment(path)
    begin = time.monotonic()
    alone = elbowroom.compare(experiment, trials=trials)
    print(f"one process: {time.monotonic() - begin:.1f} s", flush=True)
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": MEMORY}
    )
    others = [cluster.add_node(num_cpus=1, object_store_memory=MEMORY) for _ in range(2)]
    ray.init(address=cluster.address, log_to_driver=False)
    # The client talks to one of the nodes, which must stay.
    own = ray.get_runtime_context().get_node_id()
    victims = [node for node in others if node.node_id != own][:1]

    def kill(progress: elbowroom.Progress) -> None:
        print(f"{progress.done} of {progress.total} parts", flush=True)
        while victims:
            cluster.remove_node(victims.pop(), allow_graceful=False)
            print("one node killed", flush=True)

    begin = time.monotonic()
    together = elbowroom.compare(
        experiment, trials=trials, engine="ray", shards=parts, progress=kill
    )
    alive = sum(node["Alive"] for node in ray.nodes())
    print(f"Ray: {time.monotonic() - begin:.1f} s, {alive} of 3 nodes left")
    print(f"{sum(row.runs for row in together.rows())} runs")
    assert not victims, "nothing was killed"
    assert together.results == alone.results, "the results differ"
    print("the same bytes")
    ray.shutdown()
    cluster.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
