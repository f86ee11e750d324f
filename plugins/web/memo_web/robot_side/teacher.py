"""The teacher ``web``: a person in the browser."""

from __future__ import annotations

import itertools
import queue
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import (
    LONGEST_WORDS,
    Arrangement,
    BackendLost,
    Episode,
    Meaning,
    MemoError,
    Noted,
    Program,
    Proposal,
    ReadBack,
    Reception,
    Stage,
    Stopped,
    TaskEpisode,
    Teacher,
    Verdict,
    login_name,
    meaning_of,
    place_in_words,
    teaches_nothing,
)
from memo_web.robot_side.listening import Reworded, pages_hear
from memo_web.robot_side.live import Live
from memo_web.robot_side.pages_process import pages_process
from memo_web.robot_side.study import StudyPages, WebReception, study_pages
from memo_web.settings import WebSettings

_POLL_S = 0.02
_REST_S = 0.1  # in which no joint may move by more than ...
_REST = 0.002  # rad or m, for the robot to be at rest
_SILENCE = ("silent", "Say nothing")


@attrs.define
class _Stop:
    """The stop that a person pressed. ``held``: it was pressed, and nobody has been asked what was wrong yet."""

    held: bool = False
    confirmed: bool = False
    joints: np.ndarray | None = None  # as first read, and then every ``_REST_S``
    read: float = 0.0


class WebTeacher(Teacher):
    """Asks on the page ``/teach``, and lets its visitors stop the robot at any time."""

    def __init__(self, settings: WebSettings) -> None:
        """Prepare the teacher; no server is started before ``open``.

        Args:
            settings: who teaches, and where the pages are shown.
        """
        self.settings = settings
        self._stage: Stage | None = None
        self._live: Live | None = None
        self._session: StudyPages | None = None
        self._stop = _Stop()
        self._answers: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._numbers = itertools.count(1)
        self._open_question = 0
        self._remark = ""  # words that nobody had asked for, until they are the answer to a stop
        self._undo: list[Callable[[], None]] = []
        self._lock = threading.Lock()

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Start the server if it does not run. Raises ``InvalidArgument``, ``BackendUnavailable``."""
        self.who = self.settings.who or login_name()
        self._pages = pages = pages_process(self.settings, for_study=self.study is not None)
        self._session = study_pages(self.settings, self.study) if self.study is not None else None
        self._undo = [pages.on("answer", self._take_answer), pages.on("remark", self._take_remark)]
        self._undo.append(pages.on("end", lambda message: self._end()))

    def close(self) -> None:
        """Ask nothing any more; the server goes on as long as its process."""
        for undo in self._undo:
            undo()
        self._undo = []

    @property
    def reception(self) -> Reception | None:
        return WebReception(self.settings, self.study) if self.study is not None else None

    @property
    def follows_motion(self) -> bool:
        return True

    @property
    def url(self) -> str:
        """Address of the pages, once it is open; without the token."""
        return self._pages.url

    def watch(self, stage: Stage) -> None:
        """Show the robot. With a real robot, wait until a page is open."""
        self._stop = _Stop()
        self._remark = ""
        self._stage = stage
        pages = self._pages
        pages.stop_pressed = self._press
        pages.keep_stopped = self._keep_stopped
        pages.watchers_changed = self._watchers_changed
        pages.say_stop("clear")
        pages.send("book", keep="book", url=stage.book)
        if self._session is not None:
            self._session.end_run = stage.end
        self._live = Live(stage, pages, self.settings.pictures_hz)
        if stage.simulator is None and not pages.watched:
            pages.send("notice", text="The robot waits until this page is watched.", keep="notice")
            while not pages.watched:
                stage.link.check_stop("waiting for a page")
                self._check_pages()
                time.sleep(_POLL_S)

    def unwatch(self) -> None:
        """Show the robot no longer."""
        pages = self._pages
        pages.stop_pressed, pages.keep_stopped = lambda press: None, lambda: None
        pages.watchers_changed = lambda present: None
        if self._session is not None:
            self._session.end_run = lambda: None
        live, self._live, self._stage = self._live, None, None
        if live is not None:
            live.close()
        pages.say_stop("clear")

    def overhear(self, phase: str, text: str) -> None:
        """Show code while it is written."""
        if phase == "code":
            self._pages.send("text", droppable=True, phase=phase, text=text)

    # -- the stop ------------------------------------------------------------------------------------------------------
    def _press(self, press: str) -> None:
        """A person pressed stop; called in the thread that does nothing else."""
        stage = self._stage
        if stage is not None:
            self._stop = _Stop(held=True)
            stage.stop()
            self._pages.say_stop("stopping")

    def _keep_stopped(self) -> None:
        """Stop again where the answer to an earlier question let the robot move after the press."""
        stage = self._stage
        if stage is not None and self._stop.held and not stage.link.stopped:
            stage.stop()

    def _watchers_changed(self, present: bool) -> None:
        """A real robot stops when the last page that watched it is gone."""
        stage = self._stage
        if stage is not None and stage.simulator is None and not present:
            self._press("gone")
            self._pages.send("notice", text="Nobody watched any more, so the robot was stopped.", keep="notice")

    def _confirm_stop(self) -> None:
        """Say that the robot has stopped once its link says so: the stop is latched and no joint moves. Positions are
        compared: a simulator stands still after braking, with whatever velocity was left."""
        stage, stop, now = self._stage, self._stop, time.monotonic()
        if stop.confirmed or stage is None or not stage.link.stopped or now - stop.read < _REST_S:
            return
        try:
            joints = np.array(stage.link.joint_positions())
        except MemoError:
            return
        before, stop.joints, stop.read = stop.joints, joints, now
        if before is not None and float(np.abs(joints - before).max(initial=0.0)) < _REST:
            stop.confirmed = True
            self._pages.say_stop("stopped")

    def _end(self) -> None:
        stage = self._stage
        if stage is not None:
            self._stop.held = True  # leaves an open question
            stage.end()

    # -- questions and answers -----------------------------------------------------------------------------------------
    def _take_answer(self, message: dict[str, Any]) -> None:
        with self._lock:
            if message.get("id") == self._open_question:
                self._answers.put(message)
                return
        words = _words(message)
        if words and not message.get("choice"):  # to a question that is over: a remark all the same
            self._say(words)

    def _take_remark(self, message: dict[str, Any]) -> None:
        self._say(_words(message))

    def _say(self, words: str) -> None:
        """Stop for words that nobody asked for; they are the answer to the question that follows."""
        if words and self._stage is not None:
            self._remark = words
            self._press("remark")

    def _stopped_elsewhere(self) -> bool:
        """Whether something else than a page has stopped the robot, while a question was open that no stop led to."""
        return self._stage is not None and self._stage.link.stopped

    def _check_pages(self) -> None:
        if self._pages.lost:
            raise BackendLost("teacher", "web", "the server of its pages ended and cannot be started again")

    def _ask(
        self,
        about: str,
        title: str,
        choices: Sequence[tuple[str, str]],
        lines: Sequence[str] = (),
        words: str = "",
        after_a_stop: bool = False,
        **more: Any,
    ) -> dict[str, Any]:
        """Ask on the page and wait for the answer. ``choices``: (key, label) of buttons; ``words``: what to write in
        the large field, empty where no words are wanted. Raises ``Stopped`` if stop is pressed meanwhile."""
        with self._lock:
            self._open_question = number = next(self._numbers)
            while not self._answers.empty():
                self._answers.get()
        question = {
            "id": number,
            "about": about,
            "title": title,
            "lines": list(lines),
            "choices": [list(one) for one in choices],
            "words": words,
            **more,
        }
        self._pages.send("question", keep="question", question=question)
        try:
            while True:
                if self._stop.held or (not after_a_stop and self._stopped_elsewhere()):
                    raise Stopped("waiting for the person")
                if after_a_stop:
                    self._confirm_stop()
                self._check_pages()
                try:
                    return self._answers.get(timeout=_POLL_S)
                except queue.Empty:
                    continue
        finally:
            with self._lock:
                self._open_question = 0
            self._pages.forget("question")
            self._pages.send("question", question=None)

    def _verdict(
        self,
        about: str,
        title: str,
        yes: str,
        lines: Sequence[str],
        words: str,
        after_a_stop: bool = False,
        **more: Any,
    ) -> Verdict:
        """Ask for a verdict; words that may be praise or blame are asked back."""
        choices = (("approve", yes), _SILENCE)
        answer = self._ask(about, title, choices, lines, words, after_a_stop, **more)
        said = _words(answer)
        if answer.get("choice") in ("approve", "silent") and not said:
            return Verdict(answer["choice"])
        meaning = meaning_of(said)
        if meaning == "unsure" or (meaning == "approve" and answer.get("choice") == "silent"):
            meaning = self._asked_back(said, yes, "No, that is what is wrong", after_a_stop)
        if meaning in ("approve", "silent"):
            return Verdict(meaning)
        if meaning in ("empty", "explain"):
            return self._verdict(about, title, yes, lines, words, after_a_stop, **more)
        return Verdict("correct", said, bool(answer.get("about_plan")))

    def _asked_back(self, said: str, yes: str, no: str, after_a_stop: bool = False) -> Meaning:
        """Ask whether words approve or correct."""
        choices, lines = (("approve", yes), ("correct", no)), ("Which do you mean?",)
        choice = self._ask("unsure", f"You wrote: {said}", choices, lines, "", after_a_stop)["choice"]
        return "approve" if choice == "approve" else "correct"

    def judge(self, episode: Episode) -> Verdict:
        title = f"{episode.subtask}, attempt {episode.attempt}. Did it work?"
        lines = [f"The robot says: {episode.spoken_error}"] if episode.spoken_error else []
        moved = ", ".join(node.label for node in episode.moved) or "nothing"
        return self._verdict(
            "attempt", title, "It worked", [*lines, f"What moved: {moved}."], "What was wrong?", plan_choice=True
        )

    def interrupted(self, episode: Episode) -> Verdict:
        self._stop.held = False  # from now on a press is a new one
        try:
            if self._remark:
                words, self._remark = self._remark, ""
                self._await_rest()
                return Verdict("correct", words)
            title = f"Stopped during {episode.subtask}. What was wrong?"
            return self._verdict(
                "stop", title, "It had worked", (), "What was wrong?", after_a_stop=True, plan_choice=True
            )
        finally:
            if not self._stop.held:
                self._pages.say_stop("clear")
                self._pages.forget("notice")
                self._pages.send("notice", text="")

    def _await_rest(self) -> None:
        """Wait a moment until the link says that the robot rests."""
        until = time.monotonic() + 2.0
        while not self._stop.confirmed and time.monotonic() < until and not self._stop.held:
            self._confirm_stop()
            time.sleep(_POLL_S)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        lines = [f"Done when {sentence}." for sentence in episode.goal]
        if episode.subtasks:
            lines.append(f"What was done: {', '.join(episode.subtasks)}.")
        title = f'The robot says that the task "{episode.task}" is done. Is it?'
        return self._verdict("task", title, "The task is done", lines, "What is missing, or wrong?")

    def judge_plan(self, proposal: Proposal) -> Verdict:
        if not self.settings.plans:
            return Verdict("silent")
        done = ", ".join(proposal.subtasks) or "nothing yet"
        lines = [f"Done so far: {done}.", "Nothing moves before you answer."]
        verdict = self._verdict("plan", f"Next: {proposal.subtask}.", "Go on", lines, "What should it do instead?")
        return attrs.evolve(verdict, about_plan=verdict.kind == "correct")

    # -- what was made of the words ------------------------------------------------------------------------------------
    @property
    def reads_back(self) -> bool:
        return self.settings.read_back

    def read_back(self, noted: Noted) -> ReadBack:
        if not noted.notes:
            asked = noted.question or "What should I do differently?"
            title = "I could not learn anything from that."
            answer = self._ask(
                "notes", title, (("accept", "Never mind"),), (f"You said: {noted.words}", asked), "In other words"
            )
            words = _words(answer)
            if answer.get("choice") == "accept" or meaning_of(words) in ("silent", "empty"):
                return ReadBack("accepted")
            return self.read_back(noted) if teaches_nothing(words) else self._reworded(words)
        notes = [{"key": note.key or "everywhere", "text": note.text} for note in noted.notes]
        right = "Right, keep them"
        choices = (("accept", right), ("strike", "Strike what I marked"))
        lines = (f"You said: {noted.words}",)
        answer = self._ask("notes", "I noted:", choices, lines, "Say it in other words", notes=notes)
        words = _words(answer)
        if answer.get("choice") == "strike":
            struck = {one for one in answer.get("struck", []) if isinstance(one, int) and 0 <= one < len(noted.notes)}
            return ReadBack("struck", struck=tuple(sorted(struck))) if struck else self.read_back(noted)
        if answer.get("choice") == "accept":
            return ReadBack("accepted")
        meaning = meaning_of(words)
        if meaning == "unsure":
            meaning = self._asked_back(words, right, "No, that is what I meant instead")
        if meaning == "explain":
            return self.read_back(noted)
        return self._reworded(words) if meaning == "correct" else ReadBack("accepted")

    def _reworded(self, words: str) -> ReadBack:
        pages_hear(Reworded(self.who, words))
        return ReadBack("reworded", words)

    # -- hardware ------------------------------------------------------------------------------------------------------
    @property
    def permits(self) -> bool:
        return self.settings.starts_motion

    def permit(self, program: Program) -> Verdict:
        choices = (("approve", "Release it: the robot may move"), ("silent", "Do not run it"))
        title = f"The program for {program.subtask}, attempt {program.attempt}"
        lines = ("Nothing moves before you answer. May it move the robot?",)
        while True:
            answer = self._ask("program", title, choices, lines, "What is wrong with it?", code=program.code)
            words = _words(answer)
            if answer.get("choice") in ("approve", "silent"):
                return Verdict(answer["choice"])
            if len(words.split()) > 1 and meaning_of(words) == "correct":
                return Verdict("correct", words)

    def put_back(self, episode: Episode) -> bool:
        moved = episode.moved
        names = ", ".join(node.label for node in moved) or "everything"
        stood = [f"{node.label} stood at {place_in_words(node)}" for node in moved]
        title = f"Please put back as it was before {episode.subtask}: {names}."
        choices = (("yes", "It is done"), ("no", "I cannot"))
        lines = ("The robot cannot undo what it did.", *stood)
        return bool(self._ask("put back", title, choices, lines)["choice"] == "yes")

    def set_up(self, arrangement: Arrangement) -> bool:
        title = f'Trial {arrangement.number} of {arrangement.of}: "{arrangement.task}"'
        lines = (f"Please set up arrangement {arrangement.scene} of this task, and leave the workspace.",)
        choices = (("yes", "It is done"), ("no", "Pause the evaluation here"))
        return bool(self._ask("set up", title, choices, lines)["choice"] == "yes")

    def confirm(self, episode: Episode) -> bool:
        title = "Please look: may the robot go on from the scene as it is now?"
        lines = (
            f"The run was cut off during {episode.subtask}; what the robot did last is unknown.",
            "It will look and plan anew.",
        )
        return bool(self._ask("confirm", title, (("yes", "Go on"), ("no", "No")), lines)["choice"] == "yes")


def _words(message: dict[str, Any]) -> str:
    words = message.get("words", "")
    return words.strip()[: 4 * LONGEST_WORDS] if isinstance(words, str) else ""
