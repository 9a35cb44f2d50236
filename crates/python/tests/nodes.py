"""A campaign on a local Ray cluster of several nodes, one of which is killed on the way.

    python crates/python/tests/nodes.py EXPERIMENT.toml TRIALS PARTS

It needs Ray. It says whether the results are the bytes that one process makes, and fails if they are not.
"""

from __future__ import annotations

import sys
import time

import ray
from ray.cluster_utils import Cluster

import elbowroom

MEMORY = 80 * 2**20


def main(path: str, trials: int, parts: int) -> None:
    experiment = elbowroom.Experiment(path)
    begin = time.monotonic()
    alone = elbowroom.compare(experiment, trials=trials)
    print(f"one process: {time.monotonic() - begin:.1f} s", flush=True)
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": MEMORY}
    )
    others = [cluster.add_node(num_cpus=1, object_store_memory=MEMORY) for _ in range(2)]
    ray.init(address=cluster.address, log_to_driver=False)
    # Who asks talks to one of the nodes; that one has to stay.
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
