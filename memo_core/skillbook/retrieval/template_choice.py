"""The templates that a prompt has room for: those nearly as like the subtask as the best, without near-duplicates."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from memo_core.skillbook.retrieval.result import RetrievedEntry
from memo_core.skillbook.retrieval.settings import RetrievalSettings


def with_room(ranked: Sequence[RetrievedEntry], settings: RetrievalSettings) -> list[RetrievedEntry]:
    """Templates for one prompt.

    Args:
        ranked: templates, best first.
        settings: ``template_characters`` bounds their length together, ``reach`` their distance from the best score.

    Returns:
        The best template, however long it is, and the others within both bounds; of templates whose code differs in
        names, docstring and constants only, the best one. All of them if there is no bound on characters.
    """
    if not settings.template_characters or not ranked:
        return list(ranked)
    chosen: list[RetrievedEntry] = []
    shapes: set[str] = set()
    room = settings.template_characters
    for one in ranked:
        shape = shape_of(one.text)
        near = one.score >= ranked[0].score - settings.reach
        if chosen and (shape in shapes or not near or len(one.text) > room):
            continue
        chosen.append(one)
        shapes.add(shape)
        room -= len(one.text)
    return chosen


def shape_of(code: str) -> str:
    """A template's syntax tree without the function's name, its docstring and the values of constants; code that cannot
    be parsed is its own shape."""
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return code
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if ast.get_docstring(node) is not None:
                node.body = node.body[1:]
            if node in tree.body:
                node.name = ""
        elif isinstance(node, ast.Constant):
            node.value = type(node.value).__name__
    return ast.dump(tree)
