"""The demo's story with eyes that have no masks and ask no model: a real model's recorded answers, played back on what
``cameras`` and ``inventory`` see."""

from __future__ import annotations

import json

import numpy as np
import pytest

from memo_core.cli.app import run_app
from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import task_of, world_of
from memo_core.runs.sections import SECTIONS

pytestmark = pytest.mark.sim

TRUTH = ["perception.backend=ground-truth", "perception.visible_extents=true"]


def seen(registry, task, eyes):
    experiment = load_experiment(registry, None, ["suite.backend=quirks", *eyes], SECTIONS, task, 0)
    with world_of(experiment, task_of(experiment, task), 0) as world:
        return world.control.scene()


@pytest.mark.parametrize(("task", "closer"), [("open-the-locker", "locker door"), ("open-the-workbench", "drawer")])
def test_the_doors_and_handles_of_the_story_are_found_where_they_are(task, closer):
    registry = Registry()
    graph, truth = seen(registry, task, ["perception.backend=cameras"]), seen(registry, task, TRUTH)
    assert {node.label for node in graph.nodes} >= {n.label for n in truth.nodes if n.kind in ("fixture", "part")}
    assert not any(node.label.startswith("unknown") for node in graph.nodes)
    assert any(sentence.endswith(f"{closer} is closed") for sentence in graph.sentences())
    for node in truth.nodes:
        if node.kind == "part":
            off = np.subtract(graph.node(node.label).pose.position, node.pose.position)
            assert np.linalg.norm(off) < 0.01, node.label


@pytest.mark.on_request
@pytest.mark.timeout(3600)
def test_the_story_is_told_from_its_recording(tmp_path, capsys):
    sets = ["--set", "perception.backend=cameras", "--set", "run.video=off"]
    assert run_app(["demo", "--replay", "--out", str(tmp_path), *sets, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["told"], told["reasons"]
