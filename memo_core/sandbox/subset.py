"""The subset of Python that works, checked before anything moves.

This runs in the process of ``check_worker``, never in MEMO's own, because its work depends on hostile source.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator
from itertools import chain, islice

import attrs

from memo_core.errors import close_match
from memo_core.sandbox.modules import BUILTINS, MODULES, REFUSED


@attrs.frozen
class Finding:
    """Something that will not work: its line (from 1), what it is, and a suggestion."""

    line: int
    problem: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"line {self.line}: {self.problem}" + (f"; {self.remedy}" if self.remedy else "")


@attrs.frozen
class SkillShape:
    """What the check knows about a skill: its name, its arguments, the required ones, and the signature to show."""

    name: str
    parameters: tuple[str, ...]
    required: tuple[str, ...]
    signature: str


_UNSUPPORTED: dict[type[ast.AST], tuple[str, str]] = {
    ast.Yield: ("generators (yield) are not available", "build a list and return it"),
    ast.YieldFrom: ("generators (yield) are not available", "build a list and return it"),
    ast.AsyncFunctionDef: ("async functions are not available", "write a plain function: skills return when done"),
    ast.Await: ("await is not available", "call the skill directly: it returns when it is done"),
    ast.AsyncFor: ("async for is not available", "use a plain loop"),
    ast.AsyncWith: ("async with is not available", "use plain statements"),
    ast.TryStar: ("except* is not available", "use except"),
}


# the interpreter accepts these methods but never calls them
_IGNORED_METHODS = frozenset(("__len__", "__bool__", "__lt__", "__le__", "__gt__", "__ge__", "__format__", "__new__",
    "__getattr__", "__getattribute__", "__setattr__", "__delattr__", "__delitem__", "__reversed__", "__del__",
    "__class_getitem__", "__init_subclass__", "__iadd__", "__isub__", "__imul__", "__itruediv__"))  # fmt: skip
_MOST_FINDINGS = 30  # looking for close matches of thousands of hostile names would take minutes
_MOST_CANDIDATES = 500


def check(tree: ast.Module, skills: dict[str, SkillShape]) -> list[Finding]:
    """The findings, in the order of lines."""
    every = chain(
        _unsupported(tree), _imports(tree), _module_attributes(tree), _names(tree, skills), _skill_calls(tree, skills)
    )
    return sorted(islice(every, _MOST_FINDINGS), key=lambda finding: finding.line)


def uses_arrays(tree: ast.Module) -> bool:
    """Whether the code imports numpy or uses ``np`` as if it had."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and any(a.name.split(".")[0] == "numpy" for a in node.names):
            return True
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "numpy":
            return True
        if isinstance(node, ast.Name) and node.id == "np":
            return True
    return False


# -- checks ----------------------------------------------------------------------------------------------------------


def _unsupported(tree: ast.Module) -> Iterator[Finding]:
    for node in ast.walk(tree):
        if type(node) in _UNSUPPORTED:
            yield Finding(node.lineno, *_UNSUPPORTED[type(node)])  # type: ignore[attr-defined]
        elif isinstance(node, ast.comprehension) and node.is_async:
            yield Finding(node.target.lineno, "async comprehensions are not available", "use a plain one")
        elif isinstance(node, ast.ClassDef):
            yield from _class(node)
        elif isinstance(node, ast.Delete) and not _removable(node):
            yield Finding(node.lineno, "del works on one item of a list or dict only", "write del items[key]")
        elif isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and len(node.exc.args) > 1:
            yield Finding(node.lineno, "an exception takes one argument here", "put the values into one f-string")
        elif isinstance(node, ast.Attribute) and _is_dunder(node.attr) and node.attr not in ("__name__", "__doc__"):
            yield Finding(node.lineno, f"the attribute {node.attr!r} is not available")


def _class(node: ast.ClassDef) -> Iterator[Finding]:
    bases = [ast.unparse(base) for base in node.bases]
    if any(base.endswith(("Exception", "Error")) for base in bases):
        yield Finding(node.lineno, "exception classes cannot be defined", "raise RuntimeError('...') and catch that")
    elif bases != ["object"] and (node.bases or node.keywords):
        yield Finding(node.lineno, "classes cannot inherit", "use a dataclass, a namedtuple or plain functions")
    for item in node.body:
        if not isinstance(item, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        if item.name in _IGNORED_METHODS:
            yield Finding(item.lineno, f"{item.name} would have no effect here", "write a method with a plain name")
        if item.decorator_list:
            shown = ast.unparse(item.decorator_list[0])
            yield Finding(item.lineno, f"methods cannot be decorated (@{shown})", "write a plain method or a function")


def _imports(tree: ast.Module) -> Iterator[Finding]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name not in MODULES:
                    yield _no_module(node.lineno, alias.name)
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            if node.level or module not in MODULES:
                yield _no_module(node.lineno, "." * node.level + module)
                continue
            for alias in node.names:
                name = alias.name
                if name != "*" and name not in MODULES[module] and f"{module}.{name}" not in MODULES:
                    yield _no_member(node.lineno, module, name)


def _no_module(line: int, name: str) -> Finding:
    offered = ", ".join(m for m in MODULES if m not in ("__future__", "numpy.linalg"))
    return Finding(line, f"module {name!r} is not available in robot code", f"there are: {offered}")


def _no_member(line: int, module: str, name: str) -> Finding:
    return Finding(line, f"{module} has no {name!r} in robot code{close_match(name, MODULES[module])}")


def _module_attributes(tree: ast.Module) -> Iterator[Finding]:
    """Findings for ``np.foo`` if the module, under the name it was imported by, has no foo."""
    aliases = {"np": "numpy"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            aliases.update({a.asname or a.name: a.name for a in node.names if a.name in MODULES})
        elif isinstance(node, ast.ImportFrom) and node.module == "numpy":
            aliases.update({a.asname or a.name: "numpy.linalg" for a in node.names if a.name == "linalg"})
    rebound = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        owner = _module_path(node.value)
        head = owner.split(".")[0]
        module = aliases.get(owner) or (f"{aliases[head]}.{owner.partition('.')[2]}" if head in aliases else "")
        if module not in MODULES or head in rebound or f"{module}.{node.attr}" in MODULES:
            continue
        if node.attr not in MODULES[module] and not _is_dunder(node.attr):
            yield _no_member(node.lineno, module, node.attr)


def _module_path(node: ast.expr) -> str:
    """``np`` or ``np.linalg`` as text, "" for anything longer: no module is nested deeper, and this avoids quadratic
    work on long attribute chains."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return ""


def _names(tree: ast.Module, skills: dict[str, SkillShape]) -> Iterator[Finding]:
    bound = bound_names(tree)
    known = bound | BUILTINS | skills.keys() | {"np", "math", "time"}
    reported = set()
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)):
            continue
        name = node.id
        if name in known or name in reported:
            continue
        reported.add(name)
        if name in REFUSED:
            yield Finding(node.lineno, f"{name!r} is not available in robot code", REFUSED[name])
        elif hasattr(builtins, name):
            yield Finding(node.lineno, f"{name!r} is not available in robot code")
        else:
            candidates = [*sorted(bound)[:_MOST_CANDIDATES], *skills, *BUILTINS]
            yield Finding(node.lineno, f"unknown name {name[:100]!r}{close_match(name[:100], candidates)}")


def bound_names(tree: ast.Module) -> set[str]:
    """All names that the code binds."""
    bound: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
            bound.add(node.id)
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            bound.add(node.name)
        elif isinstance(node, ast.arg):
            bound.add(node.arg)
        elif isinstance(node, ast.alias):
            bound.add((node.asname or node.name).split(".")[0])
        elif isinstance(node, (ast.ExceptHandler, ast.MatchAs, ast.MatchStar)) and node.name:
            bound.add(node.name)
        elif isinstance(node, ast.MatchMapping) and node.rest:
            bound.add(node.rest)
        if isinstance(node, ast.ImportFrom) and any(a.name == "*" for a in node.names):
            bound.update(MODULES.get(node.module or "", ()))
    return bound


def _skill_calls(tree: ast.Module, skills: dict[str, SkillShape]) -> Iterator[Finding]:
    own = bound_names(tree)
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)) or node.func.id in own:
            continue
        if skill := skills.get(node.func.id):
            yield from _skill_call(node, skill)


def _skill_call(node: ast.Call, skill: SkillShape) -> Iterator[Finding]:
    names = list(skill.parameters)
    keywords = [k.arg for k in node.keywords if k.arg is not None]
    for keyword in keywords:
        if keyword not in names:
            problem = f"{skill.name} has no argument {keyword!r}{close_match(keyword, names)}"
            yield Finding(node.lineno, problem, f"it is {skill.signature}")
            return
    if any(isinstance(a, ast.Starred) for a in node.args) or len(keywords) < len(node.keywords):
        return
    given = names[: len(node.args)] + keywords
    missing = [name for name in skill.required if name not in given]
    if len(node.args) > len(names):
        problem = f"{skill.name} takes {len(names)} arguments, not {len(node.args)}"
        yield Finding(node.lineno, problem, f"it is {skill.signature}")
    elif len(set(given)) < len(given):
        yield Finding(node.lineno, f"{skill.name} gets one argument twice", f"it is {skill.signature}")
    elif missing:
        yield Finding(node.lineno, f"{skill.name} needs the argument {missing[0]!r}", f"it is {skill.signature}")


def _is_dunder(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


def _removable(node: ast.Delete) -> bool:
    target = node.targets[0]
    return len(node.targets) == 1 and isinstance(target, ast.Subscript) and not isinstance(target.slice, ast.Slice)
