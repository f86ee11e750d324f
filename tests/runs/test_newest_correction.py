"""Whole runs in the simulator: what was said last is in the very next prompt, and relative remarks do not add up."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import attrs
import pytest
from memo_offline.model import OfflineModel

from memo_core.config import Experiment, load_experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.events import CodeWritten, EntryStored, Event, SkillCalled
from memo_core.interfaces.llm import Message, Request
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import book_of, environment_of, task_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.record_replay import recorded, replayed
from memo_core.runs.run import RunReport, components_of, perform
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings
from tests.support.fake_openai_server import Asked, Reply, Wire

pytestmark = pytest.mark.sim

TASK, OPEN = "open-the-fridge", "OPEN(fridge)"
QUICK = ("run.video=off", "run.subtasks=1", "run.repairs=0", "run.repeats=1", "run.retry_wait_s=0.01")
WORDS = "no — lead it along an arc,\nthe door swings!"
LOWER = "a little lower"
LITTLE = 0.02  # m, in the offline backend's vocabulary


@attrs.define
class Heard:
    """Programs, notes, and the height of the hand as its fingers close first, of each attempt."""

    world: SimulatedEnvironment | None = None
    codes: list[str] = attrs.field(factory=list)
    notes: list[str] = attrs.field(factory=list)
    heights: list[float] = attrs.field(factory=list)

    def event(self, event: Event) -> None:
        if isinstance(event, CodeWritten):
            self.codes.append(event.code)
        elif isinstance(event, EntryStored):
            self.notes.append(event.text)
        elif isinstance(event, SkillCalled) and event.skill == "close_gripper" and len(self.heights) < len(self.codes):
            assert self.world is not None
            self.heights.append(self.world.control.tool_pose().position[2])


def run(
    folder: Path,
    said: tuple[str, ...],
    *settings: str,
    fill: Callable[[Skillbook], None] = lambda book: None,
    model: Callable[[Experiment, Registry], Experiment] = lambda experiment, registry: experiment,
) -> tuple[RunReport, Heard]:
    """The fridge is opened; what is said, is said after the first attempts."""
    registry, heard = Registry(), Heard()
    chosen = [*QUICK, f"run.attempts={len(said) + 1}", f"skillbook.url=sqlite:///{folder / 'book.db'}", *settings]
    experiment = model(load_experiment(registry, None, chosen, SECTIONS, TASK, 0), registry)
    task = task_of(experiment, TASK)
    lines = tuple(Line("OPEN(*)", words, number) for number, words in enumerate(said, 1))

    def world() -> SimulatedEnvironment:
        heard.world = environment_of(experiment, task, 0)
        return heard.world

    with book_of(experiment) as book:
        fill(book)
    teacher = ScriptedTeacher(ScriptSettings(lines=(*lines, Line("*"))))
    components = components_of(experiment, world, book_of(experiment), teacher)
    made = RunFolder(new_run_folder(folder, TASK, 0))
    return perform(components, task, 0, lambda: made, registry, experiment.public(), heard.event), heard


def fifty(book: Skillbook) -> None:
    """Fifty notes of others under one key, which contradict each other."""
    for n in range(50):
        way = ("Pull the handle straight out", "Push the door in", "Pull it down")[n % 3]
        said = book.record_feedback(f"remark {n}", f"person {n % 7}", subtask=OPEN)
        book.add_lessons(said, OPEN, [f"{way}, for the {n}th time."])


def server(model: OfflineModel) -> Callable[[Asked], Reply]:
    """The offline backend behind OpenAI's protocol."""

    def reply(asked: Asked) -> Reply:
        roles = [message["role"] for message in asked.body["messages"]]
        told = tuple(Message(role, text) for role, text in zip(roles, asked.texts, strict=True))
        return Reply(model.answer(Request("", told)).text)

    return reply


def code_prompts(folder: Path) -> list[str]:
    kept = [json.loads(path.read_text()) for path in sorted((folder / "calls").glob("*-code.json"))]
    return [one["messages"][-1]["text"] for one in kept]


def check_next_prompt(prompts: list[str], heard: Heard) -> None:
    first, second = prompts
    assert "## Just corrected" not in first and first.count(f"- [{OPEN}]") >= 14, "the others' notes are there"
    said, _, rest = second.partition("## Just corrected\n")[2].partition("\n## ")
    assert heard.codes[0].strip() in said, "the code that failed"
    assert "> no — lead it along an arc,\n> the door swings!" in said, "the words as they were said"
    assert f"- [{OPEN}] {heard.notes[0]}" in said and " arc " in heard.notes[0]
    assert rest.startswith("Earlier attempts") and heard.codes[0] != heard.codes[1]


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> tuple[Path, RunReport, Heard]:
    folder = tmp_path_factory.mktemp("recorded")
    file = folder / "calls.jsonl"
    report, heard = run(folder, (WORDS,), fill=fifty, model=lambda one, registry: recorded(one, registry, file))
    return file, report, heard


def test_the_newest_of_fifty_contradicting_notes_is_in_the_very_next_prompt(recording):
    _, report, heard = recording
    check_next_prompt(code_prompts(report.folder), heard)


def test_the_same_prompts_reach_a_server(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    model = OfflineModel()
    model.open()
    with Wire(server(model)) as wire:
        _, heard = run(
            tmp_path, (WORDS,), "llm.backend=litellm", "llm.model=openai/x", f"llm.api_base={wire.base}", fill=fifty
        )
    check_next_prompt([one.texts[-1] for one in wire.asked if "# Write robot code" in one.texts[0]], heard)


def test_the_same_prompts_are_found_in_a_recording(recording, tmp_path):
    file, _, known = recording
    report, heard = run(tmp_path, (WORDS,), fill=fifty, model=lambda one, registry: replayed(one, registry, file))
    assert heard.codes == known.codes, report.why
    check_next_prompt(code_prompts(report.folder), heard)


def test_two_equal_relative_remarks_move_the_hand_once_each(tmp_path):
    report, heard = run(tmp_path, (LOWER, LOWER))
    [opening] = report.result.subtasks
    assert opening.attempts == 3, report.why
    first, second, third = heard.heights
    assert first - second == pytest.approx(LITTLE, abs=0.004)
    assert first - third == pytest.approx(2 * LITTLE, abs=0.004), "3 d is twice the second remark"
