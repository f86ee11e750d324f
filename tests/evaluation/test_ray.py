"""On a Ray cluster of several nodes every group is done, also those of a node that is killed in the middle."""

from __future__ import annotations

import os
import threading
import time

import pytest

from memo_core.evaluation import engines
from memo_core.evaluation.engines import Group, on_ray
from memo_core.evaluation.evaluating import evaluate
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.table import VARYING, read_table
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.study.study import loader, shared_settings

pytestmark = pytest.mark.process

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


EVALUATION = """
suite: quirks
run: {video: "off"}
evaluation:
  methods: [memo]
  tasks: [open-the-freezer, put-the-carton-on-the-board]
  hours: []
  books: [empty, lessons]
  scenes: 1
  corrected: {corrections: 1}
"""


@pytest.mark.slow
@pytest.mark.on_request
@pytest.mark.timeout(1800)
def test_an_evaluation_on_three_nodes_of_which_one_is_killed_has_the_rows_of_one_machine(tmp_path):
    from ray.cluster_utils import Cluster

    def evaluated(name: str, *overrides: str) -> list[dict]:
        folder = tmp_path / name
        given = [*overrides, *shared_settings(folder / "evaluation")]
        evaluate(loader(Registry(), tmp_path / "experiment.yaml", ALL_SECTIONS, given), folder, StopSwitch())
        rows = read_table(folder / "evaluation")
        return [{key: row[key] for key in row if key not in VARYING} for row in rows]

    (tmp_path / "experiment.yaml").write_text(EVALUATION)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
    killed = threading.Event()

    def kill_one_at_work():
        while len(list((tmp_path / "ray").glob("evaluation/trials/*/run/log.jsonl"))) < 3:
            time.sleep(0.05)
        cluster.remove_node(nodes[0], allow_graceful=False)
        killed.set()

    try:
        cluster.wait_for_nodes()
        threading.Thread(target=kill_one_at_work, daemon=True).start()
        rows = evaluated("ray", "evaluation.engine=ray", f"evaluation.ray_address={cluster.address}")
    finally:
        cluster.shutdown()
    assert killed.is_set() and len(rows) == 8
    assert rows == evaluated("joblib", "evaluation.jobs=2")
