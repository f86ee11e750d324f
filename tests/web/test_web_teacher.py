"""The teacher in the browser: its answers to the run, and a press of stop at each moment."""

from __future__ import annotations

import queue
import threading
import time

import attrs
import numpy as np
import pytest
from memo_web.robot_side import teacher as module
from memo_web.robot_side.listening import Reworded, listen
from memo_web.robot_side.teacher import WebTeacher
from memo_web.settings import WebSettings

from memo_core.interfaces.teacher import Episode, Note
from memo_core.plugin import BackendLost, Noted, Program, ReadBack, Stage, Stopped, TaskEpisode, Verdict
from memo_core.process.stop_switch import StopSwitch
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.ideal_link import IdealLink
from tests.support.arms import six_joint_arm

WAIT_S = 20.0
SCENE = SceneGraph((), (), Observation(Pose(), 0.08, False))
EPISODE = Episode("heat it", "OPEN(microwave)", 1, SCENE, SCENE)


class Pages:
    """Stand-in for the server's process that keeps messages and answers questions as a person would."""

    def __init__(self):
        self.handlers, self.sent, self.said = {}, [], []
        self.questions = queue.Queue()
        self.stop_pressed = lambda press: None
        self.keep_stopped = lambda: None
        self.watchers_changed = lambda present: None
        self.watched, self.lost = True, False

    def on(self, kind, handler):
        self.handlers[kind] = handler
        return lambda: self.handlers.pop(kind)

    def send(self, kind, blob=b"", keep="", droppable=False, **fields):
        self.sent.append((kind, fields))
        if kind == "question" and fields["question"]:
            self.questions.put(fields["question"])

    def forget(self, keep): ...

    def say_stop(self, state):
        self.said.append(state)

    def answer(self, question, **fields):
        self.handlers["answer"]({"id": question["id"], **fields})


@pytest.fixture
def pages(monkeypatch):
    pages = Pages()
    monkeypatch.setattr(module, "pages_process", lambda settings, for_study: pages)
    return pages


@pytest.fixture(scope="module")
def robot():
    return six_joint_arm()


class Watched:
    """A teacher who watches an arm that can be stopped."""

    def __init__(self, pages, robot, real=False, **settings):
        self.teacher = WebTeacher(WebSettings(who="Kim", **settings))
        self.teacher.open()
        self.link, self.switch, self.ended = IdealLink(robot), StopSwitch(), threading.Event()
        stage = Stage(
            robot=robot,
            link=self.link,
            perception=None,
            folder=None,
            stop=lambda: (self.switch.press(), self.link.stop()),
            end=self.ended.set,
            simulator=None if real else object(),
        )
        self.teacher._stage = stage
        pages.stop_pressed = self.teacher._press
        pages.keep_stopped = self.teacher._keep_stopped
        pages.watchers_changed = self.teacher._watchers_changed

    def asked(self, ask):
        """Ask in a thread of its own; the result is in the queue."""
        results = queue.Queue()

        def run():
            try:
                results.put(ask(self.teacher))
            except Exception as error:
                results.put(error)

        threading.Thread(target=run, daemon=True).start()
        return results


@pytest.fixture
def watched(pages, robot):
    return Watched(pages, robot)


def result(results):
    return results.get(timeout=WAIT_S)


def question(pages):
    return pages.questions.get(timeout=WAIT_S)


@pytest.mark.parametrize(
    ("answer", "verdict"),
    [
        ({"choice": "approve", "words": ""}, Verdict("approve")),
        ({"choice": "silent", "words": ""}, Verdict("silent")),
        ({"choice": "", "words": "pull it in an arc"}, Verdict("correct", "pull it in an arc")),
        ({"choice": "", "words": "great job, thanks!"}, Verdict("approve")),
        ({"choice": "", "words": "open it first", "about_plan": True}, Verdict("correct", "open it first", True)),
        ({"choice": "silent", "words": "too fast"}, Verdict("correct", "too fast")),
    ],
)
def test_an_answer_is_a_verdict(watched, pages, answer, verdict):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    pages.answer(question(pages), **answer)
    assert result(results) == verdict


@pytest.mark.parametrize(("choice", "verdict"), [("approve", "approve"), ("correct", "correct")])
def test_words_that_may_be_praise_or_blame_are_asked_back(watched, pages, choice, verdict):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    pages.answer(question(pages), choice="", words="good, but lower")
    back = question(pages)
    assert back["about"] == "unsure" and "good, but lower" in back["title"]
    pages.answer(back, choice=choice, words="")
    assert result(results).kind == verdict


def test_an_empty_answer_is_asked_again(watched, pages):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    pages.answer(question(pages), choice="", words="  ")
    pages.answer(question(pages), choice="approve", words="")
    assert result(results) == Verdict("approve")


def test_the_whole_task_is_asked_about(watched, pages):
    episode = TaskEpisode("heat it", SCENE, SCENE, goal=("the food is in the microwave",))
    results = watched.asked(lambda teacher: teacher.judge_task(episode))
    asked = question(pages)
    assert "heat it" in asked["title"] and "the food is in the microwave" in asked["lines"][0]
    pages.answer(asked, choice="", words="you forgot the plate")
    assert result(results) == Verdict("correct", "you forgot the plate")


NOTED = Noted("in an arc", "OPEN(microwave)", (Note("Lead it in an arc."), Note("Go slowly.")))


@pytest.mark.parametrize(
    ("answer", "reaction"),
    [
        ({"choice": "accept"}, ReadBack("accepted")),
        ({"choice": "strike", "struck": [1]}, ReadBack("struck", struck=(1,))),
        ({"choice": "strike", "struck": [0, 1, 7, "x", -1]}, ReadBack("struck", struck=(0, 1))),
        ({"choice": "", "words": "only slower"}, ReadBack("reworded", "only slower")),
        ({"choice": "", "words": "Yes, that's right, thanks!"}, ReadBack("accepted")),
    ],
)
def test_notes_are_accepted_struck_or_reworded(watched, pages, answer, reaction):
    results = watched.asked(lambda teacher: teacher.read_back(NOTED))
    asked = question(pages)
    assert [note["text"] for note in asked["notes"]] == ["Lead it in an arc.", "Go slowly."]
    pages.answer(asked, **answer)
    assert result(results) == reaction


@pytest.mark.parametrize("noted", [NOTED, attrs.evolve(NOTED, notes=())], ids=["notes", "no notes"])
def test_other_words_for_the_notes_are_shown(watched, pages, noted):
    heard = []
    unlisten = listen(heard.append)
    try:
        results = watched.asked(lambda teacher: teacher.read_back(noted))
        pages.answer(question(pages), choice="", words="only slower")
        result(results)
    finally:
        unlisten()
    assert heard == [Reworded("Kim", "only slower")]


def test_praise_of_the_notes_that_says_more_is_asked_back(watched, pages):
    results = watched.asked(lambda teacher: teacher.read_back(NOTED))
    pages.answer(question(pages), choice="", words="good, but slower")
    pages.answer(question(pages), choice="correct")
    assert result(results) == ReadBack("reworded", "good, but slower")


@pytest.mark.parametrize(
    ("words", "reaction"), [("go slower", ReadBack("reworded", "go slower")), ("nothing", ReadBack("accepted"))]
)
def test_a_short_answer_where_nothing_was_noted(watched, pages, words, reaction):
    noted = Noted("not so", "OPEN(microwave)", (), question="Shall I go slower?")
    results = watched.asked(lambda teacher: teacher.read_back(noted))
    pages.answer(question(pages), choice="", words=words)
    assert result(results) == reaction


def test_yes_where_nothing_was_noted_repeats_the_question(watched, pages):
    noted = Noted("not so", "OPEN(microwave)", (), question="Shall I go slower?")
    results = watched.asked(lambda teacher: teacher.read_back(noted))
    pages.answer(question(pages), choice="", words="yes")
    pages.answer(question(pages), choice="", words="go slower")
    assert result(results) == ReadBack("reworded", "go slower")


def test_striking_nothing_is_asked_again(watched, pages):
    results = watched.asked(lambda teacher: teacher.read_back(NOTED))
    pages.answer(question(pages), choice="strike", struck=[])
    pages.answer(question(pages), choice="accept")
    assert result(results).kind == "accepted"


# -- the stop ----------------------------------------------------------------------------------------------------------
def test_a_press_stops_the_link_and_asks_what_was_wrong(watched, pages):
    pages.stop_pressed("1")
    assert watched.link.stopped and pages.said == ["stopping"]
    results = watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    asked = question(pages)
    _until(lambda: "stopped" in pages.said)
    pages.answer(asked, choice="", words="too high")
    assert result(results) == Verdict("correct", "too high")
    assert pages.said == ["stopping", "stopped", "clear"]


def test_stopped_is_said_only_when_the_link_rests(watched, pages):
    pages.stop_pressed("1")
    rests = threading.Event()

    def brake():
        while not rests.is_set():
            watched.link.halt(np.array([watched.link.joint_targets() + 0.001]))
            time.sleep(0.002)

    braking = threading.Thread(target=brake, daemon=True)
    braking.start()
    watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    question(pages)
    time.sleep(0.4)
    assert "stopped" not in pages.said
    rests.set()
    braking.join()
    _until(lambda: "stopped" in pages.said)


def test_a_simulator_that_stands_still_with_a_velocity_left_has_stopped(watched, pages):
    watched.link.send(watched.link.joint_targets() + 0.01)
    assert np.abs(watched.link.joint_velocities()).max() > 0.5
    pages.stop_pressed("1")
    watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    question(pages)
    _until(lambda: "stopped" in pages.said)


def test_stopped_is_not_said_of_a_link_that_was_not_stopped(watched, pages):
    watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    question(pages)
    time.sleep(0.2)
    assert "stopped" not in pages.said


def test_a_press_while_a_question_is_open_leaves_it(watched, pages):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    question(pages)
    pages.stop_pressed("1")
    assert isinstance(result(results), Stopped)


def test_a_press_is_not_lost_when_an_earlier_answer_lets_the_robot_go_on(watched, pages):
    """The run releases its stop after the answer; a press in between must hold."""
    pages.stop_pressed("1")
    results = watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    pages.answer(question(pages), choice="silent", words="")
    result(results)
    pages.stop_pressed("2")
    watched.switch.release()
    watched.link.release()  # as the run does after the answer to the first press
    pages.keep_stopped()
    assert watched.link.stopped and watched.switch.pressed


def test_after_the_answer_the_robot_is_not_stopped_again(watched, pages):
    pages.stop_pressed("1")
    results = watched.asked(lambda teacher: teacher.interrupted(EPISODE))
    pages.answer(question(pages), choice="silent", words="")
    result(results)
    watched.link.release()
    pages.keep_stopped()
    assert not watched.link.stopped


def test_words_at_any_time_stop_the_robot_and_are_the_answer(watched, pages):
    pages.handlers["remark"]({"words": "you are pushing the cup"})
    assert watched.link.stopped
    verdict = result(watched.asked(lambda teacher: teacher.interrupted(EPISODE)))
    assert verdict == Verdict("correct", "you are pushing the cup")
    assert "stopped" in pages.said


def test_words_for_a_question_that_is_over_are_a_remark(watched, pages):
    pages.handlers["answer"]({"id": 99, "choice": "", "words": "no, to the left"})
    assert watched.link.stopped
    assert result(watched.asked(lambda teacher: teacher.interrupted(EPISODE))).words == "no, to the left"


def test_an_old_approval_does_nothing(watched, pages):
    pages.handlers["answer"]({"id": 99, "choice": "approve", "words": ""})
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    asked = question(pages)
    assert results.empty()
    pages.answer(asked, choice="silent", words="")
    assert result(results).kind == "silent"


@pytest.mark.parametrize("ask", [lambda teacher: teacher.judge(EPISODE), lambda teacher: teacher.interrupted(EPISODE)])
def test_ending_ends_the_run_also_while_a_question_is_open(watched, pages, ask):
    results = watched.asked(ask)
    question(pages)
    pages.handlers["end"]({})
    assert watched.ended.is_set()
    assert isinstance(result(results), Stopped)


def test_a_stop_that_no_page_pressed_leaves_an_open_question(watched, pages):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    question(pages)
    watched.link.stop()
    assert isinstance(result(results), Stopped)


def test_a_server_that_cannot_be_started_again_ends_the_wait(watched, pages):
    results = watched.asked(lambda teacher: teacher.judge(EPISODE))
    question(pages)
    pages.lost = True
    assert isinstance(result(results), BackendLost)


# -- hardware ----------------------------------------------------------------------------------------------------------
def test_a_real_robot_stops_when_nobody_watches_any_more(pages, robot):
    watched = Watched(pages, robot, real=True)
    pages.watchers_changed(False)
    assert watched.link.stopped


def test_a_simulated_one_goes_on(watched, pages):
    pages.watchers_changed(False)
    assert not watched.link.stopped


def test_pages_release_programs_only_where_a_setting_allows_it(pages, robot):
    assert not Watched(pages, robot, real=True).teacher.permits
    assert Watched(pages, robot, real=True, starts_motion=True).teacher.permits


@pytest.mark.parametrize(
    ("answer", "kind"),
    [
        ({"choice": "approve", "words": ""}, "approve"),
        ({"choice": "silent", "words": ""}, "silent"),
        ({"choice": "", "words": "do not come near the lamp"}, "correct"),
    ],
)
def test_a_program_is_released_or_not(pages, robot, answer, kind):
    watched = Watched(pages, robot, real=True, starts_motion=True)
    results = watched.asked(lambda teacher: teacher.permit(Program("heat it", "OPEN(microwave)", 1, "look()")))
    asked = question(pages)
    assert asked["code"] == "look()"
    pages.answer(asked, **answer)
    assert result(results).kind == kind


@pytest.mark.parametrize("words", ["yes", "👍", "no"])
def test_a_typed_yes_or_no_releases_no_program_and_corrects_none(pages, robot, words):
    watched = Watched(pages, robot, real=True, starts_motion=True)
    results = watched.asked(lambda teacher: teacher.permit(Program("heat it", "OPEN(microwave)", 1, "look()")))
    pages.answer(question(pages), choice="", words=words)
    pages.answer(question(pages), choice="silent")
    assert result(results).kind == "silent"


def _until(true):
    until = time.monotonic() + WAIT_S
    while not true():
        assert time.monotonic() < until
        time.sleep(0.005)
