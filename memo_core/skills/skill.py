"""The declaration of a skill, from which prompt documentation, sandbox stubs and argument checks are derived.

A skill is a typed Python function whose first parameter is the ``Control`` it acts through; the decorator ``skill``
records its name, signature and docstring. Parameter types come from ``memo_core.skills.values`` and carry their own
checks, so an argument is checked the same way whoever calls.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterable
from typing import Any, Literal

import attrs

from memo_core.errors import InvalidArgument
from memo_core.skills.values import checks_of, describe_type, read_value

Kind = Literal["query", "geometry", "motion", "gripper", "perception"]


@attrs.frozen(eq=False)
class Skill:
    """One function that robot code may call. ``kind``: ``query`` reads, ``geometry`` only computes, the rest act."""

    name: str
    kind: Kind
    function: Callable[..., Any]
    parameters: tuple[inspect.Parameter, ...]  # without the control
    types: dict[str, Any]  # parameter name -> annotated type, and "return"
    doc: str

    @property
    def acts(self) -> bool:
        """Whether the skill moves the robot or looks."""
        return self.kind not in ("query", "geometry")

    @property
    def signature(self) -> str:
        """As a person would write it: ``open_gripper(width: float | None = None) -> float``."""
        shown = []
        for parameter in self.parameters:
            text = f"{parameter.name}: {describe_type(self.types[parameter.name])}"
            if parameter.default is not inspect.Parameter.empty:
                text += f" = {parameter.default!r}"
            shown.append(text)
        return f"{self.name}({', '.join(shown)}) -> {describe_type(self.types['return'])}"

    def documentation(self) -> str:
        """The entry in the prompt: signature and docstring."""
        return self.signature + "\n" + "\n".join("    " + line for line in self.doc.splitlines())

    def bind(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> dict[str, Any]:
        """Check and convert the arguments of a call, and fill in the defaults.

        Args:
            args: positional arguments, without the control.
            kwargs: arguments by name.

        Returns:
            Argument name -> checked value.

        Raises:
            InvalidArgument: if an argument is unknown, missing or invalid; it names the skill's argument.
        """
        given = self._given(args, kwargs)
        return {name: read_value(f"{self.name}({name})", value, self.types[name]) for name, value in given.items()}

    def exceeded(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> list[str]:
        """One sentence for each argument above the robot's limit, with the limit that is used instead. ``args`` and
        ``kwargs`` are those of a ``bind`` that succeeded.
        """
        given = self._given(args, kwargs)
        return [
            f"{self.name}({name}): {value:g} is faster than this robot may move; it moves at its limit, {check.most:g}"
            for name, value in given.items()
            for check in checks_of(self.types[name])
            if check.most is not None and value is not None and value > check.most
        ]

    def _given(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> dict[str, Any]:
        """By name, with the defaults of what is not given."""
        try:
            bound = inspect.Signature(self.parameters).bind(*args, **kwargs)
        except TypeError as error:
            raise InvalidArgument(f"{self.name}()", str(error), self.signature) from None
        bound.apply_defaults()
        return bound.arguments

    def call(self, control: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None) -> Any:
        """Check the arguments and run the skill.

        Args:
            control: robot or recording that the skill acts through.
            args: positional arguments, without the control.
            kwargs: arguments by name; None: no such arguments.

        Returns:
            Value that the skill's function returns.

        Raises:
            InvalidArgument: if an argument is unknown, missing or invalid.
            UnknownName: if an argument names no object or part in the scene.
            SkillError: if the skill fails.
            Stopped: if the stop is set meanwhile.
        """
        return self.function(control, **self.bind(args, kwargs or {}))


def skill(kind: Kind) -> Callable[[Callable[..., Any]], Skill]:
    """Decorator that declares a function as a skill.

    The function's first parameter is the ``Control``. Its docstring goes into the prompts: it says what the skill does,
    with units and frames.

    Args:
        kind: ``query`` reads, ``geometry`` only computes; ``motion``, ``gripper`` and ``perception`` act.

    Returns:
        A decorator that turns the function into a ``Skill``. It raises ``TypeError`` if the docstring, the type of a
        parameter or the return type is missing.
    """

    def declare(function: Callable[..., Any]) -> Skill:
        types = typing.get_type_hints(function, include_extras=True)
        parameters = tuple(inspect.signature(function).parameters.values())[1:]
        doc = inspect.getdoc(function) or ""
        missing = [p.name for p in parameters if p.name not in types]
        if missing or "return" not in types or not doc:
            raise TypeError(
                f"skill {function.__name__}: needs a docstring and types for {missing or 'its return value'}"
            )
        return Skill(function.__name__, kind, function, parameters, types, doc)

    return declare


def type_legend(skills: Iterable[Skill]) -> str:
    """What the type names in the skills' signatures stand for, one a line; plain Python types need no word."""
    found = {}
    for one in skills:
        for annotation in one.types.values():
            for check in checks_of(annotation):
                if check.name not in ("float", "int", "str", "bool"):
                    found[check.name] = check.expected
    return "\n".join(f"{name}: {expected}" for name, expected in found.items())


def skill_library(skills: Iterable[Skill]) -> dict[str, Skill]:
    """Library K of skills that robot code may call.

    Args:
        skills: declared skills, built-in and from plugins.

    Returns:
        Skill name -> skill, in the given order.

    Raises:
        InvalidArgument: if two skills have the same name.
    """
    library: dict[str, Skill] = {}
    for one in skills:
        if one.name in library:
            raise InvalidArgument("skills", f"two skills are named {one.name!r}", "unique names")
        library[one.name] = one
    return library
