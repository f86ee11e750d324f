"""A person at the terminal. Asked after every subtask, when the task is said to be done, and right after Ctrl-C."""

from __future__ import annotations

import getpass
import re
import sys
from collections.abc import Sequence
from typing import TypeVar

import attrs

from memo_core.interfaces.teacher import (
    Arrangement,
    Episode,
    Noted,
    Program,
    Proposal,
    ReadBack,
    TaskEpisode,
    Teacher,
    Verdict,
)
from memo_core.scene.graph import Node
from memo_core.teachers.answers import (
    NO,
    NO_ELSEWHERE,
    YES,
    YES_ELSEWHERE,
    Meaning,
    bare,
    in_other_words,
    meaning_of,
    teaches_nothing,
)
from memo_core.teachers.typed_line import TypedLine
from memo_core.text.reading_limits import LONGEST_WORDS

Answer = TypeVar("Answer")
EXPLAINED = f"""Answer in your own words; a pasted text of several paragraphs is one answer. At most {LONGEST_WORDS}
characters are read; a longer text is stored and set aside.
  y                     it worked (so does "great job, thanks!")
  s                     say nothing: it stays open whether it worked
  what was wrong        e.g. "no, pull the handle in an arc"; it is noted, and the subtask is tried again
  plan: what to do      e.g. "plan: open the door first"; about what is done next, not about how
  ?                     this
Ctrl-C stops the robot and asks what was wrong; twice within two seconds ends the run."""


@attrs.frozen
class TerminalSettings:
    """Settings of the teacher at the terminal."""

    who: str = attrs.field(default="", metadata={"help": "your name in the skillbook; default: the user's login name"})
    read_back: bool = attrs.field(
        default=True, metadata={"help": "whether what was noted of your words is shown, to accept, reword or strike"}
    )
    plans: bool = attrs.field(default=False, metadata={"help": "whether you are asked before each planned subtask"})


class TerminalTeacher(Teacher):
    """Reads answers from standard input. End of input means that nobody watches (silent)."""

    def __init__(self, settings: TerminalSettings) -> None:
        self.settings = settings
        self._line = TypedLine()

    def open(self) -> None:
        self._line.open()
        self.who = self.settings.who or login_name()

    def close(self) -> None:
        self._line.close()

    @property
    def left(self) -> bool:
        return self._line.ended

    @property
    def follows_motion(self) -> bool:
        return self._line.typed

    # -- whether it worked ---------------------------------------------------------------------------------------------
    def judge(self, episode: Episode) -> Verdict:
        return self._asked_about(f"{episode.subtask}, attempt {episode.attempt}. Did it work?", "it worked", episode)

    def interrupted(self, episode: Episode) -> Verdict:
        return self._asked_about(f"Stopped during {episode.subtask}. What was wrong?", "it had worked", episode)

    def _asked_about(self, question: str, approval: str, episode: Episode) -> Verdict:
        if episode.spoken_error:
            _say(f"The robot says: {episode.spoken_error}")
        moved = ", ".join(node.label for node in episode.moved) or "nothing"
        about = [f"The task: {episode.task}. The robot tried {episode.subtask}; what moved: {moved}."]
        hint = f"y = {approval}, s = say nothing, ? = help, or say what was wrong"
        return self._verdict(question, hint, about, episode.recordings)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        about = [f"The task: {episode.task}.", *(f"  done when {sentence}" for sentence in episode.goal)]
        if episode.subtasks:
            about.append(f"What was done: {', '.join(episode.subtasks)}.")
        return self._verdict(
            f'The robot says that the task "{episode.task}" is done. Is it?',
            "y = it is, s = say nothing, ? = help, or say what is missing",
            about,
            episode.recordings,
        )

    def judge_plan(self, proposal: Proposal) -> Verdict:
        if not self.settings.plans:
            return Verdict("silent")
        done = ", ".join(proposal.subtasks) or "nothing yet"
        about = [f"The task: {proposal.task}. Done so far: {done}. Nothing moves before you answer."]
        hint = "y = go on, s = say nothing, ? = help, or say what to do instead"
        verdict = self._verdict(f"Next: {proposal.subtask}.", hint, about)
        return attrs.evolve(verdict, about_plan=verdict.kind == "correct")

    def _verdict(self, question: str, hint: str, about: Sequence[str], recordings: Sequence[str] = ()) -> Verdict:
        """Asks until there is an answer: an empty line asks again, ``?`` explains, and praise that says more leads to a
        further question."""
        asked = (*(f"  see {recording}" for recording in recordings), f"{question} [{hint}]")
        while True:
            typed = self._line.ask(*asked)
            if typed is None:
                return _ended(Verdict("silent"), "nothing was said: it stays open whether it worked")
            words = typed.strip()
            meaning = meaning_of(words)
            if meaning == "unsure":
                meaning, words = self._asked_back(words)
            if meaning == "approve":
                return Verdict("approve")
            if meaning == "silent":
                return Verdict("silent")
            if meaning == "explain":
                _say(*about, EXPLAINED)
            if meaning == "correct":
                planned = words[: len("plan:")].lower() == "plan:"
                told = words[len("plan:") :].strip() if planned else words
                if told:
                    return Verdict("correct", told, planned)

    def _asked_back(self, words: str) -> tuple[Meaning, str]:
        """The meaning of an answer that may be an approval, as the person explains it, and the words to go by: these,
        or those said instead."""
        while True:
            typed = self._line.ask(
                f'"{words}": is it fine as it is, or is something to be done differently?',
                "[y = it is fine, c = that was a correction, or say it in other words]",
            )
            if typed is None:
                return _ended("silent", "it stays open whether it worked"), words
            if bare(typed) in YES | YES_ELSEWHERE | {"fine"}:
                return "approve", words
            if bare(typed) in NO | NO_ELSEWHERE | {"c", "correction", "differently"}:
                return "correct", words
            words = typed.strip() or words
            if (meaning := meaning_of(typed)) not in ("unsure", "empty"):
                return meaning, words

    # -- what was made of the words ------------------------------------------------------------------------------------
    @property
    def reads_back(self) -> bool:
        return self.settings.read_back

    def read_back(self, noted: Noted) -> ReadBack:
        if not noted.notes:
            return self._nothing_learnt(noted)
        listed = [f"  {n}. {note.key or 'everywhere'}: {note.text}" for n, note in enumerate(noted.notes, 1)]
        asked = ["I noted:", *listed]
        hint = "y = right, x = strike all"
        hint += f", x {len(noted.notes)} = strike only note {len(noted.notes)}" if len(noted.notes) > 1 else ""
        while True:
            typed = self._line.ask(*asked, f"[{hint}, or say it in other words]")
            asked = []
            if typed is None:
                return _ended(ReadBack("accepted"), "the notes are kept as they are")
            if (reaction := self._reaction(typed.strip(), noted)) is not None:
                return reaction

    def _reaction(self, words: str, noted: Noted) -> ReadBack | None:
        """The reaction that an answer to a read-back stands for; None where the person has to be asked again."""
        short = bare(words)
        struck = _struck(short, len(noted.notes))
        if struck is not None:
            return ReadBack("struck", struck=struck)
        if re.fullmatch(r"x[\d\s,]+", short):
            _say(f"There are notes 1 to {len(noted.notes)}.")
            return None
        if short in NO | NO_ELSEWHERE | {"wrong"}:
            _say("What did you mean?")
            return None
        meaning = meaning_of(words)
        if meaning == "unsure":
            meaning, words = self._asked_back(words)
        if meaning == "explain":
            _say(f'This was made of your words "{noted.words}" and is used from now on, also by other tasks.')
        if meaning in ("approve", "silent"):
            return ReadBack("accepted")
        return ReadBack("reworded", words) if meaning == "correct" else None

    def _nothing_learnt(self, noted: Noted) -> ReadBack:
        question = noted.question or "What should I do differently?"
        while True:
            typed = self._line.ask(
                f"I could not learn anything from that. {question}", "[s = never mind, or say it in other words]"
            )
            if typed is None:
                return _ended(ReadBack("accepted"), "nothing is noted")
            meaning = meaning_of(typed)
            if meaning == "silent":
                return ReadBack("accepted")
            if meaning not in ("empty", "explain") and not teaches_nothing(typed):
                return ReadBack("reworded", typed.strip())

    # -- hardware ------------------------------------------------------------------------------------------------------
    @property
    def permits(self) -> bool:
        return True

    def permit(self, program: Program) -> Verdict:
        """End of input permits nothing."""
        shown = [f"The program for {program.subtask}, attempt {program.attempt}:", "", program.code.rstrip(), ""]
        question = "Nothing moves before you answer. May it move the robot? [y = yes, n = no, or say what is wrong]"
        while True:
            typed = self._line.ask(*shown, question)
            shown = []
            if typed is None:
                return _ended(Verdict("silent"), "the program is not released")
            words = typed.strip()
            if bare(words) in YES | {"release", "release it"}:
                return Verdict("approve")
            if bare(words) in NO | {"s"}:
                return Verdict("silent")
            if len(words.split(maxsplit=1)) > 1 and not in_other_words(words):
                return Verdict("correct", words)

    def put_back(self, episode: Episode) -> bool:
        moved = episode.moved
        names = ", ".join(node.label for node in moved) or "everything"
        stood = [f"  {node.label} stood at {place_in_words(node)}" for node in moved]
        seen = [f"  see {recording}" for recording in episode.recordings]
        asked = f"The robot cannot undo what it did. Please put back as it was before {episode.subtask}: {names}."
        return self._yes_or_no((asked, *stood, *seen), "y = done, n = cannot")

    def set_up(self, arrangement: Arrangement) -> bool:
        asked = (
            f'Trial {arrangement.number} of {arrangement.of}: "{arrangement.task}". Please set up arrangement '
            f"{arrangement.scene} of this task, and leave the workspace."
        )
        return self._yes_or_no((asked,), "y = done, n = pause the evaluation here")

    def confirm(self, episode: Episode) -> bool:
        asked = (
            f"The run was cut off during {episode.subtask}; what the robot did last is unknown. Please look: may it go "
            "on from the scene as it is now? It will look and plan anew."
        )
        return self._yes_or_no((asked,), "y = go on, n = no")

    def _yes_or_no(self, asked: tuple[str, ...], hint: str) -> bool:
        """Asks until the answer is yes or no; no at the end of input."""
        while True:
            typed = self._line.ask(*asked, f"[{hint}]")
            asked = ()
            if typed is None:
                return _ended(False, "taken as no")
            if bare(typed) in YES | {"done"}:
                return True
            if bare(typed) in NO | {"cannot", "can't"}:
                return False


def _struck(words: str, count: int) -> tuple[int, ...] | None:
    """Indices of the notes that "x", "x 2" or "strike 1, 3" strikes (empty: all); None for anything else."""
    tokens = words.lower().replace(",", " ").split()
    if not tokens or tokens[0] not in ("x", "strike", "delete", "remove"):
        return None
    if tokens[1:] in ([], ["all"], ["it"], ["them"]):
        return ()
    if not all(token.isdecimal() and 1 <= int(token) <= count for token in tokens[1:]):
        return None
    return tuple(sorted({int(token) - 1 for token in tokens[1:]}))


def _ended(answer: Answer, taken: str) -> Answer:
    """The answer where there is no more input, saying so."""
    _say(f"memo: input ended, so nobody answers: {taken}")
    return answer


def _say(*lines: str) -> None:
    print(*lines, sep="\n", file=sys.stderr, flush=True)


def place_in_words(node: Node) -> str:
    """Describe where a node is, as a person beside the robot would measure it.

    Args:
        node: the node; its position is in metres, in the frame of the robot's base.
    """
    x, y, z = node.pose.position
    side = f"{abs(100 * y):.0f} cm to the {'left' if y > 0 else 'right'}"
    return f"{100 * x:.0f} cm ahead of the robot's base, {side}, {100 * z:.0f} cm up"


def login_name() -> str:
    """The name under which the user is logged in, or the default of teachers where there is none."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # a container's user may have no name
        return Teacher.who
