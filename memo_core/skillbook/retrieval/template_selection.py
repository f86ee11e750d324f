"""Selection of the ranked templates and functions that are retrieved. A template is long, and one of little likeness
misleads, so neither a number of them nor their order alone decides."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

import attrs

from memo_core.skillbook.model.code_shape import code_shape
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import read_function
from memo_core.skillbook.retrieval.result import Cut, Retrieval, RetrievedEntry, RetrievedFunction, Standing
from memo_core.skillbook.retrieval.score import TIE
from memo_core.skillbook.retrieval.settings import RetrievalSettings

MOST_CALLS = 4  # calls of one function that are retrieved
ALIKE_ENOUGH = 0.55  # likeness of things for which one function may be; a door and a drawer have 0.5
_WORD = re.compile(r"\w+")


@attrs.define
class _Program:
    """A template, or a function with its calls: what stands in the prompt once."""

    code: str
    first: RetrievedEntry
    function: Entry | None = None
    calls: list[RetrievedEntry] = attrs.field(factory=list)
    called_only: bool = False

    @property
    def shown(self) -> int:
        """Characters of it in a prompt."""
        if not (self.function and self.called_only):
            return len(self.code)
        function = read_function(self.code)
        return len(function.signature) + len(function.docstring)


def select_templates(
    found: Retrieval,
    settings: RetrievalSettings,
    functions: Mapping[int, Entry] | None = None,
    standing: Mapping[int, Standing] | None = None,
    called_only: bool = False,
) -> Retrieval:
    """Select from the ranked templates and calls.

    Selected are the best one and, in order, those others whose score is near its score, whose code is not that of a
    better one (``code_shape``) and that fit what is left of ``template_characters``. Calls of one function count as one
    program, which ranks as its best call; of two functions of one name the better is selected. A function that a
    retrieved correction names is selected however far below the best it is, if it is for things that are built alike.

    Args:
        found: a retrieval whose ``templates`` are templates and calls, best first.
        settings: retrieval settings.
        functions: the function of each call, by the call's id; calls without one are left out.
        standing: what speaks for each function, by its id; None: not known, which counts as tested.
        called_only: whether functions are shown by signature and docstring only.

    Returns:
        The retrieval with templates and functions apart, and what was cut.
    """
    selected: list[_Program] = []
    cut: list[Cut] = []
    said = {word for one in found.corrections for word in _WORD.findall(one.text)}
    for one in found.templates:
        function = (functions or {}).get(one.entry.id)
        if one.entry.kind == "call" and function is None:
            continue
        same = next((other for other in selected if function and other.function == function), None)
        if same is not None:
            same.calls.append(one)
            continue
        program = _Program(function.text if function else one.text, one, function, [one], called_only)
        if rule := _rule_against(program, selected, settings, said):
            cut.append(Cut(one.key, one.key_score, rule, one.action_cosine, one.objects_cosine, 1))
        else:
            selected.append(program)
    templates = [program.first for program in selected if program.function is None]
    return attrs.evolve(
        found,
        templates=tuple(attrs.evolve(one, rank=rank) for rank, one in enumerate(templates, start=1)),
        functions=tuple(
            RetrievedFunction(
                program.function,
                tuple(program.calls[:MOST_CALLS]),
                (standing or {}).get(program.function.id, Standing()),
            )
            for program in selected
            if program.function is not None
        ),
        cut=(*cut, *found.cut),
    )


def _rule_against(program: _Program, better: list[_Program], settings: RetrievalSettings, said: Collection[str]) -> str:
    """The rule that excludes a program after some better ones; "" for none. ``said``: words of the corrections."""
    if not better:
        return ""
    named = program.function is not None and read_function(program.code).name in said
    alike = program.first.built is None or program.first.built >= ALIKE_ENOUGH
    if program.first.score < better[0].first.score - settings.template_reach - TIE and not (named and alike):
        return f"more than {settings.template_reach:g} below the best template"
    names = [other.function and read_function(other.function.text).name for other in better]
    if program.function is not None and read_function(program.code).name in names:
        return "a function of this name is retrieved already"
    if settings.fold_templates:
        shape = code_shape(program.code)
        same = next((other for other in better if code_shape(other.code) == shape), None)
        if same is not None:
            return f"the same code as {same.first.entry.kind} {same.first.entry.id}"
    most = settings.template_characters
    if most is not None and sum(other.shown for other in (*better, program)) > most:
        return f"beyond {most} characters of templates"
    return ""
