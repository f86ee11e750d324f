"""Phase 4's answer: one documented function made of code that worked."""

from __future__ import annotations

import ast

from memo_core.llm.readers.blocks import code_blocks, syntax_problem
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken

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
        problem = f"its code does not parse: {problem}" if problem else _problem(ast.parse(code))
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


def _problem(tree: ast.Module) -> str:
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    others = [node for node in tree.body if not isinstance(node, (ast.FunctionDef, ast.Import, ast.ImportFrom))]
    if len(functions) != 1 or others:
        found = ", ".join(node.name for node in functions) or "none"
        beside = f", and line {others[0].lineno} stands beside them" if others else ""
        return (
            "it must be a single function and nothing beside it, with what else it needs inside of it "
            f"(functions: {found}{beside})"
        )
    function = functions[0]
    if not ast.get_docstring(function):
        return f"the function {function.name} has no docstring"
    if not function.args.args and not function.args.kwonlyargs:
        return f"the function {function.name} has no parameters"
    place = next(iter(_places(function)), None)
    if place is not None:
        return f"line {place.lineno}: {ast.unparse(place)} is a hard-coded position or orientation; compute or pass it"
    return ""


def _places(function: ast.FunctionDef) -> list[ast.List | ast.Tuple]:
    """Lists of three or four literal numbers that state a position or an orientation, that is with at least two numbers
    other than 0 and 1. Unit directions, offsets along one axis and values that a loop iterates over do not count."""
    alternatives = _alternatives(function)
    found = []
    for node in ast.walk(function):
        if isinstance(node, (ast.List, ast.Tuple)) and len(node.elts) in (3, 4) and id(node) not in alternatives:
            values = [_constant(item) for item in node.elts]
            telling = [value for value in values if value is not None and abs(value) not in (0.0, 1.0)]
            if None not in values and len(telling) >= 2:
                found.append(node)
    return found


def _alternatives(function: ast.FunctionDef) -> set[int]:
    """Ids of the literals that are tried one after the other (``for tilt in (0.1, 0.4, 0.7)``), also where they have a
    name first (``tilts=(0.1, 0.4, 0.7)``, then ``for tilt in tilts``), and of those that something is compared with."""
    found, names = set(), set()
    for node in ast.walk(function):
        if isinstance(node, (ast.For, ast.comprehension)):
            through = _plainly_through(node.iter)
            names |= {through.id} if isinstance(through, ast.Name) else set()
            found |= {id(part) for part in ast.walk(node.iter)}
        elif isinstance(node, ast.Compare):
            found |= {id(part) for part in node.comparators}
    arguments = function.args
    defaults = list(zip(reversed(arguments.args), reversed(arguments.defaults), strict=False))
    defaults += [
        (name, value) for name, value in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if value
    ]
    found |= {id(value) for name, value in defaults if name.arg in names}
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            targets = {target.id for target in node.targets if isinstance(target, ast.Name)}
            found |= {id(node.value)} if targets & names else set()
    return found


def _plainly_through(iterable: ast.expr) -> ast.expr:
    """The iterable of a loop, without ``enumerate``, ``sorted``, ``reversed``, ``list`` or ``tuple`` around it."""
    while isinstance(iterable, ast.Call) and isinstance(iterable.func, ast.Name) and len(iterable.args) >= 1:
        if iterable.func.id not in ("enumerate", "sorted", "reversed", "list", "tuple"):
            break
        iterable = iterable.args[0]
    return iterable


def _constant(node: ast.expr) -> float | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _constant(node.operand)
        return None if value is None else -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    return None
