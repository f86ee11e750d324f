"""Finding code in a model's answer: fenced, unfenced, between prose, in several blocks."""

from __future__ import annotations

import ast
import re
import textwrap
import unicodedata
from collections.abc import Iterator, Sequence

from memo_core.text.reading_limits import LONGEST_CODE

PYTHON = ("", "python", "py", "python3", "python2", "tool_code", "robot", "monty")
MOST_PARAGRAPHS = 40  # of an answer without a fence
MOST_BLOCKS = 40  # of one with fences; the last count
MOST_ACCENTS = 30  # combining characters in a row

_FENCE = re.compile(
    r"^(?P<indent>[ \t>]*+)(?P<fence>`{3,}+|~{3,}+)[ \t]*+(?P<tongue>[\w+-]*+)[^\n]*+\n(?P<body>.*?)"
    r"(?:^[ \t>]*(?P=fence)[`~]*[ \t]*$|(?P<open>\Z))",
    re.DOTALL | re.MULTILINE,
)


def code_blocks(text: str) -> list[str]:
    """The Python blocks of an answer, in order: blocks fenced as Python or without a language; otherwise any fenced
    block that parses; otherwise unfenced code between prose. Every line is a line of the answer."""
    fences = [(match["tongue"].lower(), match["body"]) for match in _FENCE.finditer(text)]
    blocks = [_bare(body) for tongue, body in fences if tongue in PYTHON]
    blocks = [block for block in blocks if block.strip()]
    if not blocks:
        others = [_bare(body) for _, body in fences]
        blocks = [block for block in others if calls_something(block)]
    if not blocks and len(text) <= LONGEST_CODE:
        blocks = list(_unfenced(text))
    return blocks[-MOST_BLOCKS:]


def outside_code(text: str) -> str:
    """An answer without its Python blocks. A block without a language that begins with a brace is JSON, and stays."""
    return _FENCE.sub(lambda match: match[0] if _is_data(match) else "\n", text)


def _is_data(fence: re.Match[str]) -> bool:
    tongue = fence["tongue"].lower()
    return tongue not in PYTHON or (not tongue and fence["body"].lstrip().startswith("{"))


def left_open(text: str) -> bool:
    """Whether the last fence of an answer is never closed."""
    return any(match["open"] is not None for match in _FENCE.finditer(text))


def syntax_problem(code: str) -> str:
    """The place and the reason why code does not parse, or that it is too long; "" if it parses."""
    if len(code) > LONGEST_CODE:
        return f"the code has {len(code)} characters; at most {LONGEST_CODE}"
    if _stacks_accents(code):
        return f"more than {MOST_ACCENTS} accents stand on one character"
    try:
        ast.parse(code)
    except SyntaxError as error:
        lines = code.splitlines()
        line = lines[error.lineno - 1].strip() if error.lineno and error.lineno <= len(lines) else ""
        told = f"line {error.lineno}: {error.msg}" + (f", in `{line[:80]}`" if line else "")
        return told + ("; use straight quotes" if re.search("[\u2018\u2019\u201c\u201d]", line) else "")
    except (ValueError, RecursionError, MemoryError) as error:
        return f"it does not parse: {error or type(error).__name__}"
    return ""


def _stacks_accents(code: str) -> bool:
    """Whether a character carries so many accents that Python would take the square of their number to parse it."""
    row = 0
    for character in "" if code.isascii() else code:
        row = row + 1 if unicodedata.combining(character) else 0
        if row > MOST_ACCENTS:
            return True
    return False


def calls_something(code: str) -> bool:
    """Whether code parses and calls something when it runs, rather than only defining functions."""
    if syntax_problem(code):
        return False
    return any(_has_call(node) for node in acting(ast.parse(code)))


def acting(tree: ast.Module) -> list[ast.stmt]:
    """The statements that do something when the code runs."""
    passive = (ast.FunctionDef, ast.Import, ast.ImportFrom, ast.ClassDef)
    return [node for node in tree.body if not isinstance(node, passive)]


def _has_call(tree: ast.AST) -> bool:
    return any(isinstance(node, ast.Call) for node in ast.walk(tree))


def _bare(code: str) -> str:
    """A block without quotation marks, indentation and labels; lines lose only text before and after them."""
    lines = code.split("\n")
    marked = [line for line in lines if line.strip()]
    for mark in (r"> ?", r"(?:>>>|\.\.\.)(?: |$)"):
        if marked and all(re.match(rf"\s*{mark}", line) for line in marked):
            lines = [re.sub(rf"^\s*{mark}", "", line) for line in lines]
            marked = [line for line in lines if line.strip()]
    if marked and marked[0].strip().lower() in PYTHON[1:]:
        lines = lines[lines.index(marked[0]) + 1 :]
    return textwrap.dedent("\n".join(line.rstrip() for line in lines)).strip("\n") + "\n"


def _unfenced(text: str) -> Iterator[str]:
    """The longest run of paragraphs that is Python and does something, if there is one."""
    plain = text.strip().strip("`")
    paragraphs: list[str] = re.split(r"(?:\n[ \t]*)+\n", plain)
    if len(paragraphs) > MOST_PARAGRAPHS:
        paragraphs = [plain]
    spans = [(i, j) for i in range(len(paragraphs)) for j in range(i + 1, len(paragraphs) + 1)]
    for i, j in sorted(spans, key=lambda span: span[0] - span[1]):
        code = _bare(_joined(plain, paragraphs, i, j))
        if calls_something(code):
            yield code
            return


def _joined(text: str, paragraphs: Sequence[str], first: int, last: int) -> str:
    """Paragraphs with the blank lines between them."""
    at, start, end = 0, 0, 0
    for number, paragraph in enumerate(paragraphs[:last]):
        at = text.index(paragraph, at)
        start = at if number == first else start
        at += len(paragraph)
        end = at
    return text[start:end]
