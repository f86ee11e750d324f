"""The scripted teacher follows its script, also for whole tasks, plans and read-backs, and after a resume."""

from __future__ import annotations

import attrs
import pytest

from memo_core.config import load_experiment
from memo_core.config.errors import ConfigErrors
from memo_core.interfaces.teacher import Note, Noted
from memo_core.plugins.builtin import memo_teachers
from memo_core.plugins.registry import Registry
from memo_core.teachers.scripted import Line, NoteLine, PlanLine, ScriptedTeacher, ScriptSettings
from memo_core.teachers.silent import SilentTeacher
from memo_core.testing.teacher import check_teacher, episodes, noted, proposals, task_episodes


def test_the_whole_task_is_judged_line_by_line_and_then_in_silence():
    teacher = ScriptedTeacher(ScriptSettings(task=("you forgot the napkin", "")))
    done = task_episodes()[0]
    verdicts = [teacher.judge_task(done) for _ in range(3)]
    assert [v.kind for v in verdicts] == ["correct", "approve", "silent"]
    assert verdicts[0].words == "you forgot the napkin"


def test_a_plan_is_objected_to_once():
    teacher = ScriptedTeacher(ScriptSettings(plan=(PlanLine("PICK(*)", "open the door first"),)))
    first = teacher.judge_plan(proposals()[0])
    assert first.kind == "correct" and first.about_plan
    assert teacher.judge_plan(proposals()[0]).kind == "silent", "or the planner could never go on"
    assert teacher.judge_plan(attrs.evolve(proposals()[0], subtask="OPEN(x)")).kind == "silent"


def test_notes_are_struck_reworded_or_accepted():
    script = ScriptSettings(notes=(NoteLine("*straight*"), NoteLine("*faster*", "slower, I said")))
    teacher = ScriptedTeacher(script)
    struck = teacher.read_back(noted()[0])
    assert struck.kind == "struck" and struck.struck == (0,)
    assert teacher.read_back(noted()[0]).kind == "accepted", "a line is used once"
    reworded = teacher.read_back(Noted("slower", "OPEN(door)", (Note("Move faster."),)))
    assert reworded.kind == "reworded" and reworded.words == "slower, I said"


def test_a_line_may_say_that_it_is_about_the_plan():
    teacher = ScriptedTeacher(ScriptSettings(lines=(Line("*", "open the door first", about_plan=True),)))
    assert teacher.judge(episodes()[0]).about_plan


def test_another_teacher_goes_on_where_this_one_was():
    script = ScriptSettings(task=("one", "two"), plan=(PlanLine("*", "no"),), notes=(NoteLine("*straight*"),))
    first, second = ScriptedTeacher(script), ScriptedTeacher(script)
    first.judge_task(task_episodes()[0])
    first.judge_plan(proposals()[0])
    first.read_back(noted()[0])
    second.restore(first.state())
    assert second.judge_task(task_episodes()[0]).words == "two"
    assert second.judge_plan(proposals()[0]).kind == "silent"
    assert second.read_back(noted()[0]).kind == "accepted"


def test_who_says_nothing_accepts_notes_and_approves_nothing():
    teacher = SilentTeacher()
    assert not teacher.reads_back
    assert teacher.read_back(noted()[0]).kind == "accepted"
    assert teacher.judge_task(task_episodes()[0]).kind == "silent"
    assert teacher.judge_plan(proposals()[0]).kind == "silent"
    assert teacher.judge(episodes()[0]).kind == "silent"


@pytest.mark.parametrize("backend", memo_teachers(), ids=lambda backend: backend.name)
def test_the_teachers_that_are_built_in_conform(backend):
    check_teacher(lambda: backend.factory(backend.config()))


@pytest.mark.parametrize(("former", "name"), [("nobody", "silent"), ("script", "scripted")])
def test_a_former_name_works_and_is_told_the_present_one(former, name):
    experiment = load_experiment(Registry(), None, [f"teacher={former}"])
    assert experiment.choice("teacher").backend.name == name
    assert experiment.public()["teacher.backend"] == name
    assert experiment.notices == (
        f"teacher.backend: the teacher '{former}' is called '{name}' now; the former name still works",
    )
    assert load_experiment(Registry(), None, [f"teacher={name}"]).notices == ()


def test_the_keys_of_a_script_are_checked():
    with pytest.raises(ConfigErrors, match="notes"):
        load_experiment(Registry(), None, ["teacher=scripted", "teacher.note=x"])
