"""Rules for the code of a template or of a function learnt: one documented function with parameters and without
hard-coded positions."""

from __future__ import annotations

import ast
import builtins

_IN_ORDER = ("enumerate", "sorted", "reversed", "list", "tuple")
_TO_ONE_NUMBER = ("len", "max", "min", "sum")


def problem_with_template(code: str) -> str:
    """Why code that parses is no template, as one sentence for its author; "" if it is one."""
    try:
        return _problem(ast.parse(code))
    except (RecursionError, MemoryError):
        return "its code is nested too deeply"


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
    """Ids of the literals whose numbers are used one at a time: tried one after the other (``for tilt in (0.1, 0.4,
    0.7)``), chosen by an index, summed up or compared with. Also where they have a name first (``tilts=(0.1, 0.4,
    0.7)``, then ``for tilt in tilts``), unless that name is passed on whole, and as parts of a condition."""
    found: set[int] = set()
    loops = [node.target for node in ast.walk(function) if isinstance(node, ast.comprehension)]
    coordinates = {part.id for target in loops for part in ast.walk(target) if isinstance(part, ast.Name)}
    taken_apart: list[ast.expr] = []
    passed: list[ast.expr] = []
    values: list[tuple[str, ast.expr]] = []
    for node in ast.walk(function):
        if isinstance(node, (ast.For, ast.comprehension)):
            found |= {id(part) for part in ast.walk(node.iter)}
            taken_apart.append(node.iter)
        elif isinstance(node, ast.Compare):
            taken_apart += [node.left, *node.comparators]
        elif isinstance(node, ast.Subscript) and _chooses(node.slice, coordinates):
            taken_apart.append(node.value)
        elif isinstance(node, ast.Call):
            given = [*node.args, *(keyword.value for keyword in node.keywords)]
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            if name in _TO_ONE_NUMBER:
                taken_apart += given
            elif not hasattr(builtins, name):
                passed += given
        elif isinstance(node, ast.Assign):
            values += [(target.id, node.value) for target in node.targets if isinstance(target, ast.Name)]
        elif isinstance(node, (ast.AnnAssign, ast.NamedExpr)) and isinstance(node.target, ast.Name) and node.value:
            values.append((node.target.id, node.value))
    values += _defaults(function.args)
    whole = {part.id for given in passed for part in _one_of(given) if isinstance(part, ast.Name)}
    seen: set[str] = set()
    while taken_apart:
        for part in _one_of(taken_apart.pop()):
            found.add(id(part))
            if isinstance(part, ast.Name) and part.id not in seen | whole:
                seen.add(part.id)
                taken_apart += [value for name, value in values if name == part.id]
    return found


def _chooses(index: ast.expr, coordinates: set[str]) -> bool:
    """Whether an index picks one of several values, and is not that of a comprehension, which makes a new list (``[p[i]
    for i in range(3)]``)."""
    names = {part.id for part in ast.walk(index) if isinstance(part, ast.Name)}
    return bool(names) and not names & coordinates and not isinstance(index, ast.Slice)


def _defaults(arguments: ast.arguments) -> list[tuple[str, ast.expr]]:
    placed = [*arguments.posonlyargs, *arguments.args]
    defaults = list(zip(reversed(placed), reversed(arguments.defaults), strict=False))
    defaults += [
        (name, value) for name, value in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if value
    ]
    return [(name.arg, value) for name, value in defaults]


def _one_of(value: ast.expr) -> list[ast.expr]:
    """List the values that an expression may have: the branches of a condition, without ``enumerate``, ``sorted``,
    ``reversed``, ``list`` or ``tuple`` around them."""
    if isinstance(value, ast.IfExp):
        return _one_of(value.body) + _one_of(value.orelse)
    if isinstance(value, ast.BoolOp):
        return [part for operand in value.values for part in _one_of(operand)]
    if isinstance(value, ast.NamedExpr):
        return [value.target, *_one_of(value.value)]
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id in _IN_ORDER and value.args:
        return _one_of(value.args[0])
    return [value]


def _constant(node: ast.expr) -> float | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _constant(node.operand)
        return None if value is None else -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    return None
