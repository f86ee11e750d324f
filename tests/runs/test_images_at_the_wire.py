"""``policy.images``: a model behind OpenAI's protocol gets the cameras' pictures, and a recording plays them back."""

from __future__ import annotations

import base64
import io

import pytest
from PIL import Image

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.record_replay import recorded, replayed
from memo_core.runs.run import run_experiment
from memo_core.runs.sections import SECTIONS
from tests.support.fake_openai_server import Asked, Reply, Wire

pytestmark = pytest.mark.sim

TASK = "put-the-cube-away"
COMMON = [
    "teacher.backend=nobody",
    "run.video=off",
    "run.subtasks=1",
    "policy.images=true",
    "skillbook.read_only=false",
]
EYES = ["perception.backend=cameras", "perception.detector=oracle", "perception.simulated.width=320"]


@pytest.fixture(scope="module")
def registry():
    return Registry()


def load(registry, tmp_path, *more):
    book = f"skillbook.url={tmp_path / 'book.db'}"
    return load_experiment(registry, None, [*COMMON, book, *more], SECTIONS, TASK, 0)


def reply(asked: Asked) -> Reply:
    coding = "```" in "".join(asked.texts) and "def " in "".join(asked.texts)
    return Reply("```python\nprint('there')\n```" if coding else "LIFT(cube)")


def test_the_model_gets_each_cameras_picture_and_a_recording_plays_it_back(registry, tmp_path):
    file = tmp_path / "calls.jsonl"
    with Wire(reply) as wire:
        model = ["llm.backend=litellm", "llm.model=openai/sees", f"llm.api_base={wire.base}"]
        experiment = load(registry, tmp_path, *EYES, *model)
        report = run_experiment(recorded(experiment, registry, file), registry, tmp_path / "runs")
        asked = list(wire.asked)
    assert not report.problem and len(asked) == report.calls >= 2
    for one in asked:
        assert len(one.pictures) == 2 and "## Pictures" in one.texts[-1]
        for url in one.pictures:
            kind, _, data = url.partition(",")
            assert kind == "data:image/png;base64"
            assert Image.open(io.BytesIO(base64.b64decode(data))).size == (320, 240)
    kept = list((report.folder / "pictures" / "prompts").glob("*.png"))
    assert len(kept) == len({url for one in asked for url in one.pictures})
    again = run_experiment(replayed(load(registry, tmp_path, *EYES), registry, file), registry, tmp_path / "runs")
    assert not again.problem and again.calls == report.calls and again.result == report.result


def test_with_a_perception_that_takes_no_pictures_the_scenes_cameras_do(registry, tmp_path):
    with Wire(reply) as wire:
        model = ["llm.backend=litellm", "llm.model=openai/sees", f"llm.api_base={wire.base}"]
        report = run_experiment(load(registry, tmp_path, *model), registry, tmp_path / "runs")
        asked = list(wire.asked)
    assert not report.problem and asked
    assert all("in this order: front, overview." in one.texts[-1] and len(one.pictures) == 2 for one in asked)


def test_for_a_model_that_reads_text_only_no_picture_is_taken(registry, tmp_path):
    file = tmp_path / "calls.jsonl"
    report = run_experiment(recorded(load(registry, tmp_path), registry, file), registry, tmp_path / "runs")
    assert not report.problem and report.calls
    assert not (report.folder / "pictures").exists()
    again = run_experiment(replayed(load(registry, tmp_path), registry, file), registry, tmp_path / "runs")
    assert not again.problem and again.calls == report.calls
    assert not (again.folder / "pictures").exists()
