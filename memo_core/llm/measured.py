"""Measured results of a language backend per task: done untaught, done only when taught, or not done. A backend with
known limits declares a YAML file (``Backend.measured``, ``PACKAGE/path/in/it``): ``tasks`` maps a task's name to
``untaught``, ``taught`` or ``no``; ``commands`` says by which command each of the first two was measured.
"""

from __future__ import annotations

from importlib import resources
from typing import Any, Literal, get_args

import attrs
import yaml

from memo_core.errors import InvalidArgument
from memo_core.interfaces.backend import Backend

Reach = Literal["untaught", "taught", "no"]


@attrs.frozen(eq=False)
class Measured:
    """Measured results. ``tasks`` contains only tasks that were tried."""

    tasks: dict[str, Reach]
    commands: dict[str, str]

    def warning(self, backend: str, task: str) -> str:
        """A warning for a task that the backend cannot do; "" if it can, or was never measured."""
        reach = self.tasks.get(task)
        if reach == "no":
            return f"llm {backend!r} was not able to do {task!r} when it was measured, taught or untaught"
        if reach == "taught":
            return f"llm {backend!r} fails at {task!r} until somebody corrects it"
        return ""


def measured_of(backend: Backend) -> Measured | None:
    """The results that a backend declares; None if it declares none. Raises ``InvalidArgument``, which names file and
    key."""
    if not backend.measured:
        return None
    package, _, name = backend.measured.partition("/")
    data = yaml.safe_load(resources.files(package).joinpath(name).read_text("utf-8"))
    try:
        measured = Measured(dict(data["tasks"]), dict(data["commands"]))
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgument(backend.measured, f"cannot be read ({error!r})", "tasks and commands") from None
    wrong = {task: reach for task, reach in measured.tasks.items() if reach not in get_args(Reach)}
    if wrong:
        task, reach = next(iter(wrong.items()))
        raise InvalidArgument(f"{backend.measured}: tasks.{task}", f"unknown {reach!r}", ", ".join(get_args(Reach)))
    return measured


def summary(measured: Measured | None, task: str) -> dict[str, Any]:
    """The text for a list of tasks; empty if nothing was measured."""
    return {} if measured is None else {"reach": measured.tasks.get(task, "")}
