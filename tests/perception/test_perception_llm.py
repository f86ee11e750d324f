"""``perception.llm``: another model looks than the one that plans; its calls are kept and counted like the others."""

from __future__ import annotations

import json
import sqlite3

import pytest

from memo_core.cli.app import run_app
from memo_core.config import ConfigErrors, load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runs.code_digest import WITHOUT_MODEL, code_digest
from memo_core.runs.record_replay import recorded, replayed
from memo_core.runs.run import resume_experiment, run_experiment
from memo_core.runs.sections import SECTIONS
from tests.support.fake_openai_server import Asked, Reply, Wire, error

TASK = "put-the-cube-away"
EYES = ["perception.backend=cameras", "perception.detector=points", "perception.simulated.width=320"]
COMMON = ["teacher.backend=nobody", "run.video=off", "run.subtasks=1", "run.retries=0"]
SEEN = json.dumps(
    {"things": [{"label": "cube", "box_2d": [100, 100, 900, 900], "kind": "object", "part_of": None, "state": None}]}
)


@pytest.fixture(scope="module")
def registry():
    return Registry()


def load(registry, tmp_path, planner="", eyes="", *more):
    models = [f"llm.backend=litellm llm.model=openai/plans llm.api_base={planner}"] if planner else []
    models += [f"perception.llm.backend=litellm perception.llm.model=openai/sees perception.llm.api_base={eyes}"]
    given = [*COMMON, *EYES, *" ".join(models).split(), f"skillbook.url={tmp_path / 'book.db'}", *more]
    return load_experiment(registry, None, given, SECTIONS, TASK, 0)


def plan(asked: Asked) -> Reply:
    coding = "```" in "".join(asked.texts) and "def " in "".join(asked.texts)
    return Reply("```python\nprint('there')\n```" if coding else "LIFT(cube)")


def see(asked: Asked) -> Reply:
    return Reply(SEEN)


@pytest.mark.sim
@pytest.mark.wire
def test_one_model_looks_and_another_plans_and_a_recording_plays_both(registry, tmp_path):
    file, ledger = tmp_path / "calls.jsonl", tmp_path / "ledger.db"
    with Wire(plan) as planner, Wire(see) as eyes:
        experiment = load(registry, tmp_path, planner.base, eyes.base, f"run.study_ledger={ledger}")
        report = run_experiment(recorded(experiment, registry, file), registry, tmp_path / "runs")
        planned, looked = list(planner.asked), list(eyes.asked)
    assert not report.problem
    assert looked and all(one.pictures and one.body["model"] == "sees" for one in looked)
    assert planned and not any(one.pictures for one in planned)
    assert report.calls == len(planned) + len(looked)
    kept = list((report.folder / "calls").glob("*-look.json"))
    assert len(kept) == len(looked)
    with sqlite3.connect(ledger) as calls:
        assert calls.execute("SELECT count(*) FROM calls WHERE phase = 'look'").fetchone() == (len(looked),)
    again = run_experiment(
        replayed(load(registry, tmp_path, "", "http://127.0.0.1:9"), registry, file), registry, tmp_path / "runs"
    )
    assert not again.problem and again.calls == report.calls and again.result == report.result


@pytest.mark.sim
@pytest.mark.wire
def test_a_resumed_run_neither_asks_about_a_look_again_nor_forgets_its_cost(registry, tmp_path):
    refused = [True]

    def sulk(asked: Asked) -> Reply:
        return error(401, "no such key") if refused else plan(asked)

    with Wire(sulk) as planner, Wire(see) as eyes:
        experiment = load(registry, tmp_path, planner.base, eyes.base)
        report = run_experiment(experiment, registry, tmp_path / "runs")
        before = len(eyes.asked)
        assert report.resumable and report.error is not None and before
        refused.clear()
        mended = load(registry, tmp_path, planner.base, eyes.base, "perception.llm.timeout_s=60")
        resumed = resume_experiment(mended, registry, report.folder)
        after = len(eyes.asked)
    asides = [one for one in read_history(report.folder, read_lines(report.folder).records).effects if one.aside]
    assert not resumed.problem and after == before
    assert sum(not one.value.get("kept") for one in asides) == before
    assert resumed.calls - report.calls == len(planner.asked) - 1
    assert resumed.prompt_tokens > report.prompt_tokens


def test_code_of_its_backend_counts_as_code_of_the_experiment(registry):
    plain = load_experiment(registry, None, EYES, SECTIONS, TASK, 0)
    own = load_experiment(
        registry, None, [*EYES, "perception.llm.backend=litellm", "perception.llm.model=openai/sees"], SECTIONS
    )
    assert code_digest(own) != code_digest(plain)
    assert code_digest(own, WITHOUT_MODEL) == code_digest(plain, WITHOUT_MODEL)


def test_mistakes_in_it_are_told_with_file_and_line(registry, tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("perception:\n  backend: cameras\n  llm:\n    backend: litellm\n    modle: gemini/x\n")
    with pytest.raises(ConfigErrors) as errors:
        load_experiment(registry, file, (), SECTIONS, TASK, 0)
    [issue] = [one for one in errors.value.issues if one.path.endswith("modle")]
    assert issue.origin.line == 5 and issue.path == "perception.llm.modle" and "'model'" in issue.problem


def test_a_missing_key_of_it_is_told_before_a_run(registry, monkeypatch, tmp_path, capsys):
    monkeypatch.delenv("GEMINI_API_KEY", raising=False)
    monkeypatch.delenv("GOOGLE_API_KEY", raising=False)
    file = tmp_path / "lab.yaml"
    file.write_text(
        "perception:\n  backend: cameras\n  llm: {backend: litellm, model: gemini/gemini-robotics-er-2-preview}\n"
    )
    run_app(["config", "check", str(file)])
    assert "GEMINI_API_KEY" in "".join(capsys.readouterr())
