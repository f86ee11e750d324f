"""Rewrites of the syntax tree that let the interpreter run more of Python; lines in errors stay those of the model.

The most important case is a silent difference: the interpreter evaluates a generator expression at once, so
``any(grasp(n) for n in names)`` would continue grasping after the first success. With the rewrite, ``any``, ``all`` and
``next`` evaluate item by item.
"""

from __future__ import annotations

import ast
import typing
from collections import deque

import attrs

from memo_core.sandbox.modules import MODULES
from memo_core.sandbox.subset import bound_names

_LAZY = {"any": "_memo_any", "all": "_memo_all", "next": "_memo_next"}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "less",
    ast.LtE: "less_equal",
    ast.Gt: "greater",
    ast.GtE: "greater_equal",
}
_KINDS = frozenset(("str", "list", "dict", "set", "tuple"))
_METHODS = frozenset(
    name for kind in (str, list, dict, set, tuple) for name in dir(kind) if not name.startswith("_")
) - {"fromkeys", "maketrans"}
_GENERICS = frozenset(MODULES["typing"]) | {"list", "tuple", "dict", "set", "frozenset", "type"}


@attrs.frozen
class Rewritten:
    """``source`` for the interpreter; ``lines`` pairs lines of it with those of the original, in ascending order, and
    is empty where they are the same."""

    source: str
    lines: tuple[tuple[int, int], ...] = ()


def rewrite(code: str, tree: ast.Module, arrays: bool) -> Rewritten:
    """The code in the form that the interpreter can run. ``tree`` is modified; ``arrays``: whether the code uses numpy.
    Raises ``ValueError`` and ``RecursionError`` if Python cannot unparse the modified tree.
    """
    visitor = _Rewriter(arrays, bound_names(tree))
    changed = ast.fix_missing_locations(visitor.visit(tree))
    if not visitor.changed:
        return Rewritten(code)
    source = ast.unparse(changed)
    lines: dict[int, int] = {}
    _pair_lines(ast.parse(source), changed, lines)
    return Rewritten(source, tuple(sorted(lines.items())))


def _pair_lines(new: ast.AST, old: ast.AST, lines: dict[int, int]) -> None:
    """Line of the new source -> line of the old, along two trees of the same shape."""
    pairs = deque([(new, old)])
    while pairs:
        a, b = pairs.popleft()
        if type(a) is not type(b):
            continue
        if hasattr(a, "lineno") and hasattr(b, "lineno"):
            lines.setdefault(a.lineno, b.lineno)
        pairs.extend(zip(ast.iter_child_nodes(a), ast.iter_child_nodes(b), strict=False))


class _Rewriter(ast.NodeTransformer):
    def __init__(self, arrays: bool, own: set[str]) -> None:
        self.changed = False
        self._arrays = arrays
        self._own = own

    def _replace(self, old: ast.AST, text: str, **holes: ast.expr) -> ast.expr:
        """An expression written as text, with the names in ``holes`` standing for nodes of the old tree."""
        self.changed = True
        template = ast.parse(text, mode="eval").body
        for node in ast.walk(template):
            ast.copy_location(node, old)
        return typing.cast(ast.expr, _Fill(holes).visit(template))

    # -- imports -------------------------------------------------------------------------------------------------------
    def visit_Import(self, node: ast.Import) -> typing.Any:
        kept = [a for a in node.names if a.name.split(".")[0] != "numpy"]
        if len(kept) == len(node.names):
            return node
        self.changed = True
        statements: list[ast.stmt] = [ast.copy_location(ast.Import(kept), node)] if kept else []
        for alias in node.names:
            if alias not in kept:
                owner = alias.name if alias.asname else "numpy"
                statements.append(_assignment(node, alias.asname or "numpy", f"_memo_{owner}"))
        return statements

    def visit_ImportFrom(self, node: ast.ImportFrom) -> typing.Any:
        module, star = node.module or "", any(a.name == "*" for a in node.names)
        if module == "__future__":
            self.changed = True
            return ast.copy_location(ast.Pass(), node)
        if module.split(".")[0] == "numpy":
            self.changed = True
            names = [ast.alias(name) for name in MODULES[module]] if star else node.names
            return [_assignment(node, a.asname or a.name, f"_memo_{module}.{a.name}") for a in names]
        if star:
            self.changed = True
            return ast.copy_location(ast.ImportFrom(module, [ast.alias(n) for n in MODULES[module]], 0), node)
        return node

    # -- statements ----------------------------------------------------------------------------------------------------
    def visit_Delete(self, node: ast.Delete) -> typing.Any:
        """``del items[key]`` as ``items.pop(key)``; the checks let no other del through."""
        self.generic_visit(node)
        target = node.targets[0]
        assert isinstance(target, ast.Subscript)
        return ast.copy_location(
            ast.Expr(self._replace(node, "owner.pop(key)", owner=target.value, key=target.slice)), node
        )

    def visit_Expr(self, node: ast.Expr) -> typing.Any:
        """``items.sort(key=f)``: the interpreter's own cannot call a skill from f."""
        self.generic_visit(node)
        call = node.value
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "sort"):
            return node
        if call.args or not any(k.arg == "key" for k in call.keywords):
            return node
        sort = self._replace(call, "_memo_sort(items)", items=call.func.value)
        assert isinstance(sort, ast.Call)
        sort.keywords = call.keywords
        return ast.copy_location(ast.Expr(sort), node)

    # -- expressions ---------------------------------------------------------------------------------------------------
    def visit_Attribute(self, node: ast.Attribute) -> typing.Any:
        self.generic_visit(node)
        if not isinstance(node.ctx, ast.Load):
            return node
        if node.attr == "T" and self._arrays:
            return self._replace(node, "owner.transpose()", owner=node.value)
        if node.attr == "__name__":
            return self._replace(node, "_memo_name(owner)", owner=node.value)
        if node.attr in _METHODS and isinstance(node.value, ast.Name) and node.value.id in _KINDS - self._own:
            return self._replace(node, f"lambda owner, *a, **k: owner.{node.attr}(*a, **k)")
        if node.attr in _METHODS and not hasattr(node, "memo_called"):
            # The owner stands here once: written twice, a chain of n methods would double n times.
            get, call = f"lambda o: o.{node.attr}", f"lambda o, *a, **k: o.{node.attr}(*a, **k)"
            call = f"_memo_method(owner, {get}, {call})"
            return self._replace(node, call, owner=node.value)
        return node

    def visit_Subscript(self, node: ast.Subscript) -> typing.Any:
        """``Tuple[float, float]`` as a value: only its bare name exists."""
        self.generic_visit(node)
        if isinstance(node.ctx, ast.Load) and isinstance(node.value, ast.Name) and node.value.id in _GENERICS:
            self.changed = True
            return node.value
        return node

    def visit_Compare(self, node: ast.Compare) -> typing.Any:
        self.generic_visit(node)
        function = _COMPARISONS.get(type(node.ops[0])) if self._arrays and len(node.ops) == 1 else None
        if function is None:
            return node
        return self._replace(node, f"_memo_{function}(left, right)", left=node.left, right=node.comparators[0])

    def visit_Call(self, node: ast.Call) -> typing.Any:
        if isinstance(node.func, ast.Attribute):
            node.func.memo_called = True  # type: ignore[attr-defined]
        lazy = self._lazy_call(node)
        if lazy is not None:
            return self.visit(lazy)
        return self.generic_visit(node)

    def _lazy_call(self, node: ast.Call) -> ast.expr | None:
        if not (isinstance(node.func, ast.Name) and node.func.id in _LAZY and node.args and not node.keywords):
            return None
        generator = node.args[0]
        if not isinstance(generator, ast.GeneratorExp) or node.func.id in self._own:
            return None
        if any(isinstance(inner, ast.NamedExpr) for inner in ast.walk(generator)):
            return None  # what it binds would be lost in a lambda
        first = generator.generators[0]
        items = ast.copy_location(ast.ListComp(generator.elt, list(generator.generators)), generator)
        one = ast.copy_location(ast.List([ast.Name("_memo_item", ast.Load())], ast.Load()), first.iter)
        items.generators[0] = ast.comprehension(first.target, one, first.ifs, 0)
        call = self._replace(
            node, f"{_LAZY[node.func.id]}(lambda _memo_item: items, iterable)", items=items, iterable=first.iter
        )
        assert isinstance(call, ast.Call)
        call.args += node.args[1:]
        return call

    def visit_GeneratorExp(self, node: ast.GeneratorExp) -> typing.Any:
        """Elsewhere it becomes an iterator over what it yields, evaluated at once."""
        self.generic_visit(node)
        self.changed = True
        items = ast.copy_location(ast.ListComp(node.elt, node.generators), node)
        return self._replace(node, "_memo_iter(items)", items=items)


class _Fill(ast.NodeTransformer):
    def __init__(self, holes: dict[str, ast.expr]) -> None:
        self._holes = holes

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self._holes.get(node.id, node)


def _assignment(node: ast.stmt, name: str, value: str) -> ast.stmt:
    statement = ast.parse(f"{name} = {value}").body[0]
    for inner in ast.walk(statement):
        ast.copy_location(inner, node)
    return statement
