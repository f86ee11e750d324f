"""Errors that MEMO raises deliberately: one base class, structured fields, and a one-line message that a user can act
on.

Subclasses carry their data as fields, so that no code has to parse a message; ``str(error)`` is the line shown to
people. Packages define their own subclasses next to the code that raises them; those below are shared by several
packages."""

from __future__ import annotations

import difflib
import errno
import unicodedata
from collections.abc import Iterable

import attrs

WHILE = "raised while"  # how a note begins that says whose code raised an error


class MemoError(Exception):
    """Base class of all expected errors. ``exit_code`` is what the command line exits with."""

    exit_code = 1


_UNWRITABLE = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.ENAMETOOLONG}
_NO_FOLDER = {errno.EEXIST, errno.ENOTDIR}
_LONGEST_NAME = 500  # characters of an unknown name that are shown


def close_match(name: str, valid: Iterable[str]) -> str:
    """Suggestion for an unknown name, to be appended to an error message.

    Args:
        name: the unknown name.
        valid: names that exist; case is ignored in the comparison.

    Returns:
        ``"; did you mean 'x'?"`` with the most similar valid name, or an empty string if none is similar.
    """
    spelt = {one.lower(): one for one in valid}
    found = [spelt[one] for one in difflib.get_close_matches(name.lower(), list(spelt), n=1, cutoff=0.5)]
    return f"; did you mean {found[0]!r}?" if found else ""


def unwritable(error: BaseException) -> str:
    """The fault of the file or disk that an error of the system is about; empty for other errors."""
    if not isinstance(error, OSError) or error.errno not in _UNWRITABLE | _NO_FOLDER | {errno.EISDIR}:
        return ""
    problem = "a file is where a folder is needed" if error.errno in _NO_FOLDER else error.strerror
    return f"{error.filename}: {problem}" if error.filename else str(problem)


def spelt_alike(name: str, valid: Iterable[str]) -> list[str]:
    """The other names that differ from ``name`` only in case, blanks or the encoding of their letters."""
    return sorted(one for one in set(valid) - {name} if _folded(one) == _folded(name))


def _folded(name: str) -> str:
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


@attrs.define(auto_exc=True, eq=False)
class UnknownName(MemoError):
    """An unknown name of a backend, a task, a skill or an object in the scene."""

    kind: str
    name: str
    available: tuple[str, ...]

    exit_code = 2

    def __str__(self) -> str:
        known = ", ".join(sorted(self.available)) or "none"
        name = self.name if len(self.name) <= _LONGEST_NAME else f"{self.name[:_LONGEST_NAME]}…"
        guess = close_match(name, self.available)
        listed = "memo tasks list" if guess and self.kind == "task" else f"available: {known}"
        return f"unknown {self.kind} {name!r}{guess} ({listed})"


@attrs.define(auto_exc=True, eq=False)
class BackendUnavailable(MemoError):
    """A backend that is known but cannot be used here; ``remedy`` says what would make it usable."""

    kind: str
    name: str
    reason: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} cannot be used: {self.reason}" + (f" ({self.remedy})" if self.remedy else "")


@attrs.define(auto_exc=True, eq=False)
class BackendLost(MemoError):
    """A backend's process ended or stopped answering in the middle of a run. This ends the run, which has no result;
    another try may succeed. ``remedy`` says what may be done, if anything is known."""

    kind: str
    name: str
    problem: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r}: {self.problem}" + (f" ({self.remedy})" if self.remedy else "")


@attrs.define(auto_exc=True, eq=False)
class RobotFault(MemoError):
    """A real robot no longer accepts commands. This ends the program and the run: no code may continue, and MEMO does
    not recover automatically. ``fault`` is an identifier such as ``reflex`` or ``user-stop``; ``remedy`` says what a
    person has to do."""

    robot: str
    fault: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"robot {self.robot!r}: {self.problem} ({self.remedy})"


@attrs.define(auto_exc=True, eq=False)
class TaskCodeError(MemoError):
    """A task's own code raised an error or returned the wrong thing. This ends a run: generated code is not to blame.
    ``hook`` is the method, such as ``check()``; ``problem`` says what happened, with the author's file and line."""

    task: str
    hook: str
    problem: str

    def __str__(self) -> str:
        return f"task {self.task!r}: {self.hook} {self.problem}"


@attrs.define(auto_exc=True, eq=False)
class MethodCodeError(MemoError):
    """A plugin's method raised an error that is not MEMO's, such as a server that it cannot reach, or returned no
    ``RunResult``. ``problem`` says what happened, with the author's file and line."""

    method: str
    problem: str

    def __str__(self) -> str:
        return f"method {self.method!r}: run() {self.problem}"


@attrs.define(auto_exc=True, eq=False)
class InvalidArgument(MemoError):
    """An invalid argument; says what would be valid."""

    argument: str
    problem: str
    expected: str = ""

    exit_code = 2

    def __str__(self) -> str:
        return f"{self.argument}: {self.problem}" + (f"; expected {self.expected}" if self.expected else "")


@attrs.define(auto_exc=True, eq=False)
class OutputLost(MemoError):
    """What a command prints cannot be written to stdout, for instance because the disk is full."""

    problem: str

    def __str__(self) -> str:
        return f"stdout cannot be written: {self.problem}"


@attrs.define(auto_exc=True, eq=False)
class Stopped(MemoError):
    """The latched stop was set. Generated code never sees this error: the sandbox is killed instead."""

    where: str = ""

    exit_code = 130

    def __str__(self) -> str:
        return "stopped" + (f" while {self.where}" if self.where else "")


@attrs.define(auto_exc=True, eq=False)
class SkillError(MemoError):
    """A skill failed. The error is context for the next attempt and does not end the run.

    ``skill`` is the skill's name, ``problem`` one sentence with numbers and units.
    """

    skill: str
    problem: str

    def __str__(self) -> str:
        return f"{self.skill}: {self.problem}"


@attrs.define(auto_exc=True, eq=False)
class MotionError(SkillError):
    """A motion that cannot be made (before anything moved) or did not arrive (``reached`` says by how much).

    ``cause`` is one of ``unreachable``, ``joint-limit``, ``self-collision``, ``collision``, ``workspace``,
    ``no-branch`` (no continuous arm configuration along the path), ``not-arrived``, ``no-contact`` (an expected contact
    was missing) and ``force`` (the measured force exceeded the allowed one).
    """

    cause: str = "unreachable"
    position_error_m: float | None = None
    rotation_error_rad: float | None = None
