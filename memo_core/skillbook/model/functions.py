"""Functions learnt from several programs, and the one-line calls that stand in for those programs.

The text of a ``function`` entry is one documented ``def``; the text of a ``call`` entry is one call of it with literal
arguments, such as ``open_hinged('microwave door', angle=85)``. A call names its function; among the active entries of
a book a function's name is unique.
"""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import attrs

FunctionUse = Literal["call", "show", "off"]  # how a run uses functions: ``skillbook.functions``
LONGEST_CALL = 300  # characters of a call
MOST_LINES = 10  # of a function's docstring, which is all that a caller sees of it


class NotAFunction(ValueError):
    """Text that is not one documented function; the message says what is wrong."""


class NotACall(ValueError):
    """Text that is not one call of a function with literal arguments; the message says what is wrong."""


@attrs.frozen
class Function:
    """A function as a caller sees it."""

    name: str
    signature: str  # on one line, without "def" and colon: "open_hinged(door, angle=85)"
    docstring: str  # without indentation
    parameters: inspect.Signature = attrs.field(eq=False)


@attrs.frozen
class Call:
    """A call with its arguments' values."""

    function: str
    arguments: tuple[object, ...]
    keywords: tuple[tuple[str, object], ...]


@attrs.frozen
class GeneralFunction:
    """A function that does the work of several programs, and the call that does the work of each."""

    code: str
    calls: tuple[tuple[int, str], ...]  # entry that holds the program, and the call

    @property
    def name(self) -> str:
        return read_function(self.code).name

    @property
    def characters(self) -> int:
        return len(self.code) + sum(len(call) for _, call in self.calls)


@lru_cache(maxsize=1000)
def read_function(code: str) -> Function:
    """The function that the code defines.

    Raises:
        NotAFunction: if the code does not parse, or is not a single function with a docstring (imports beside it are
            allowed).
    """
    function = _definition(code)
    docstring = ast.get_docstring(function)
    if not docstring:
        raise NotAFunction(f"the function {function.name} has no docstring")
    try:
        signature = f"{function.name}({ast.unparse(function.args)})"
    except RecursionError:
        raise NotAFunction(f"the defaults of {function.name} are nested too deeply") from None
    return Function(function.name, signature, docstring, _parameters(function))


@lru_cache(maxsize=1000)
def read_call(text: str) -> Call:
    """The call that the text is.

    Raises:
        NotACall: if the text is anything else than one call of a plain name with literal arguments.
    """
    if len(text) > LONGEST_CALL:
        raise NotACall(f"it has {len(text)} characters; a call has at most {LONGEST_CALL}")
    try:
        node = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise NotACall(f"it does not parse: {error}") from None
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        raise NotACall("it is not a single call of a function by its name")
    try:
        arguments = tuple(ast.literal_eval(one) for one in node.args)
        keywords = tuple((one.arg or "", ast.literal_eval(one.value)) for one in node.keywords)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        raise NotACall("an argument is not a literal: give names and amounts as they are") from None
    constants = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
    if math.inf in constants:  # 1e999, which cannot be written back
        raise NotACall("an argument is not a finite number")
    names = [name for name, _ in keywords]
    if "" in names or len(set(names)) < len(names):
        raise NotACall("it has ** or a keyword twice")
    return Call(node.func.id, arguments, keywords)


def problem_with_call(function: Function, call: Call) -> str:
    """Why the function cannot be called so, as one sentence; "" if it can."""
    if call.function != function.name:
        return f"it calls {call.function}, and the function is {function.name}"
    try:
        function.parameters.bind(*call.arguments, **dict(call.keywords))
    except TypeError as error:
        return f"{function.signature} cannot be called so: {error}"
    return ""


def problem_with_arguments(function: Function, positional: int, keywords: Sequence[str | None]) -> str:
    """Why the function does not take so many positional arguments and these keywords (None: ``**``, which may hold
    anything), as one sentence; "" if it does."""
    if None in keywords:
        return ""
    try:
        function.parameters.bind(*range(positional), **dict.fromkeys(filter(None, keywords)))
    except TypeError as error:
        return f"{function.signature} cannot be called so: {error}"
    return ""


def as_program(code: str, call: str) -> str:
    """A program: the function, then the call."""
    return f"{code.rstrip()}\n\n\n{call.strip()}\n"


@lru_cache(maxsize=1000)
def as_template(code: str, call: str) -> str:
    """The function with a call's arguments in place of its defaults, so that it does what the call does when it is
    called without arguments.

    Raises:
        NotAFunction: if the code is not one function.
        NotACall: if the text is not a call that the function accepts.
    """
    function, read = read_function(code), read_call(call)
    if problem := problem_with_call(function, read):
        raise NotACall(problem)
    given = function.parameters.bind(*read.arguments, **dict(read.keywords)).arguments
    node = _definition(code)
    positional = [*node.args.posonlyargs, *node.args.args]
    missing: list[ast.expr | None] = [None] * (len(positional) - len(node.args.defaults))
    defaults = [
        _literal(given[arg.arg]) if arg.arg in given else default
        for arg, default in zip(positional, [*missing, *node.args.defaults], strict=True)
    ]
    node.args.defaults = [default for default in defaults if default is not None]
    node.args.kw_defaults = [
        _literal(given[arg.arg]) if arg.arg in given else default
        for arg, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
    ]
    return with_header(code, node)


def with_name(code: str, name: str) -> str:
    """The code with another name of its function."""
    node = _definition(code)
    node.name = name
    return with_header(code, node)


def with_header(code: str, function: ast.FunctionDef) -> str:
    """The code with the first line of its function (``def name(…):``) written anew from ``function``, and everything
    else as it is, comments included."""
    old = _definition(code)
    lines = code.splitlines(keepends=True)
    returns = f" -> {ast.unparse(function.returns)}" if function.returns is not None else ""
    header = f"def {function.name}({ast.unparse(function.args)}){returns}:\n"
    before, body = lines[: old.lineno - 1], lines[old.body[0].lineno - 1 :]
    return "".join([*before, header, *body])


def _literal(value: object) -> ast.expr:
    return ast.parse(repr(value), mode="eval").body


def _definition(code: str) -> ast.FunctionDef:
    try:
        body = ast.parse(code).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise NotAFunction(f"the code does not parse: {error}") from None
    functions = [node for node in body if isinstance(node, ast.FunctionDef)]
    others = [node for node in body if not isinstance(node, (ast.FunctionDef, ast.Import, ast.ImportFrom))]
    if len(functions) != 1 or others:
        raise NotAFunction(f"the code must be a single function, with what it needs inside it ({len(functions)} found)")
    [function] = functions
    first = function.body[0]
    if function.decorator_list or code.splitlines()[first.lineno - 1][: first.col_offset].strip():
        raise NotAFunction(f"the function {function.name} must be a plain def with its body on lines of its own")
    return function


def _parameters(function: ast.FunctionDef) -> inspect.Signature:
    args, given = function.args, inspect.Parameter
    positional = [*args.posonlyargs, *args.args]
    required = len(positional) - len(args.defaults)
    found = [
        given(
            arg.arg,
            given.POSITIONAL_ONLY if place < len(args.posonlyargs) else given.POSITIONAL_OR_KEYWORD,
            default=given.empty if place < required else None,
        )
        for place, arg in enumerate(positional)
    ]
    found += [given(args.vararg.arg, given.VAR_POSITIONAL)] if args.vararg else []
    found += [
        given(arg.arg, given.KEYWORD_ONLY, default=given.empty if default is None else None)
        for arg, default in zip(args.kwonlyargs, args.kw_defaults, strict=True)
    ]
    found += [given(args.kwarg.arg, given.VAR_KEYWORD)] if args.kwarg else []
    return inspect.Signature(found)
