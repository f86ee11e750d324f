"""Functions of the skillbook in a run: what the prompt shows of them, and programs that call them.

A program that calls a function is completed with its text, so that what is run, judged, logged, approved and shown
again later is one whole program, whose lines are those that errors name.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Sequence

import attrs

from memo_core.interfaces.llm import LanguageModel
from memo_core.llm.readers import Unreadable, read_code, read_template
from memo_core.skillbook.model.functions import (
    Function,
    FunctionUse,
    NotACall,
    problem_with_arguments,
    problem_with_call,
    read_call,
    read_function,
)
from memo_core.skillbook.retrieval.result import RetrievedFunction
from memo_core.skillbook.retrieval.retriever import Retrieval

_BESIDE = ("look", "print")  # calls that do nothing to the world


def used_by(model: LanguageModel, wanted: FunctionUse) -> FunctionUse:
    """The use of functions by a model where the settings want ``wanted``: one that cannot call them is shown them."""
    return "show" if wanted == "call" and not model.calls_functions else wanted


def as_used(found: Retrieval, use: FunctionUse, skills: Collection[str], approvals: int = 0) -> Retrieval:
    """A retrieval whose functions are used as the settings say.

    Args:
        found: the retrieval.
        use: ``call`` keeps functions that can be called; ``show`` turns each into a template of its best call; ``off``
            leaves them out.
        skills: names of the robot's functions; a learnt function with such a name is left out.
        approvals: an untested function is shown as a template until so many programs written with it were approved.

    Returns:
        The retrieval.
    """
    functions = [one for one in found.functions if read_function(one.entry.text).name not in skills]
    called = tuple(
        one for one in functions if use == "call" and (one.standing.tested or one.standing.approved >= approvals)
    )
    shown = [one.as_template() for one in functions if use != "off" and one not in called]
    if not shown:
        return attrs.evolve(found, functions=called)
    ranked = sorted((*found.templates, *shown), key=lambda one: -one.score)
    templates = tuple(attrs.evolve(one, rank=rank) for rank, one in enumerate(ranked, start=1))
    return attrs.evolve(found, templates=templates, functions=called)


def read_program(text: str, functions: Sequence[RetrievedFunction]) -> str:
    """The program of an answer, completed with the functions that it calls.

    Raises:
        Unreadable: as ``read_code``; also if a function is called with arguments that it does not take.
    """
    code = read_code(text)
    texts = {read_function(one.entry.text): one.entry.text for one in functions}
    return completed(code, texts, text) if texts else code


def read_whole_template(text: str, functions: Sequence[RetrievedFunction]) -> str:
    """The template of an answer, which is shown and run again by itself later.

    Raises:
        Unreadable: as ``read_template``; also if it uses a learnt function that it does not define.
    """
    code = read_template(text)
    tree = ast.parse(code)
    own = _bound(tree)
    for name in (read_function(one.entry.text).name for one in functions):
        if name not in own and any(isinstance(node, ast.Name) and node.id == name for node in ast.walk(tree)):
            problem = f"it uses {name}, which is none of the robot's functions; put what it needs of it inside of it"
            raise Unreadable("template", problem, text)
    return code


def completed(code: str, functions: dict[Function, str], answer: str = "") -> str:
    """The code with the text of each function that it uses before it, but for names that it gives to something
    itself."""
    tree = ast.parse(code)
    own = _bound(tree)
    known = {function.name: function for function in functions if function.name not in own}
    used: list[Function] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in known and known[node.id] not in used:
            used.append(known[node.id])
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            problem = problem_with_arguments(known[node.func.id], len(node.args), [one.arg for one in node.keywords])
            if problem and not any(isinstance(one, ast.Starred) for one in node.args):
                raise Unreadable("code", f"line {node.lineno}: {problem}", answer)
    return "\n\n\n".join([*(functions[one].strip("\n") for one in used), code.lstrip("\n")])


def _bound(tree: ast.Module) -> set[str]:
    """The names that code gives to anything, anywhere in it."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            found.add(node.name)
        elif isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
            found.add(node.id)
        elif isinstance(node, ast.arg):
            found.add(node.arg)
        elif isinstance(node, ast.alias):
            found.add(node.asname or node.name)
        elif isinstance(node, ast.ExceptHandler) and node.name:
            found.add(node.name)
    return found


def only_call(code: str, functions: Sequence[RetrievedFunction]) -> tuple[RetrievedFunction, str] | None:
    """The function and the call, if a completed program does nothing but call one learnt function once.

    Looking, printing and giving the result a name beside it do not count; the arguments must be literals.
    """
    body = ast.parse(code).body
    for function in functions:
        text = ast.parse(function.entry.text).body
        if len(body) > len(text) and all(map(_same, body, text)):
            call = _only_call(body[len(text) :], read_function(function.entry.text))
            return (function, call) if call else None
    return None


def _same(one: ast.stmt, other: ast.stmt) -> bool:
    return ast.dump(one) == ast.dump(other)


def _only_call(statements: Sequence[ast.stmt], function: Function) -> str:
    found = ""
    for statement in statements:
        if not isinstance(statement, (ast.Expr, ast.Assign)) or not isinstance(statement.value, ast.Call):
            return ""
        call = statement.value
        called = call.func.id if isinstance(call.func, ast.Name) else ""
        if isinstance(statement, ast.Expr) and called in _BESIDE:
            if any(isinstance(node, ast.Call) and node is not call for node in ast.walk(call)):
                return ""
            continue
        if called != function.name or found:
            return ""
        found = ast.unparse(call)
        try:
            if problem_with_call(function, read_call(found)):
                return ""
        except NotACall:
            return ""
    return found
