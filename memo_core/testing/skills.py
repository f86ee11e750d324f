"""Conformance suite for skills that plugins add: ``RULES[name](make)``, where ``make`` returns the skills."""

from __future__ import annotations

import inspect
import keyword
from collections.abc import Callable, Sequence

from memo_core.errors import InvalidArgument
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import Skill
from memo_core.testing.rules import Rules

Make = Callable[[], Sequence[Skill]]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule


def check_skills(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


@rule
def are_declared_skills(make: Make) -> None:
    """Each is a ``Skill``, made with the decorator ``skill``."""
    skills = tuple(make())
    assert skills, "there is none"
    for one in skills:
        assert isinstance(one, Skill), f"{one!r} is no Skill"


@rule
def have_names_of_their_own(make: Make) -> None:
    """Names are unique Python names and none of the built-in skills'."""
    names = [one.name for one in make()]
    assert len(set(names)) == len(names), f"names given twice: {sorted({n for n in names if names.count(n) > 1})}"
    for name in names:
        assert name.isidentifier() and not keyword.iskeyword(name), f"{name!r} cannot be called"
    taken = {one.name for one in BUILTIN_SKILLS} & set(names)
    assert not taken, f"already built in: {sorted(taken)}"


@rule
def say_what_they_do(make: Make) -> None:
    """The docstring begins with a sentence: it is all that a language model is told."""
    for one in make():
        first = one.doc.strip().splitlines()[0]
        assert len(first.split()) >= 3 and first.rstrip().endswith((".", ";", ":")), (
            f"{one.name}: {first!r} is no sentence"
        )


@rule
def have_plain_parameters(make: Make) -> None:
    """Parameters are typed and passed by name or place; ``*args`` and ``**kwargs`` cannot be checked."""
    for one in make():
        for parameter in one.parameters:
            assert parameter.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD or (
                parameter.kind is inspect.Parameter.KEYWORD_ONLY
            ), f"{one.name}: {parameter.name} is a {parameter.kind.description} parameter"


@rule
def refuse_what_they_do_not_know(make: Make) -> None:
    """An unknown argument is an ``InvalidArgument``, before anything moves."""
    for one in make():
        try:
            one.bind((), {"no_such_argument_": 1})
        except InvalidArgument:
            continue
        raise AssertionError(f"{one.name} took an argument that it does not have")
