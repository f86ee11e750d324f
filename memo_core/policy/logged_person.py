"""The person of a run: every question and answer, one method each, recorded in the run's log.

Words are stored once, before the log says that they were heard; the log refers to them by their number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol

import attrs

from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, TaskEpisode, Verdict
from memo_core.policy.logged_world import LoggedWorld
from memo_core.policy.run_context import Session
from memo_core.runlog.run_log import Effect
from memo_core.runlog.words_file import WordsFile


@attrs.frozen
class Heard:
    """A verdict. ``feedback``: the id of the words in the book; 0 if they are not stored there."""

    kind: Literal["approve", "correct", "silent"]
    words: str = ""
    feedback: int = 0

    @property
    def stays(self) -> bool:
        """Whether the world stays as the attempt left it, because the attempt was not corrected."""
        return self.kind != "correct"


@attrs.frozen
class Answered:
    """A reaction to a read-back. ``feedback``: the id of the words of a rewording; 0 if there are none."""

    answer: ReadBack
    feedback: int = 0


class WordStore(Protocol):
    """The single place where the words of one verdict are stored; the run's log refers to them by their number."""

    def keep(self, words: str, entry: int, state: str) -> int:
        """Store words that are the result of this log entry, together with the teacher's state after them, in one
        transaction. On disk when this returns. Returns their number."""

    def kept(self, entry: int) -> tuple[int, str, str] | None:
        """Number, words and state stored for the entry, if any."""

    def read(self, number: int) -> str:
        """The words. Raises ``InvalidArgument`` if they were removed."""


class LoggedPerson:
    """The person who watches one run, as its loop asks them."""

    def __init__(self, session: Session, world: LoggedWorld) -> None:
        self._person = session.person
        self._world = world
        self._log = session.log
        self._praise: WordStore = WordsFile(session.log.folder, session.person.who)  # words that are no correction
        self._state = ""  # of the person, after the last verdict
        self._log.before_live(lambda: self._person.restore(self._state))

    def judge(self, episode: Episode, after_a_stop: bool, words: WordStore) -> Heard:
        """The teacher's verdict on an episode. A correction is stored in ``words`` before it is processed. Raises
        ``Stopped``."""
        name = "feedback after a stop" if after_a_stop else "feedback"
        about = f"{episode.subtask}, attempt {episode.attempt}"
        return self._heard(name, about, lambda: self._person.judge(episode, after_a_stop), words, after_a_stop)

    def judge_task(self, episode: TaskEpisode, words: WordStore) -> Heard:
        """The teacher's verdict on the whole task. Raises ``Stopped``."""
        return self._heard("verdict on the task", "", lambda: self._person.judge_task(episode), words)

    def judge_plan(self, proposal: Proposal, words: WordStore) -> Heard:
        """The teacher's verdict on the planned subtask. Raises ``Stopped``."""
        return self._heard("verdict on the plan", proposal.subtask, lambda: self._person.judge_plan(proposal), words)

    def permit(self, program: Program, words: WordStore) -> Heard:
        """Whether a program may run; ``approve`` if no person has to be asked. Raises ``Stopped``."""
        if not self._person.permits:
            return Heard("approve")
        about = f"{program.subtask}, attempt {program.attempt}, {len(program.code)}"
        return self._heard("release of a program", about, lambda: self._person.permit(program), words)

    def read_back(self, noted: Noted, feedback: int, words: WordStore) -> Answered:
        """The person's reaction to the notes made of their words (``feedback``); accepted if nobody is asked. A
        rewording is stored in ``words``. Raises ``Stopped``."""
        kind: Effect[Answered] = Effect(
            "read back", self._keep_answered, lambda record: self._read_answered(record, words), outside=True
        )

        def ask(entry: int) -> Answered:
            answer = self._person.read_back(noted)
            if answer.kind != "reworded":
                return Answered(answer)
            if not answer.words.strip():
                return Answered(ReadBack("accepted"))
            return Answered(answer, words.keep(answer.words, entry, self._person.state()))

        def found(entry: int) -> Answered | None:
            kept = self._kept(words, entry)
            return None if kept is None else Answered(ReadBack("reworded", kept[1]), kept[0])

        return self._log.effect(kind, f"feedback {feedback}", ask, found)

    def _heard(
        self, name: str, about: str, put: Callable[[], Verdict], words: WordStore, after_a_stop: bool = False
    ) -> Heard:
        kind: Effect[Heard] = Effect(
            name,
            lambda heard: self._keep_heard(heard, after_a_stop),
            lambda record: self._read_heard(record, words),
            outside=self._person.watches,
            answers_stop=after_a_stop,
        )

        def ask(entry: int) -> Heard:
            verdict = put()
            if after_a_stop and verdict.kind != "correct":
                self._world.leaving.wait()  # the world is kept as it is now
            if verdict.kind != "correct" and not verdict.words:
                return Heard(verdict.kind)
            keeper = words if verdict.kind == "correct" else self._praise
            number = keeper.keep(verdict.words, entry, self._person.state())
            return Heard(verdict.kind, verdict.words, number)

        def found(entry: int) -> Heard | None:
            kept = self._kept(words, entry)
            return None if kept is None else Heard("correct", kept[1], kept[0])

        return self._log.effect(kind, about, ask, found)

    def _kept(self, words: WordStore, entry: int) -> tuple[int, str] | None:
        """Number and words that were stored before a crash; the teacher's state is restored with them."""
        kept = words.kept(entry)
        if kept is None:
            return None
        number, text, state = kept
        self._person.restore(state)
        return number, text

    def has_ended(self) -> bool:
        """Whether a person has ended the run."""
        return self._log.effect(Effect[bool]("ending?"), "", lambda _: self._person.has_ended())

    def put_back(self, episode: Episode) -> bool:
        """Ask the teacher to put the scene back as it was in ``episode.before``; False if that was not done."""
        kind: Effect[bool] = Effect("put back by hand", outside=True, confirms=True)
        ask = self._person.put_back
        return self._person.puts_back and self._log.effect(kind, episode.subtask, lambda _: ask(episode))

    def confirm(self, episode: Episode) -> None:
        """Ask the teacher to confirm that the robot may continue from the present scene. Raises ``InvalidArgument``
        without confirmation."""
        kind: Effect[bool] = Effect("confirm the scene", outside=True, confirms=True)
        ask = self._person.confirm
        if not self._person.confirms or not self._log.effect(kind, episode.subtask, lambda _: ask(episode)):
            problem = f"what the robot did in {episode.subtask} before the interruption is in doubt"
            raise InvalidArgument("the world", problem, "somebody who looks and confirms the scene when asked")

    def time_is_up(self, robot_s: float, attempts: int, calls: int) -> bool:
        """Whether the person has no more time; decided once, also where the run is resumed."""
        if not self._person.has_limited_time:
            return False
        kind = Effect[bool]("ask whether time is up")
        return self._log.effect(kind, str(attempts), lambda _: self._person.time_is_up(robot_s, attempts, calls))

    # -- how answers are kept ------------------------------------------------------------------------------------------
    def _keep_heard(self, heard: Heard, after_a_stop: bool) -> dict[str, Any]:
        """The words by their id."""
        self._state = self._person.state()
        world = self._world.keep_world() if after_a_stop and heard.stays else {}
        return {"kind": heard.kind, "words": heard.feedback, "teacher": self._state, **world}

    def _keep_answered(self, answered: Answered) -> dict[str, Any]:
        self._state = self._person.state()
        answer = answered.answer
        return {
            "kind": answer.kind,
            "struck": list(answer.struck),
            "words": answered.feedback,
            "teacher": self._state,
        }

    def _read_answered(self, record: dict[str, Any], words: WordStore) -> Answered:
        self._state = record["teacher"]
        text = words.read(record["words"]) if record["words"] else ""
        return Answered(ReadBack(record["kind"], text, tuple(record["struck"])), record["words"])

    def _read_heard(self, record: dict[str, Any], words: WordStore) -> Heard:
        self._state = record["teacher"]
        if "world" in record:
            self._world.read_world(record)
        number, keeper = record["words"], words if record["kind"] == "correct" else self._praise
        return Heard(record["kind"], keeper.read(number) if number else "", number)
