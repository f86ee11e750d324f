"""Reading a filled-in prompt: sections by their headings, the scene's table, entries and code blocks.

Replay compares situations with it; a backend that answers by rules needs nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_core.errors import MemoError
from memo_core.interfaces.llm import Message
from memo_core.scene.graph import SceneGraph
from memo_core.scene.scene_table import NotASceneTable, read_scene_table

PHASE_TITLES = {  # words of a prompt's title, phase
    "condense": "cluster",
    "generalise": "generalise",
    "merge": "merge",
    "plan": "plan",
    "write": "code",
    "code": "code",
    "note": "feedback",
    "taught": "feedback",
    "template": "template",
}


@attrs.define(auto_exc=True, eq=False)
class UnreadablePrompt(MemoError):
    """A prompt that lacks something: ``problem`` names it."""

    problem: str

    def __str__(self) -> str:
        return self.problem


@attrs.frozen
class PromptEntry:
    """One line of a person's guidance, or one template, with the key it was stored under ("" for general). ``hint``:
    the prompt says that it is only one, it may be about something else."""

    text: str
    key: str = ""
    hint: bool = False


@attrs.frozen
class Corrected:
    """One attempt that was found fault with: the person's words, the notes made of them, and the code ("" where the
    prompt shows none)."""

    words: str
    notes: list[PromptEntry]
    code: str = ""


@attrs.frozen(eq=False)
class Prompt:
    """A prompt taken apart. ``sections`` maps a heading in lower case to the text below it."""

    title: str
    sections: dict[str, str]

    @classmethod
    def read(cls, messages: Iterable[Message]) -> Prompt:
        """Take a request's messages apart.

        Args:
            messages: messages of a request; those of the assistant are ignored.

        Returns:
            The title and the text under each heading.

        Raises:
            UnreadablePrompt: if no system or user message has a title (``# ...``).
        """
        text = "\n".join(message.text for message in messages if message.role != "assistant")
        title, sections, heading, fenced = "", {}, "", False
        body: list[str] = []
        for line in text.splitlines():
            if line.strip().startswith("```"):
                fenced = not fenced
            match = None if fenced else re.match(r"(#{1,2}) +(.+?)\s*$", line)
            if match is None:
                body.append(line)
                continue
            sections[heading] = "\n".join(body).strip("\n")
            body, heading = [], match.group(2).strip().lower()
            if match.group(1) == "#" and not title:
                title = heading
        sections[heading] = "\n".join(body).strip("\n")
        if not title:
            raise UnreadablePrompt("the prompt has no title ('# ...')")
        return cls(title, sections)

    @property
    def phase(self) -> str:
        """The phase (one of ``PHASE_TITLES``), by the title's words. Raises ``UnreadablePrompt``."""
        words = re.findall(r"[a-z]+", self.title)
        # "Turn code that worked into a template" also says code: the last telling word decides.
        found = [PHASE_TITLES[word] for word in words if word in PHASE_TITLES]
        if "template" in found:
            return "template"
        if found:
            return found[0]
        raise UnreadablePrompt(f"cannot tell from the title {self.title!r} what is asked for")

    def section(self, *words: str) -> str:
        """Text under a heading.

        Args:
            words: beginnings of the heading, in lower case; the first that matches is used.

        Returns:
            The section's text.

        Raises:
            UnreadablePrompt: if no heading matches; names the section.
        """
        for word in words:
            for heading, text in self.sections.items():
                if heading.startswith(word):
                    return text.strip()
        raise UnreadablePrompt(f"the prompt has no section '## {words[0].capitalize()}'")

    @property
    def task(self) -> str:
        return self.section("task")

    @property
    def subtask(self) -> tuple[str, tuple[str, ...]]:
        """(action in lower case with spaces, the objects named)."""
        return read_subtask(self.section("subtask"))

    def bullets(self, *words: str) -> list[str]:
        """Items of a section's bullet list, without ``none`` and ``nothing``; ``words`` as in ``section``."""
        lines = [line[2:].strip() for line in self.section(*words).splitlines() if line.startswith("- ")]
        return [line for line in lines if line.lower() not in ("none", "nothing")]

    def quoted(self, *words: str) -> str:
        """Text of a section without quotation marks (``>``); ``words`` and errors as in ``section``."""
        return "\n".join(re.sub(r"^> ?", "", line) for line in self.section(*words).splitlines()).strip()

    def entries(self, *words: str) -> list[PromptEntry]:
        """Bulleted entries of a section with their keys, best first.

        Args:
            words: beginnings of the heading, as in ``section``.

        Returns:
            The entries; ``hint`` is set for those with the remark "only a hint" in the line below.

        Raises:
            UnreadablePrompt: if there is no such section.
        """
        found: list[PromptEntry] = []
        for line in self.section(*words).splitlines():
            if line.startswith("- ") and line[2:].strip().lower() not in ("none", "nothing"):
                found.append(_entry(line[2:].strip()))
            elif found and re.fullmatch(r" +\(.*\bonly a hint\)", line):
                found[-1] = attrs.evolve(found[-1], hint=True)
        return found

    def templates(self) -> list[PromptEntry]:
        """Code blocks with the key written above each."""
        text = self.section("templates")
        blocks = re.finditer(r"(?:^\[([^\]\n]*)\][ \t]*\n)?^```(?:python)?[ \t]*\n(.*?)^```", text, re.S | re.M)
        return [PromptEntry(block.group(2).strip("\n"), block.group(1) or "") for block in blocks]

    def code(self, *words: str) -> str:
        """First code block of a section (Python, if one is marked so); ``words`` as in ``section``. Raises
        ``UnreadablePrompt`` if there is none.
        """
        return self._codes(*words)[0]

    def last_code(self, *words: str) -> str:
        """Last code block of a section (Python, if one is marked so); ``words`` as in ``section``. Raises
        ``UnreadablePrompt`` if there is none.
        """
        return self._codes(*words)[-1]

    def _codes(self, *words: str) -> list[str]:
        blocks = re.findall(r"^```(\w*)[ \t]*\n(.*?)^```", self.section(*words) + "\n", re.S | re.M)
        codes = [code.rstrip("\n") for language, code in blocks if language in ("", "python")]
        python = [code.rstrip("\n") for language, code in blocks if language == "python"]
        if not codes:
            raise UnreadablePrompt(f"the section '## {words[0].capitalize()}' has no code block")
        return python or codes

    def corrected(self) -> list[Corrected]:
        """The attempts of this run that a person found fault with, newest first."""
        blocks: list[list[str]] = []
        fenced = False
        for line in self.sections.get("just corrected", "").splitlines():
            fenced ^= line.startswith("```")
            if line.startswith("### ") and not fenced:
                blocks.append([])
            elif blocks:
                blocks[-1].append(line)
        return [_corrected("\n".join(block)) for block in reversed(blocks)]

    def attempts(self) -> int:
        """How many attempts at this subtask the prompt shows from which nothing was noted that could be followed."""
        ended = sum(line.startswith("### ") for line in self._earlier().splitlines())
        return ended + sum(not one.notes for one in self.corrected())

    def _earlier(self) -> str:
        """What the prompt shows of earlier attempts, a line break after each section."""
        return "".join(f"{text}\n" for heading, text in self.sections.items() if heading.startswith("earlier attempts"))

    def tried(self) -> list[str]:
        """The code of the attempts at this subtask that the prompt shows, without blank lines around it."""
        return [code.strip() for code in re.findall(r"^```python[ \t]*\n(.*?)^```", self._earlier(), re.S | re.M)]

    def scene(self) -> SceneGraph:
        """The scene as far as its table and sentences tell. Raises ``UnreadablePrompt``."""
        try:
            return read_scene_table(self.section("scene"))
        except NotASceneTable as error:
            raise UnreadablePrompt(str(error)) from None


def read_subtask(text: str) -> tuple[str, tuple[str, ...]]:
    """Read the first subtask in a text, such as ``PICK_UP(cup)``.

    Args:
        text: text that contains ``ACTION(object, …)``.

    Returns:
        Action in lower case with spaces, and the objects' names, as in ``("pick up", ("cup",))``.

    Raises:
        UnreadablePrompt: if the text contains no subtask.
    """
    match = re.search(r"([A-Za-z][\w -]*?)\s*\(([^()]*)\)", text)
    if match is None:
        raise UnreadablePrompt(f"{text.strip()!r} is no subtask of the form ACTION(object)")
    action = " ".join(match.group(1).lower().replace("_", " ").split())
    return action, tuple(name.strip() for name in match.group(2).split(",") if name.strip())


def _entry(line: str) -> PromptEntry:
    match = re.match(r"\[([^\]]*)\]\s*(.*)", line, re.S)
    return PromptEntry(match.group(2), match.group(1)) if match else PromptEntry(line)


def _outside_fences(text: str) -> str:
    """Without code blocks: what a program printed is no note."""
    return re.sub(r"^```.*?^```[^\n]*$", "", text, flags=re.S | re.M)


def _corrected(block: str) -> Corrected:
    code = re.search(r"^```python[ \t]*\n(.*?)^```", block, re.S | re.M)
    lines = _outside_fences(block).splitlines()
    words = "\n".join(line[2:] for line in lines if line.startswith("> "))
    notes = [_entry(line[2:].strip()) for line in lines if line.startswith("- ")]
    return Corrected(
        words,
        [note for note in notes if note.text != "nothing"],
        code.group(1) if code else "",
    )
