"""Phase 2's answer: Python that does a subtask."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from memo_core.llm.readers.blocks import calls_something, code_blocks, left_open, syntax_problem
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken

WANTED = "answer with one Python code block that holds the whole code"


def read_code(text: str) -> str:
    """The Python code of an answer. Of several blocks the last complete program counts (models correct themselves);
    blocks that depend on each other are joined. Raises ``Unreadable`` for a missing program, a syntax error, code with
    omissions, and code that does nothing."""
    said = spoken("code", text, WANTED)
    blocks = code_blocks(said)
    if not blocks:
        raise missing("code", "it holds no Python code", text, WANTED)
    for code in _candidates(blocks):
        if not _problem(code):
            return code
    longest = max(blocks, key=len)
    problem = _problem(longest)
    if left_open(said) and syntax_problem(longest):
        problem = f"the code breaks off ({problem}); {WANTED}, and make it shorter"
    raise Unreadable("code", problem, text)


def _candidates(blocks: Sequence[str]) -> list[str]:
    """The possible programs, best first."""
    whole = [code for code in blocks if calls_something(code)]
    by_length = sorted(whole, key=len, reverse=True)
    if any(_uses(code, blocks) for code in whole):
        return ["\n".join(blocks), *by_length]
    enough = len(by_length[0]) / 2 if by_length else 0
    return [*(code for code in reversed(whole) if len(code) >= enough), *by_length, "\n".join(blocks)]


def _uses(code: str, blocks: Sequence[str]) -> bool:
    """Whether code calls a function that only another block defines."""
    own, elsewhere = _defined(code), set[str]()
    for other in blocks:
        if other is not code:
            elsewhere |= _defined(other)
    names = {node.id for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Name)}
    return bool(names & (elsewhere - own))


def _defined(code: str) -> set[str]:
    if syntax_problem(code):
        return set()
    return {node.name for node in ast.parse(code).body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}


def _problem(code: str) -> str:
    problem = syntax_problem(code)
    if problem:
        return problem
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and node.value.value is Ellipsis:
            return f"the code leaves something out (line {node.lineno}: ...); {WANTED}"
    if not calls_something(code):
        return "the code defines things but calls nothing, so nothing would happen; call what it defines"
    return ""
