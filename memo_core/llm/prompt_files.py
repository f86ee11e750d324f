"""Prompt files: one per phase, versioned, replaceable from a config, and checked before they are used. A file is a
Jinja template after a front matter, which is ``version: …`` between two lines ``---``. Version and digest of the files
are stored with every question rendered from them.

The text before a line ``=== user ===`` joins the system message: what is the same in every question of the phase, so
that a provider can cache it. The user message begins with what changes rarely. A file without that line is all user
message.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError, UnknownName, close_match
from memo_core.interfaces.llm import Message
from memo_core.llm import prompt_filling
from memo_core.llm.prompt_filling import Unfit
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.text.parsing import read_at_most

SUFFIX = ".md.j2"
SYSTEM = "system"
BUILT_IN = "built-in"  # in place of a file
USER_MARK = "=== user ==="  # the line that begins the user message

_ROBOT = "the robot's description: robot.name, robot.reach (m), robot.gripper.kind, .stroke, .min_force, .hand_size, …"
_SCENE = "the scene as a table of objects and parts, with its relations as sentences"
_SUBTASK = "the subtask at hand, ACTION(object) or ACTION(object, place)"
_DONE = "lines: each subtask that was tried and how it ended"
_CORRECTED = (
    "what was said in this run, oldest first, each with .subtask, .code, .printed, .ended, .words, "
    ".notes (.key, .text) and .before, the programs of the same attempt before that code (.code, .printed, .ended)"
)
_SKILLS = "the documentation of the functions, from their declarations"
_SUBSET = "the Python that the sandbox runs, and its limits"
_RESTART = "whether everything is put back after code ended with an error"
PLACEHOLDERS: dict[str, dict[str, str]] = {
    SYSTEM: {"robot": _ROBOT},
    "plan": {
        "robot": _ROBOT,
        "task": "the instruction",
        "scene": _SCENE,
        "done": _DONE,
        "corrected": _CORRECTED,
        "notes": "what people said about plans, retrieved, best first, each with .task, .text, perhaps .origin",
    },
    "code": {
        "robot": _ROBOT,
        "task": "the instruction",
        "subtask": _SUBTASK,
        "scene": _SCENE,
        "done": _DONE,
        "skills": _SKILLS,
        "subset": _SUBSET,
        "corrected": _CORRECTED,
        "corrections": "retrieved corrections, best first, each with .key, .text, perhaps .origin (by whom, how alike)",
        "functions": "functions learnt that can be called, each with .signature, .docstring and .calls (.key, .text)",
        "competing": "whether to say what to do where several corrections may apply",
        "general": "retrieved general statements, best first, each with .text",
        "templates": "retrieved templates, best first, each with .key and .text",
        "attempts": "earlier programs of this attempt, each with .code, .printed and .ended",
        "restart": _RESTART,
        "tries": "how many more programs may be written when this one ends with an error",
    },
    "feedback": {
        "robot": _ROBOT,
        "task": "the instruction",
        "subtask": _SUBTASK,
        "scene": _SCENE,
        "code": "the code that was run; may be empty",
        "printed": "what it printed",
        "ended": "how it ended",
        "words": "what the person said, word for word",
        "before": "programs of the same attempt before that code, each with .code, .printed and .ended",
        "earlier": "what they said of this subtask before, each with .words and .notes (.text)",
        "subtasks": "the run's other subtasks, under which a note may be filed; empty where that is not wanted",
        "planning": "whether the words were said of the plan or the whole task",
        "plans": "whether notes about plans are wanted",
    },
    "template": {
        "robot": _ROBOT,
        "subtask": _SUBTASK,
        "scene": _SCENE,
        "code": "the code that a person approved",
        "printed": "what it printed",
    },
    "merge": {
        "robot": _ROBOT,
        "subtask": _SUBTASK,
        "scene": _SCENE,
        "skills": _SKILLS,
        "subset": _SUBSET,
        "programs": "what ran, in this order, each with .code, .printed and .ended",
        "restart": _RESTART,
    },
    "cluster": {
        "key": "what the notes are about, ACTION(object), or * for general statements",
        "entries": "the notes, each with .text and .after (the number of the template it was said of, or 0)",
        "templates": "related templates, each with .key, .text, .uses and .confirmed",
        "covered": "the number of the template whose repetitions among the notes may go, or 0",
        "characters": "how many characters all entries may have together",
        "longest": "how many characters one entry may have",
    },
    "generalise": {
        "skills": _SKILLS,
        "subset": _SUBSET,
        "programs": "programs of several subtasks, each with .key, .built (how the thing is built), .code and .tried "
        "(calls that failed for it, a line each)",
        "functions": "functions learnt that may be written anew, each with .text",
        "notes": "the notes of these subtasks, each with .key and .text",
        "characters": "how many characters functions, calls, what is left and notes may have together",
    },
}
OPTIONAL: dict[str, dict[str, Any]] = {  # what a question that says nothing of them is filled in with
    "plan": {"corrected": (), "notes": ()},
    "code": {"corrected": (), "functions": (), "competing": True, "restart": False, "tries": 0},
    "feedback": {"printed": "", "before": (), "earlier": (), "subtasks": (), "planning": False, "plans": False},
    "template": {"printed": ""},
    "merge": {"restart": False},
    "cluster": {"covered": 0, "longest": 0},
}
REQUIRED: dict[str, tuple[str, ...]] = {  # without these a question cannot be answered
    SYSTEM: (),
    "plan": ("task", "scene"),
    "code": ("subtask", "scene", "skills"),
    "feedback": ("subtask", "words"),
    "template": ("code",),
    "merge": ("programs",),
    "cluster": ("key", "entries", "templates", "characters"),
    "generalise": ("skills", "programs", "notes", "characters"),
}
PHASES = tuple(name for name in PLACEHOLDERS if name != SYSTEM)


@attrs.frozen
class _Entry:
    key: str = "OPEN(jar)"
    text: str = "Lift the lid straight up."
    origin: str = "person 1, remark 3 of 4, the same subtask"
    task: str = "open the jar"
    after: int = 0
    uses: int = 0
    confirmed: int = 0
    signature: str = "lift_lid(jar: str) -> None"
    docstring: str = "Lift a lid."
    calls: tuple[Any, ...] = ()


@attrs.frozen
class _Attempt:
    code: str = "look()\n"
    printed: str = "done"
    ended: str = "MotionError"
    subtask: str = "OPEN(jar)"
    words: str = "lift it straight up"
    notes: tuple[_Entry, ...] = (_Entry(),)
    key: str = "OPEN(jar)"
    built: str = "a lid on top of the jar"
    tried: tuple[str, ...] = ("lift_lid('jar') failed: MotionError",)
    before: tuple[Any, ...] = ()


SAMPLES: dict[str, Any] = {  # what a file is rendered with when it is checked
    "robot": RobotDescription("arm", "", (), GripperDescription(), "tool"),
    "task": "open the jar",
    "subtask": "OPEN(jar)",
    "scene": "## Scene\n| name |\n|---|\n| jar |",
    "done": ["OPEN(jar)"],
    "skills": "look() -> list",
    "subset": "Python.",
    "corrected": [_Attempt(before=(_Attempt(),))],
    "notes": [_Entry()],
    "corrections": [_Entry(), _Entry()],
    "functions": [_Entry(calls=(_Entry(),))],
    "competing": True,
    "general": [_Entry()],
    "templates": [_Entry()],
    "attempts": [_Attempt()],
    "programs": [_Attempt()],
    "restart": True,
    "tries": 1,
    "code": "look()\n",
    "printed": "lid off",
    "ended": "a person found fault with it",
    "words": "lift it straight up",
    "before": [_Attempt()],
    "earlier": [_Attempt()],
    "subtasks": ["PICK_UP(jar)"],
    "planning": False,
    "plans": True,
    "key": "OPEN(jar)",
    "entries": [_Entry()],
    "characters": 100,
    "covered": 1,
    "longest": 400,
}


@attrs.define(auto_exc=True, eq=False)
class BadPrompt(MemoError):
    """A prompt file that cannot be used: where (file and line, 0 for the whole) and why."""

    file: str
    line: int
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        return f"{self.file}{f':{self.line}' if self.line else ''}: {self.problem}"


@attrs.frozen
class PromptText:
    """One prompt's text without its front matter; ``line`` is the number of lines before it in its file."""

    name: str  # system or a phase
    text: str
    version: str  # as in the front matter; "" where it has none
    source: str  # the file, or BUILT_IN
    line: int = 0

    @property
    def parts(self) -> tuple[str, str]:
        """Text of the system message (may be empty) and of the user message."""
        mark = re.search(rf"^{USER_MARK}[ \t]*\r?(?:\n|\Z)", self.text, re.MULTILINE)
        return ("", self.text) if mark is None else (self.text[: mark.start()], self.text[mark.end() :])

    @property
    def digest(self) -> str:
        """The first 12 characters of the SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    @property
    def stamp(self) -> str:
        """Name, version and digest: ``code v3 0f2a91c4d7e8``."""
        return f"{self.name} v{self.version or '?'} {self.digest}"

    def render(self, context: Mapping[str, Any]) -> tuple[str, str]:
        """The parts for the system and the user message with their placeholders filled in; the first may be empty.
        Raises ``BadPrompt`` for a placeholder without a value and for an expression that fails or is not allowed."""
        given = {**OPTIONAL.get(self.name, {}), **context}
        known = {name: value for name, value in given.items() if name in PLACEHOLDERS[self.name]}
        fixed, rest = self.parts
        lines = self.text.count("\n") - rest.count("\n")
        return self._filled(fixed, 0, known), self._filled(rest, lines, known)

    def _filled(self, text: str, lines: int, values: Mapping[str, Any]) -> str:
        """A part of the text that begins after so many lines of it, filled in. Raises ``BadPrompt``."""
        try:
            return prompt_filling.filled(text, values)
        except Unfit as error:
            raise self._bad(error.line and error.line + lines, error.problem) from None

    def check(self) -> None:
        """Raise ``BadPrompt`` for invalid Jinja, an unknown placeholder, or a missing required one, and as
        ``render``. The same text is checked once."""
        fault = _fault_of(self)
        if fault is not None:
            raise BadPrompt(self.source, *fault)

    def _check(self) -> None:
        known = PLACEHOLDERS[self.name]
        try:
            used = prompt_filling.names_in(self.text)
        except Unfit as error:
            raise self._bad(error.line, error.problem) from None
        for name, line in used:
            if name not in known:
                problem = f"unknown placeholder {name[:100]!r}{close_match(name[:100], tuple(known))}; {self._known()}"
                raise self._bad(line, problem)
        for name in REQUIRED[self.name]:
            if name not in dict(used):
                raise self._bad(0, f"lacks the placeholder {{{{ {name} }}}}: {known[name]}")
        try:
            self.render({name: SAMPLES[name] for name in known})
        except BadPrompt as error:
            raise BadPrompt(error.file, error.line, f"{error.problem}; {self._known()}") from None

    def _bad(self, line: int, problem: str) -> BadPrompt:
        return BadPrompt(self.source, line + self.line if line else 0, problem)

    def _known(self) -> str:
        return "placeholders: " + ", ".join(PLACEHOLDERS[self.name])


@lru_cache(maxsize=64)
def _fault_of(prompt: PromptText) -> tuple[int, str] | None:
    """Line and problem of a text that is not in order: what reads a config checks it several times."""
    try:
        prompt._check()
    except BadPrompt as error:
        return error.line, error.problem
    return None


_MOST_BYTES = 4 << 20  # of one file


def read_prompt(name: str, file: Path) -> PromptText:
    """A prompt from a file. Raises ``BadPrompt`` if it cannot be read."""
    try:
        return _split(name, read_at_most(file, _MOST_BYTES).decode("utf-8"), str(file))
    except FileNotFoundError:
        raise BadPrompt(str(file), 0, "there is no such file") from None
    except (OSError, ValueError) as error:
        raise BadPrompt(str(file), 0, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


@cache
def built_in(name: str) -> PromptText:
    """The prompt that ships with MEMO. Raises ``UnknownName``."""
    if name not in PLACEHOLDERS:
        raise UnknownName("prompt", name, tuple(PLACEHOLDERS))
    file = resources.files("memo_core.llm").joinpath("prompts", name + SUFFIX)
    return _split(name, file.read_text(encoding="utf-8"), BUILT_IN)


def _split(name: str, text: str, source: str) -> PromptText:
    match = re.match(r"---[ \t]*\r?\n(.*?)^---[ \t]*\r?\n", text, re.DOTALL | re.MULTILINE)
    if match is None:
        return PromptText(name, text, "", source)
    version = ""
    for number, line in enumerate(match.group(1).splitlines(), start=2):
        key, colon, value = (part.strip() for part in line.partition(":"))
        if not line.strip():
            continue
        if not colon or key != "version":
            raise BadPrompt(source, number, f"{line.strip()!r} in the front matter; only `version: …` stands there")
        version = value.strip("'\"")
    return PromptText(name, text[match.end() :], version, source, match.group().count("\n"))


# -- replacing them from a config -------------------------------------------------------------------------------------


def _is_prompt(settings: Any, attribute: Any, value: str) -> None:
    if value:
        read_prompt(attribute.name, Path(value)).check()


def _is_folder(settings: Any, attribute: Any, value: str) -> None:
    if not value:
        return
    folder = Path(value)
    if not folder.is_dir():
        raise BadPrompt(value, 0, "there is no such folder")
    files = sorted(file.name for file in folder.glob("*" + SUFFIX))
    expected = ", ".join(name + SUFFIX for name in PLACEHOLDERS)
    if not files:
        raise BadPrompt(value, 0, f"holds no prompt; expected one or more of {expected}")
    for file in files:
        name = file.removesuffix(SUFFIX)
        if name not in PLACEHOLDERS:
            near = close_match(name, tuple(PLACEHOLDERS))
            raise BadPrompt(str(folder / file), 0, f"is no prompt of a phase{near} (expected: {expected})")
        read_prompt(name, folder / file).check()


def _override(phase: str) -> Any:
    return attrs.field(
        default="", validator=_is_prompt, metadata={"help": f"file with the {phase} prompt; default: the built-in one"}
    )


@attrs.frozen
class PromptSettings:
    """The ``prompts`` section of an experiment: files that replace the built-in texts (relative to the working
    directory). Unknown placeholders and missing files raise ``BadPrompt``."""

    folder: str = attrs.field(
        default="",
        validator=_is_folder,
        metadata={"help": "folder with plan.md.j2, code.md.j2, …; built-in files are used for those missing there"},
    )
    system: str = _override("system")
    plan: str = _override("plan")
    code: str = _override("code")
    feedback: str = _override("feedback")
    template: str = _override("template")
    merge: str = _override("merge")
    cluster: str = _override("cluster")
    generalise: str = _override("generalise")


class Prompts:
    """The prompts of one experiment."""

    def __init__(self, settings: PromptSettings | None = None) -> None:
        """Reads the replacements in ``settings``. Raises ``BadPrompt``."""
        settings = settings or PromptSettings()
        self._texts = {name: _chosen(settings, name) for name in PLACEHOLDERS}

    def text(self, name: str) -> PromptText:
        """Of ``system`` or a phase. Raises ``UnknownName``."""
        if name not in self._texts:
            raise UnknownName("prompt", name, tuple(self._texts))
        return self._texts[name]

    def stamp(self, phase: str) -> str:
        """Versions and digests of the files from which this phase's questions are rendered."""
        return f"{self.text(SYSTEM).stamp}, {self.text(phase).stamp}"

    def messages(self, phase: str, context: Mapping[str, Any]) -> tuple[Message, ...]:
        """System and user message of one phase. The robot is described in the first if ``context`` has a ``robot``; an
        empty system message is left out. Raises ``BadPrompt`` for a placeholder without a value."""
        fixed, user = self.text(phase).render(context)
        about = "" if context.get("robot") is None else "".join(self.text(SYSTEM).render(context))
        system = "\n".join(part for part in (about, fixed) if part)
        return (*((Message("system", system),) if system else ()), Message("user", user))


def _chosen(settings: PromptSettings, name: str) -> PromptText:
    file = Path(given) if (given := getattr(settings, name, "")) else None
    if file is None and settings.folder:
        there = Path(settings.folder) / (name + SUFFIX)
        file = there if there.exists() else None
    return built_in(name) if file is None else read_prompt(name, file)
