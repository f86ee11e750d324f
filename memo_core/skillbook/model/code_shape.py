"""The shape of a program: what it calls and in which order, without the names and numbers that it chose."""

from __future__ import annotations

import ast
from functools import lru_cache


@lru_cache(maxsize=1000)
def code_shape(code: str) -> str:
    """Text that is equal for programs that differ only in the names that they bind themselves, docstrings, annotations,
    constants and defaults. The names of skills count. Code that cannot be parsed is compared word by word."""
    try:
        tree = ast.parse(code)
        return ast.dump(_Plain(_bound(tree)).visit(tree))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return " ".join(code.split())


def _bound(tree: ast.AST) -> dict[str, str]:
    """A number for every name that the code binds, in the order of the tree, which does not depend on names."""
    names = [
        node.arg if isinstance(node, ast.arg) else node.name if isinstance(node, ast.FunctionDef) else node.id
        for node in ast.walk(tree)
        if isinstance(node, (ast.arg, ast.FunctionDef))
        or (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))
    ]
    return {name: str(number) for number, name in enumerate(dict.fromkeys(names))}


class _Plain(ast.NodeTransformer):
    def __init__(self, bound: dict[str, str]) -> None:
        self._bound = bound

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
        node.name, node.returns = self._bound[node.name], None
        node.args.defaults, node.args.kw_defaults = [], []
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        return ast.arg(self._bound[node.arg])

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return ast.Name(self._bound.get(node.id, node.id), node.ctx)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        plain = self.generic_visit(node)
        negated = isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant)
        return node.operand if negated else plain

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant(0)
