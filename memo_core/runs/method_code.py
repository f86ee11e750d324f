"""Calling a plugin's method. An error of its own is one line, with the file and line of its author's code."""

from __future__ import annotations

from memo_core.environment.task_code import author_place
from memo_core.errors import MemoError, MethodCodeError, unwritable
from memo_core.plugins.loading import one_line
from memo_core.policy.method_interface import Method
from memo_core.policy.results import RunResult
from memo_core.policy.run_context import Session


def run_method(method: Method, session: Session) -> RunResult:
    """Have a method do the session's task.

    Args:
        method: MEMO's or a plugin's.
        session: as for ``Method.run``.

    Returns:
        What the method returns.

    Raises:
        MethodCodeError: if a plugin's method raises anything but a ``MemoError``, or returns no ``RunResult``: the run
            could not be carried out, which says nothing about how well the method does tasks.
        MemoError: as ``Method.run``.
    """
    module = type(method).__module__
    if module.startswith("memo_core."):
        return method.run(session)
    try:
        result = method.run(session)
    except MemoError:
        raise
    except Exception as error:
        if unwritable(error):
            raise
        said = f"raised {one_line(error)}{author_place(error.__traceback__, module)}"
        raise MethodCodeError(method.name, said) from error
    if not isinstance(result, RunResult):
        raise MethodCodeError(method.name, f"returned {type(result).__name__}, not RunResult")
    return result
