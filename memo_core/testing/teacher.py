"""Conformance suite for teachers: ``RULES[name](make)``, where ``make`` returns a new, unopened teacher.

Standard input is empty meanwhile: a teacher that asks a person finds nobody there. Its questions are not shown.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout

from memo_core.interfaces.teacher import Episode, Sighting, Teacher, Verdict
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.fake_control import tabletop_nodes

Make = Callable[[], Teacher]
RULES: dict[str, Callable[[Make], None]] = {}
KINDS = ("approve", "correct", "silent")


def rule(check: Callable[[Make], None]) -> Callable[[Make], None]:
    """Register a check; its docstring is the promise."""
    RULES[check.__name__] = check
    return check


def check_teacher(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def episodes() -> tuple[Episode, ...]:
    """Three that any teacher may meet: watched, not watched, and one in which there is nothing to see."""
    hand = Observation(Pose((0.4, 0.0, 0.3), (0.0, 1.0, 0.0, 0.0)), 0.08, False)
    scene, nothing = SceneGraph(tabletop_nodes(), (), hand), SceneGraph((), (), hand)
    watched = tuple(Sighting(0.5 * number, scene) for number in range(4))
    return (
        Episode("put the cube in the bowl", "PICK(red cube)", 1, scene, scene, watched),
        Episode("put the cube in the bowl", "PLACE(red cube, bowl)", 2, scene, scene, (), "I cannot reach that"),
        Episode("tidy up", "OPEN(drawer)", 1, nothing, nothing),
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
            verdict = teacher.judge(episode)
            assert isinstance(verdict, Verdict), f"judge returned {type(verdict).__name__}"
            assert verdict.kind in KINDS, f"verdict of kind {verdict.kind!r}"


@rule
def answers_an_interruption(make: Make) -> None:
    """``interrupted``, asked after a stop, answers with a ``Verdict`` too."""
    with _opened(make) as teacher:
        for episode in episodes():
            verdict = teacher.interrupted(episode)
            assert isinstance(verdict, Verdict), f"interrupted returned {type(verdict).__name__}"


@rule
def a_correction_has_words(make: Make) -> None:
    """A verdict ``correct`` says what was wrong; ``silent`` says nothing."""
    with _opened(make) as teacher:
        for episode in episodes():
            for verdict in (teacher.judge(episode), teacher.interrupted(episode)):
                assert verdict.kind != "correct" or verdict.words.strip(), "a correction without words"
                assert verdict.kind != "silent" or not verdict.words, f"silent, yet it said {verdict.words!r}"


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
