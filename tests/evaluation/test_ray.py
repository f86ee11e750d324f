"""On a Ray cluster of several nodes every group is done, also those of a node that is killed in the middle."""

from __future__ import annotations

import os
import threading
import time

import pytest

from memo_core.evaluation import engines
from memo_core.evaluation.engines import Group, on_ray
from memo_core.evaluation.grid import Trial
from memo_core.stop_switch import StopSwitch

ray = pytest.importorskip("ray", reason="the extra `ray` is not installed")


@pytest.mark.slow
def test_what_a_killed_node_was_at_is_done_by_the_others(tmp_path, monkeypatch):
    from ray.cluster_utils import Cluster

    def work(group):
        scene, node = group.trials[0].scene, ray.get_runtime_context().get_node_id()
        (group.folder / f"began-{scene}-{node}-{os.getpid()}").touch()
        doomed = (group.folder / "doomed").read_text()
        while not list(group.folder.glob(f"began-*-{doomed}-*")):  # so that the others do not do everything before
            time.sleep(0.05)
        time.sleep(60 if node == doomed else 0.1)
        (group.folder / f"done-{scene}").touch()

    monkeypatch.setattr(engines, "do_here", work)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
    groups = [Group(tmp_path, tmp_path / "config.yaml", (Trial("memo", "task", scene),)) for scene in range(9)]
    try:
        cluster.wait_for_nodes()
        (tmp_path / "doomed").write_text(nodes[0].node_id)

        def kill_one_at_work():
            while not list(tmp_path.glob(f"began-*-{nodes[0].node_id}-*")):
                time.sleep(0.05)
            cluster.remove_node(nodes[0], allow_graceful=False)

        killer = threading.Thread(target=kill_one_at_work)
        killer.start()
        ended = list(on_ray(groups, cluster.address, StopSwitch()))
        killer.join()
    finally:
        cluster.shutdown()
    assert ended == [None] * 9
    assert {path.name for path in tmp_path.glob("done-*")} == {f"done-{scene}" for scene in range(9)}
    began = [path.name.split("-")[1] for path in tmp_path.glob("began-*")]
    assert len(began) > 9  # what the killed node was at began twice
