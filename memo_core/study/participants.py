"""Who takes part: the participants of an experiment file or the shipped simulated ones, and their teachers."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import resources
from typing import Any

import attrs
import numpy as np
import yaml

from memo_core.config import Experiment
from memo_core.interfaces.task import Task
from memo_core.interfaces.teacher import Teacher
from memo_core.study.settings import Participant, StudySettings

Load = Callable[..., Experiment]
"""``load(*overrides, task=None, seed=None)``: the study's experiment with some values changed, checked."""


def participants_of(settings: StudySettings) -> tuple[Participant, ...]:
    """In the order of the file; where it names none, the eight simulated ones that are shipped."""
    if settings.participants:
        return settings.participants
    text = resources.files("memo_core.study").joinpath("participants.yaml").read_text(encoding="utf-8")
    return tuple(Participant(**row) for row in yaml.safe_load(text))


def order_of(participants: tuple[Participant, ...], history: int, seed: int) -> tuple[Participant, ...]:
    """Who comes when in a history. The first keeps the order of the file, the others draw theirs."""
    if history == 0:
        return participants
    drawn = np.random.default_rng([seed, history]).permutation(len(participants))
    return tuple(participants[index] for index in drawn)


def teacher_section(participant: Participant) -> str:
    """The override that makes this person the experiment's teacher."""
    return f"teacher={json.dumps(participant.teacher)}"


def teacher_of(load: Load, participant: Participant, task: Task | None, seed: int, knows_lessons: bool) -> Teacher:
    """The participant as the teacher of one run. Whatever the backend calls ``who``, ``seed`` and ``knows`` is filled
    in. Raises ``ConfigErrors`` for a section that is not in order."""
    choice = load(teacher_section(participant)).choice("teacher")
    known = {field.name for field in attrs.fields(type(choice.settings))}
    given: dict[str, Any] = {"who": participant.id, "seed": seed}
    if knows_lessons and task is not None and task.lesson and not participant.teacher.get("knows"):
        given["knows"] = task.lesson
    settings = attrs.evolve(choice.settings, **{name: value for name, value in given.items() if name in known})
    teacher: Teacher = attrs.evolve(choice, settings=settings).create()
    teacher.who = participant.id
    return teacher
