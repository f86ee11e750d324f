"""Answers of a real model (tests/data/recordings, and those that ship): today's readers read all of it, its
code is within today's Python and skills, and a recorded run does in today's world what it did then."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest
from memo_llm.replay.recording import Call, read_recording

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.llm.prompt_sections import Prompt
from memo_core.llm.readers import read_code, read_notes, read_plan, read_template
from memo_core.plugins.registry import Registry
from memo_core.runs.run import run_experiment
from memo_core.runs.sections import SECTIONS
from memo_core.sandbox import Sandbox
from memo_core.skillbook.model.keys import Key
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library

RECORDINGS = Path(__file__).parents[1] / "data" / "recordings"
SHIPPED = Path(str(resources.files("memo_tabletop").joinpath("recordings")))
FILES = sorted([*RECORDINGS.glob("*.jsonl.gz"), *SHIPPED.glob("*.jsonl.gz")])
READ = {"code": read_code, "feedback": read_notes, "template": read_template}


def calls(file: Path) -> list[Call]:
    return [call for call in read_recording(file) if call.answer is not None]


def test_there_are_runs_with_an_empty_and_with_a_taught_book():
    names = {file.name.removesuffix(".jsonl.gz") for file in FILES}
    for task in ("open-the-fridge", "put-the-cube-away", "stack-the-cubes"):
        assert {f"{task}-empty", f"{task}-taught"} <= names


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_answer_is_read(file):
    for call in calls(file):
        text = call.answer.text
        if call.request.phase == "plan":
            names = [node.label for node in Prompt.read(call.request.messages[:2]).scene().nodes]
            key = read_plan(text, names)
            assert key is None or isinstance(key, Key)
        else:
            answer = READ[call.request.phase](text)
            assert answer or answer.unclear


@pytest.mark.process
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_all_code_is_within_the_subset_and_the_skills(file):
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        for call in calls(file):
            if call.request.phase in ("code", "template"):
                code = READ[call.request.phase](call.answer.text)
                assert not sandbox.check(code)


@pytest.mark.sim
@pytest.mark.parametrize("book", ["empty", "taught"])
def test_a_recorded_run_still_opens_the_fridge(book, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    registry = Registry()
    recording = RECORDINGS / f"open-the-fridge-{book}.jsonl.gz"
    settings = [f"llm.file={recording}", "llm.backend=replay", "llm.match=situation", "teacher=nobody", "run.video=off"]
    settings += ["skillbook.url=book.db", "suite.backend=tabletop"]
    experiment = load_experiment(registry, None, settings, SECTIONS, "open-the-fridge", 0)
    if book == "taught":
        teach(experiment)
    report = run_experiment(experiment, registry, tmp_path / "runs")
    assert report.success, report.why
    assert [one.subtask for one in report.result.subtasks] == ["OPEN(fridge)"]


def teach(experiment) -> None:
    """The notes that the recorded run was served, in the order in which they were."""
    from memo_core.runs.factories import book_of

    [code] = [call for call in calls(RECORDINGS / "open-the-fridge-taught.jsonl.gz") if call.request.phase == "code"]
    prompt = Prompt.read(code.request.messages)
    with book_of(experiment) as book:
        for entry in prompt.entries("corrections"):
            book.add_lessons(book.record_feedback(entry.text, "ana", subtask=entry.key), entry.key, [entry.text])
        for entry in prompt.entries("general"):
            book.add_lessons(
                book.record_feedback(entry.text, "ana", subtask="OPEN(jar)"), "OPEN(jar)", [], [entry.text]
            )


def test_the_demo_of_the_quirks_is_played_with_the_settings_its_story_needs(monkeypatch, tmp_path):
    import memo_core.cli.demo as command
    import memo_core.demo.running as story

    taken = []

    def cut_short(experiment, *_, **__):
        taken.append(experiment)
        raise KeyboardInterrupt

    monkeypatch.setattr(story, "run_demo", cut_short)
    for overrides, repairs, recording in (
        ([], 0, "quirks.jsonl.gz"),
        (["suite.backend=quirks", "run.repairs=1"], 1, "quirks.jsonl.gz"),
        (["suite.backend=house-rules"], 1, "house-rules.jsonl.gz"),
    ):
        with pytest.raises(KeyboardInterrupt):
            command.command(out=tmp_path, overrides=overrides, replay=True)
        assert taken[-1].section("run").repairs == repairs
        assert taken[-1].public()["llm.file"].endswith(recording)


def test_the_demo_of_a_suite_without_a_recording_names_the_suite_that_has_one(tmp_path):
    import memo_core.cli.demo as command

    with pytest.raises(InvalidArgument, match=r"'tabletop' ships no recording.*--set suite\.backend=quirks"):
        command.command(out=tmp_path, overrides=["suite.backend=tabletop"], replay=True)
    assert not list(tmp_path.iterdir())
