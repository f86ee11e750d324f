"""Phase 4's answer: one documented function made of code that worked."""

from __future__ import annotations

import ast

from memo_core.llm.readers.blocks import code_blocks, syntax_problem
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken
from memo_core.skillbook.model.template_rules import problem_with_template

WANTED = "answer with one Python code block that holds one function"


def read_template(text: str) -> str:
    """One documented function without hard-coded positions. Raises ``Unreadable``."""
    said = spoken("template", text, WANTED)
    blocks = code_blocks(said) or _definition(said)
    if not blocks:
        raise missing("template", "it holds no Python code", text, WANTED)
    problems = []
    for code in sorted(blocks, key=len, reverse=True):
        problem = syntax_problem(code)
        problem = f"its code does not parse: {problem}" if problem else problem_with_template(code)
        if not problem:
            return code
        problems.append(problem)
    raise Unreadable("template", problems[0], text)


def _definition(said: str) -> list[str]:
    """An answer that is nothing but a function, without a fence."""
    code = said.strip() + "\n"
    return (
        [code] if not syntax_problem(code) and any(isinstance(n, ast.FunctionDef) for n in ast.parse(code).body) else []
    )
