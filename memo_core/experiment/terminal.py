"""A person at the terminal. Asked after every subtask, and right after pressing Ctrl-C."""

from __future__ import annotations

import getpass
import io
import math
import sys

import attrs

from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Episode, Teacher, Verdict

APPROVALS = {"y", "yes", "ok", "good", "fine"}
SILENCES = {"s", "skip"}


@attrs.frozen
class TerminalSettings:
    """Settings of the teacher at the terminal."""

    who: str = attrs.field(default="", metadata={"help": "your name in the skillbook; default: the user's login name"})


class TerminalTeacher(Teacher):
    """Reads a verdict from standard input. End of input means that nobody watches (silent)."""

    def __init__(self, settings: TerminalSettings) -> None:
        self.settings = settings

    def open(self) -> None:
        if sys.stdin is None or sys.stdin.closed:
            raise InvalidArgument("teacher.backend", "standard input is closed", "a terminal, or another teacher")
        if isinstance(sys.stdin, io.TextIOWrapper):
            sys.stdin.reconfigure(errors="surrogateescape")  # a byte that is no UTF-8 must not cost what was said
        self.who = self.settings.who or _login_name()

    def judge(self, episode: Episode) -> Verdict:
        return self._ask(f"{episode.subtask}, attempt {episode.attempt}. Did it work?", episode)

    def interrupted(self, episode: Episode) -> Verdict:
        return self._ask(f"Stopped during {episode.subtask}. What was wrong?", episode)

    def put_back(self, episode: Episode) -> bool:
        moved = ", ".join(_moved(episode)) or "everything"
        print(
            f"The robot cannot undo what it did. Please put back as it was before {episode.subtask}: {moved}.",
            file=sys.stderr,
        )
        print("[Enter = done, n = cannot]", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        return bool(line) and _text(line).strip().lower() not in ("n", "no")

    def _ask(self, question: str, episode: Episode) -> Verdict:
        if episode.spoken_error:
            print(f"The robot says: {episode.spoken_error}", file=sys.stderr)
        print(f"{question} [y = it worked, s = say nothing, or say what was wrong]", file=sys.stderr)
        while True:
            print("> ", end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            if not line:
                return Verdict("silent")
            words = _text(line).strip()
            if words.lower() in APPROVALS:
                return Verdict("approve")
            if words.lower() in SILENCES:
                return Verdict("silent")
            if words:
                return Verdict("correct", words)


def _moved(episode: Episode) -> list[str]:
    """The labels of what stands elsewhere than before."""
    now = {node.id: node for node in episode.after.nodes}
    moved = []
    for node in episode.before.nodes:
        metres, radians = node.pose.distance(now[node.id].pose) if node.id in now else (math.inf, 0.0)
        if metres > 0.01 or radians > 0.05:
            moved.append(node.label)
    return moved


def _login_name() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # a container's user may have no name
        return Teacher.who


def _text(line: str) -> str:
    """What was typed, as text that can be stored, also from a terminal that does not speak UTF-8."""
    try:
        line.encode()
    except UnicodeEncodeError:
        return line.encode(errors="surrogateescape").decode("latin-1")
    return line
