"""From a model's answer to what was asked for: one reader a phase. Tolerant of fences, prose and bullets around the
answer; strict about the answer itself. ``Unreadable`` says precisely what was wrong, so that it can be asked again."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from typing import Any

import attrs

from memo_core.errors import MemoError
from memo_core.skillbook.keys import Key, NotAKey

MAX_NOTE = 400  # characters; a longer note is a story, not an instruction
MAX_NOTES = 12
MAX_CODE = 40_000

_FENCE = re.compile(r"```[ \t]*([\w+-]*)[^\n]*\n(.*?)(?:```|\Z)", re.DOTALL)
_DONE = re.compile(r"done(\(\s*\))?[.!]?", re.IGNORECASE)
_SUBTASK = re.compile(r"[A-Za-z][A-Za-z_]*(?:[ -][A-Za-z_]+){0,3}\s*\([^()\n]+\)")
_COORDINATES = re.compile(r"[\[(]\s*-?\d+(?:\.\d+)?\s*(?:,\s*-?\d+(?:\.\d+)?\s*){1,}[\])]")


@attrs.define(auto_exc=True, eq=False)
class Unreadable(MemoError):
    """An answer that is not what was asked for. ``problem`` is put to the model when it is asked again."""

    phase: str
    problem: str
    text: str = ""

    def __str__(self) -> str:
        return f"the answer of phase {self.phase!r} cannot be used: {self.problem}"


@attrs.frozen
class Notes:
    """What phase 3 made of what a person said."""

    corrections: tuple[str, ...]
    general: tuple[str, ...]


def read_plan(text: str) -> Key | None:
    """The next subtask, or None for DONE. Raises ``Unreadable``."""
    lines = [_bare_line(line) for line in text.splitlines() if not line.strip().startswith("```")]
    lines = [line for line in lines if line]
    problem = "it names no subtask"
    for line in lines:
        if _DONE.fullmatch(line):
            return None
        match = _SUBTASK.fullmatch(line.rstrip(".;"))
        if match:
            try:
                return Key.parse(match.group())
            except NotAKey as error:
                problem = str(error)
    # Only where no line is an answer by itself, one within a sentence counts, the last: models think first.
    for line in reversed(lines):
        for match in reversed(list(_SUBTASK.finditer(line))):
            words = match.group()
            capitals = re.search(r"[A-Z][A-Z_]+(?:[ -][A-Z_]+)*\s*\(", words)
            try:
                return Key.parse(words[capitals.start() :] if capitals else words)
            except NotAKey as error:
                problem = str(error)
        if re.search(r"\bDONE\b", line):
            return None
    raise Unreadable("plan", f"{problem}; answer with one line, ACTION(object), ACTION(object, place) or DONE", text)


def read_code(text: str) -> str:
    """The Python code of an answer. Raises ``Unreadable`` for none, a syntax error, and for code that does nothing."""
    blocks = list(_code_blocks(text))
    if not blocks:
        raise Unreadable("code", "it holds no Python code; answer with one code block", text)
    problems = []
    for code in sorted(blocks, key=len, reverse=True):
        problem = _code_problem(code)
        if not problem:
            return code
        problems.append(problem)
    raise Unreadable("code", problems[0], text)


def read_notes(text: str) -> Notes:
    """Corrections and general statements from JSON. Raises ``Unreadable``, also for notes with coordinates."""
    found = next((value for value in _objects(text) if {"corrections", "general"} & set(value)), None)
    if found is None:
        raise Unreadable("feedback", 'it is no JSON object with the keys "corrections" and "general"', text)
    notes = Notes(_strings(found, "corrections", text), _strings(found, "general", text))
    if not notes.corrections and not notes.general:
        raise Unreadable("feedback", "both lists are empty, although the person said something", text)
    return notes


def read_template(text: str) -> str:
    """One documented function without hard-coded positions. Raises ``Unreadable``."""
    blocks = [code for code in _code_blocks(text) if not _syntax_problem(code)]
    if not blocks:
        raise Unreadable("template", "it holds no Python code that parses; answer with one code block", text)
    problems = []
    for code in sorted(blocks, key=len, reverse=True):
        problem = _template_problem(ast.parse(code))
        if not problem:
            return code
        problems.append(problem)
    raise Unreadable("template", problems[0], text)


# -- pieces -----------------------------------------------------------------------------------------------------------


def _bare_line(line: str) -> str:
    """Without bullets, numbering, emphasis and a lead-in such as ``Next subtask:``."""
    bare = re.sub(r"^\s*(?:[-*+>]|\d+[.)])\s+", "", line).strip()
    bare = re.sub(r"^(?:\**[A-Za-z ]{2,30}\**:)\s*", "", bare) if "(" not in bare.split(":")[0] else bare
    return bare.strip().strip("`*_ ").strip()


def _code_blocks(text: str) -> Iterator[str]:
    fenced = [
        body
        for tongue, body in _FENCE.findall(text)
        if tongue.lower() in ("", "python", "py", "python3") and body.strip()
    ]
    if fenced:
        yield from (_dedent(body) for body in fenced)
    elif text.strip() and not _syntax_problem(text) and _calls(ast.parse(text)):
        yield _dedent(text)


def _dedent(code: str) -> str:
    import textwrap

    return textwrap.dedent(code.replace("\r\n", "\n")).strip() + "\n"


def _syntax_problem(code: str) -> str:
    try:
        ast.parse(code)
    except SyntaxError as error:
        return f"line {error.lineno}: {error.msg}"
    except (ValueError, RecursionError, MemoryError) as error:
        return f"it does not parse: {error or type(error).__name__}"
    return ""


def _calls(tree: ast.AST) -> bool:
    return any(isinstance(node, ast.Call) for node in ast.walk(tree))


def _code_problem(code: str) -> str:
    if len(code) > MAX_CODE:
        return f"the code has {len(code)} characters; at most {MAX_CODE}"
    problem = _syntax_problem(code)
    if problem:
        return problem
    tree = ast.parse(code)
    acting = [
        node for node in tree.body if not isinstance(node, (ast.FunctionDef, ast.Import, ast.ImportFrom, ast.ClassDef))
    ]
    if not any(_calls(node) for node in acting):
        return "the code defines things but calls nothing, so nothing would happen"
    return ""


def _template_problem(tree: ast.Module) -> str:
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    others = [node for node in tree.body if not isinstance(node, (ast.FunctionDef, ast.Import, ast.ImportFrom))]
    if len(functions) != 1 or others:
        return "it must be a single function and nothing beside it"
    if not ast.get_docstring(functions[0]):
        return f"the function {functions[0].name} has no docstring"
    if not functions[0].args.args and not functions[0].args.kwonlyargs:
        return f"the function {functions[0].name} has no parameters"
    for node in ast.walk(functions[0]):
        if isinstance(node, (ast.List, ast.Tuple)) and len(node.elts) in (3, 4):
            values = [_constant(item) for item in node.elts]
            # A unit direction such as [0, 0, 1] is no place.
            if all(value is not None for value in values) and any(abs(v or 0) not in (0.0, 1.0) for v in values):
                return f"line {node.lineno}: {ast.unparse(node)} is a hard-coded position or orientation"
    return ""


def _constant(node: ast.expr) -> float | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        return _constant(node.operand)
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    return None


def _objects(text: str) -> Iterator[dict[str, Any]]:
    """Every JSON object in a text, fenced or not, outermost first."""
    decoder = json.JSONDecoder()
    at = text.find("{")
    while at >= 0:
        try:
            value, end = decoder.raw_decode(text, at)
        except (ValueError, RecursionError):
            at = text.find("{", at + 1)
            continue
        if isinstance(value, dict):
            yield value
        at = text.find("{", end)


def _strings(found: dict[str, Any], name: str, text: str) -> tuple[str, ...]:
    value = found.get(name, [])
    value = [value] if isinstance(value, str) else value
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise Unreadable("feedback", f'"{name}" must be a list of strings', text)
    notes = [" ".join(item.split()) for item in value if item.strip()]
    if len(notes) > MAX_NOTES:
        raise Unreadable("feedback", f'"{name}" has {len(notes)} notes; at most {MAX_NOTES}', text)
    for note in notes:
        if len(note) > MAX_NOTE:
            raise Unreadable("feedback", f'a note of "{name}" has {len(note)} characters; at most {MAX_NOTE}', text)
        if _COORDINATES.search(note):
            raise Unreadable("feedback", f"the note {note!r} holds coordinates, which hold only for this scene", text)
    return tuple(dict.fromkeys(notes))
