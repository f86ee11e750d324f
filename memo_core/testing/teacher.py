"""Conformance suite for teachers: ``RULES[name](make)``, where ``make`` returns a new, unopened teacher.

Standard input is empty and output is discarded, so that a teacher that asks a person gets no answer.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout

from memo_core.interfaces.teacher import (
    Episode,
    Note,
    Noted,
    Proposal,
    ReadBack,
    Sighting,
    TaskEpisode,
    Teacher,
    Verdict,
)
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.fake_control import tabletop_nodes
from memo_core.testing.rules import Rules

Make = Callable[[], Teacher]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
KINDS = ("approve", "correct", "silent")


def check_teacher(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def episodes() -> tuple[Episode, ...]:
    """Three episodes: watched, not watched, and one with an empty scene."""
    hand = Observation(Pose((0.4, 0.0, 0.3), (0.0, 1.0, 0.0, 0.0)), 0.08, False)
    scene, nothing = SceneGraph(tabletop_nodes(), (), hand), SceneGraph((), (), hand)
    watched = tuple(Sighting(0.5 * number, scene) for number in range(4))
    return (
        Episode("put the cube in the bowl", "PICK(red cube)", 1, scene, scene, watched),
        Episode("put the cube in the bowl", "PLACE(red cube, bowl)", 2, scene, scene, (), "I cannot reach that"),
        Episode("tidy up", "OPEN(drawer)", 1, nothing, nothing),
    )


def task_episodes() -> tuple[TaskEpisode, ...]:
    """Two whole tasks: one with a goal, watched, and one without goal or sightings."""
    first, _, last = episodes()
    goal = ("the red cube is in the bowl", "the hand has let go of the red cube")
    done = ("PICK(red cube)", "PLACE(red cube, bowl)")
    return (
        TaskEpisode(first.task, first.before, first.after, goal, done, first.sightings),
        TaskEpisode(last.task, last.before, last.after),
    )


def proposals() -> tuple[Proposal, ...]:
    """Two proposed subtasks, one of a task without a goal."""
    first, _, last = episodes()
    return (
        Proposal(first.task, first.subtask, first.before, ("the red cube is in the bowl",)),
        Proposal(last.task, last.subtask, last.before, subtasks=("OPEN(drawer)",)),
    )


def noted() -> tuple[Noted, ...]:
    """Two notes made of one remark, and a remark of which nothing was learnt."""
    notes = (Note("Pull the handle straight.", "OPEN(drawer)"), Note("Approach handles from the front."))
    return (
        Noted("no, straight, and from the front", "OPEN(drawer)", notes),
        Noted("that was wrong", "OPEN(drawer)", question="What should be done differently?"),
    )


@contextmanager
def _opened(make: Make) -> Iterator[Teacher]:
    before, sys.stdin = sys.stdin, io.StringIO("")
    try:
        teacher = make()
        with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
            teacher.open()
            try:
                yield teacher
            finally:
                teacher.close()
    finally:
        sys.stdin = before


def _checked(verdict: object, asked: str) -> Verdict:
    assert isinstance(verdict, Verdict), f"{asked} returned {type(verdict).__name__}"
    assert verdict.kind in KINDS, f"verdict of kind {verdict.kind!r}"
    return verdict


def _check_words(verdict: Verdict) -> None:
    assert verdict.kind != "correct" or verdict.words.strip(), "a correction without words"
    assert verdict.kind != "silent" or not verdict.words, f"silent, yet it said {verdict.words!r}"


@rule
def says_who_speaks(make: Make) -> None:
    """Once open, ``who`` names the person under whom words are kept, so that they can be withdrawn."""
    with _opened(make) as teacher:
        assert isinstance(teacher.who, str) and teacher.who.strip(), f"who is {teacher.who!r}"


@rule
def gives_a_verdict_on_any_episode(make: Make) -> None:
    """``judge`` answers every episode with a ``Verdict``, also one that nobody watched or with nothing to see."""
    with _opened(make) as teacher:
        for episode in episodes():
            _checked(teacher.judge(episode), "judge")


@rule
def answers_an_interruption(make: Make) -> None:
    """``interrupted``, asked after a stop, answers with a ``Verdict`` too."""
    with _opened(make) as teacher:
        for episode in episodes():
            _checked(teacher.interrupted(episode), "interrupted")


@rule
def a_correction_has_words(make: Make) -> None:
    """A verdict ``correct`` says what was wrong; ``silent`` says nothing."""
    with _opened(make) as teacher:
        for episode in episodes():
            for verdict in (teacher.judge(episode), teacher.interrupted(episode)):
                _check_words(verdict)


@rule
def judges_a_whole_task(make: Make) -> None:
    """``judge_task`` answers with a ``Verdict``; a correction has words, ``silent`` has none."""
    with _opened(make) as teacher:
        for episode in task_episodes():
            _check_words(_checked(teacher.judge_task(episode), "judge_task"))


@rule
def judges_a_plan(make: Make) -> None:
    """``judge_plan`` answers with a ``Verdict``; a correction has words."""
    with _opened(make) as teacher:
        for proposal in proposals():
            _check_words(_checked(teacher.judge_plan(proposal), "judge_plan"))


@rule
def answers_a_read_back(make: Make) -> None:
    """``read_back`` accepts, rewords (with words) or strikes (notes that there are); ``reads_back`` says whether
    anybody is there to be asked."""
    with _opened(make) as teacher:
        assert isinstance(teacher.reads_back, bool), f"reads_back is {teacher.reads_back!r}"
        for one in noted():
            answer = teacher.read_back(one)
            assert isinstance(answer, ReadBack), f"read_back returned {type(answer).__name__}"
            assert answer.kind in ("accepted", "reworded", "struck"), f"a read-back of kind {answer.kind!r}"
            assert answer.kind != "reworded" or answer.words.strip(), "reworded without words"
            assert all(0 <= index < len(one.notes) for index in answer.struck), f"struck {answer.struck}: no such notes"


@rule
def leaves_the_episode_alone(make: Make) -> None:
    """What a teacher is shown is not changed by looking at it."""
    with _opened(make) as teacher:
        for episode in episodes():
            before = repr(episode)
            teacher.judge(episode)
            assert repr(episode) == before, "the episode was changed"


@rule
def goes_on_from_its_state(make: Make) -> None:
    """Another teacher that takes ``state`` back judges what follows as this one does: a run may be resumed."""
    with _opened(make) as teacher:
        for episode in episodes():
            teacher.judge(episode)
        state = teacher.state()
        assert isinstance(state, str), f"state returned {type(state).__name__}"
        expected = [teacher.judge(episode) for episode in episodes() * 5]
    with _opened(make) as other:
        if state:
            other.restore(state)
        told = [other.judge(episode) for episode in episodes() * 5]
    assert told == expected, "with the state of another it judged otherwise"


@rule
def says_whether_things_were_put_back(make: Make) -> None:
    """``put_back``, asked where the robot cannot undo what it did, says yes or no; where nobody is there, no."""
    with _opened(make) as teacher:
        for episode in episodes():
            done = teacher.put_back(episode)
            assert isinstance(done, bool), f"put_back returned {type(done).__name__}"


@rule
def closes_twice_and_opens_again(make: Make) -> None:
    """``close`` is idempotent, and a closed teacher can be opened again."""
    with _opened(make) as teacher:
        teacher.close()
        teacher.close()
        teacher.open()
        assert isinstance(teacher.judge(episodes()[0]), Verdict)
