"""Rules that a demo's person tells: their words are kept, and a model makes notes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from memo_core.config import Experiment
from memo_core.events import Event
from memo_core.interfaces.backend import Told
from memo_core.interfaces.llm import LanguageModel
from memo_core.policy.feedback_processing import FeedbackProcessor, asking_without_a_run, retry
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.consolidation import calls_without_a_run
from memo_core.runs.factories import book_of, environment_of, prompts_of, task_of
from memo_core.scene.scene_table import scene_table


def note_told(
    experiment: Experiment, llm: LanguageModel, book: str, told: Sequence[Told], emit: Callable[[Event], None]
) -> None:
    """Record remarks, each with the scene of its task, and have ``llm`` make notes of them in the ``book`` (URL), which
    is made if there is none. ``emit`` receives the entries made and the problems. Raises ``MemoError``."""
    stop = StopSwitch()
    with book_of(experiment, book, read_only=False) as opened:
        for remark in told:
            task = task_of(experiment, remark.task)
            with environment_of(experiment, task, experiment.seed) as world:
                scene = scene_table(world.look())
            opened.record_feedback(
                remark.words, remark.who, task=task.instruction, subtask=remark.subtask, scene_graph=scene
            )
        if told:
            with calls_without_a_run(experiment, llm, emit, stop, "told") as calls:
                reasks = experiment.section("run").reasks
                ask = asking_without_a_run(
                    calls, prompts_of(experiment), experiment.create("robot"), reasks, experiment.seed
                )
                retry(FeedbackProcessor(ask, opened, emit), opened)
