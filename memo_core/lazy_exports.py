"""Exports of a package that are imported when they are first used.

A package names what it exports once, where type checkers and editors look, and importing it stays quick::

    if TYPE_CHECKING:
        from memo_core.scene.pose import Pose as Pose

    __all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
"""

import ast
import importlib
import sys

TYPE_CHECKING = False  # importing typing would take longer than everything else here
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def lazy_exports(module: str, file: str) -> "tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]":
    """The ``__all__``, ``__getattr__`` and ``__dir__`` of a module.

    Args:
        module: the module's ``__name__``.
        file: its ``__file__``; the exports are the imports in its ``if TYPE_CHECKING:`` block.
    """
    with open(file, encoding="utf-8") as source:
        body = ast.parse(source.read()).body
    homes = {
        alias.name: str(statement.module)
        for block in body
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
        if alias.asname == alias.name
    }

    def get(name: str) -> "Any":
        if name not in homes:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(sys.modules[module], name, value)
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[module]), *homes})

    return sorted(homes), get, names
