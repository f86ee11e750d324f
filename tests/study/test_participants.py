"""The shipped participants are eight who differ, each history has them in its own order."""

from __future__ import annotations

import json

import pytest

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.plugins.registry import Registry
from memo_core.study.participants import order_of, participants_of, teacher_of
from memo_core.study.running import study_sections
from memo_core.study.settings import Participant, StudySettings
from memo_core.study.study import loader


def test_eight_simulated_participants_that_differ_are_shipped():
    people = participants_of(StudySettings())
    load = loader(Registry(), None, study_sections())
    teachers = [teacher_of(load, one, None, 3, True) for one in people]
    assert len(people) == 8 and all(teacher.simulated for teacher in teachers)
    assert [teacher.who for teacher in teachers] == [one.id for one in people]
    assert len({json.dumps(one.teacher, sort_keys=True) for one in people}) == 8
    for trait in ("phrasings", "manner", "patience", "precision", "attention", "misjudges", "wrong", "useless"):
        assert len({one.teacher[trait] for one in people}) >= 3, trait


def test_each_history_has_everybody_in_an_order_of_its_own():
    people = participants_of(StudySettings())
    orders = [order_of(people, history, seed=0) for history in range(4)]
    assert orders[0] == people
    assert all(sorted(one.id for one in order) == sorted(one.id for one in people) for order in orders)
    assert len({tuple(one.id for one in order) for order in orders}) == 4
    assert order_of(people, 2, seed=0) == orders[2]


def test_a_participant_of_a_file_is_checked_like_any_section():
    registry = Registry()
    given = ['study.participants=[{"id": "P1", "teacher": {"backend": "silent"}, "age": 30}]']
    settings = load_experiment(registry, None, given, study_sections()).section("study")
    assert participants_of(settings)[0].age == 30
    assert teacher_of(loader(registry, None, study_sections()), settings.participants[0], None, 0, True).who == "P1"


def test_ids_that_differ_only_in_case_are_refused():
    """P01 and p01 would share a folder on some file systems."""
    with pytest.raises(InvalidArgument, match="P01 twice"):
        StudySettings(participants=(Participant("P01"), Participant("p01")))
