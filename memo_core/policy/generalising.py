"""Generalising programs of several keys: a language model proposes functions and calls in place of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Literal, Protocol

import attrs

from memo_core.interfaces.llm import Message
from memo_core.llm.calls import ModelCalls
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers.generalised import read_generalised
from memo_core.llm.readers.unreadable import Unreadable
from memo_core.policy.model_questions import put
from memo_core.robot.description import RobotDescription
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.function_rules import (
    LEAST_KEYS,
    Generalised,
    Group,
    Left,
    MergedNote,
    NewFunction,
    name_of,
    problem_with,
    stays,
)
from memo_core.skillbook.consolidation.grouping import entries_of
from memo_core.skillbook.functions import Consolidated, consolidated_groups, functions_of, program_behind, store
from memo_core.skillbook.model.entries import Entry, key_label
from memo_core.skillbook.model.functions import GeneralFunction, as_program
from memo_core.skillbook.writing.functions import GroupChange, GroupChanged, WiderNote
from memo_core.skills.contract import documentation
from memo_core.skills.skill import Skill

PHASE = "generalise"
_MEND = (
    'Calls of this answer failed when they were run; the lines "Tried before" now say which and how. Mend it and '
    "answer once more with everything, in the form asked for."
)
_WORD = re.compile(r"\w+")


def prompt_context(group: Group, skills: str, subset: str) -> dict[str, Any]:
    """The values for the placeholders of a group's prompt.

    Args:
        group: programs, notes and functions to show.
        skills: documentation of the robot's functions.
        subset: the Python that the sandbox runs.

    Returns:
        Values by placeholder. Of a call whose function is shown anyway, only the call stands in the list of programs.
    """
    shown = {name_of(entry) for entry in group.functions}
    return {
        "skills": skills,
        "subset": subset,
        "programs": [
            {
                "key": key_label(member.key),
                "built": member.built,
                "code": member.entry.text.strip() if member.calls in shown else member.code.rstrip(),
                "tried": member.tried,
            }
            for member in group.members
        ],
        "functions": [{"text": entry.text.rstrip()} for entry in group.functions],
        "notes": [{"key": key_label(note.key), "text": " ".join(note.text.split())} for note in group.notes],
        "characters": group.characters,
    }


class Verdict(Protocol):
    """Whether a call may stand in for a program (``memo_core.maintenance.paired_trials``)."""

    @property
    def accepted(self) -> bool: ...

    @property
    def reason(self) -> str:
        """Why it may not, as one sentence."""

    @property
    def untestable(self) -> str:
        """Why nothing could be run; "" if it was."""

    @property
    def starts(self) -> Sequence[tuple[str, bool, str]]:
        """Each start, whether the call succeeded from it, and if not, why."""


class Tester(Protocol):
    """Runs a program in place of a template."""

    def compare(self, template: Entry, program: str) -> Verdict:
        """Run both from the same starts. Raises ``KeyboardInterrupt`` for a stop, ``MemoError`` of the simulator."""


@attrs.frozen
class GroupOutcome:
    """The result for one group of programs.

    Attributes:
        group: programs, notes and functions as they were read.
        status: ``generalised``; ``unchanged``: nothing belonged together; ``left``: no usable answer; ``changed``: the
            book had changed since it was read.
        made: what was stored, or by a dry run would be.
        left: why programs stay as they are, by their entries.
        tested: starts and how the calls did from them, by the entry of the program; empty: not tested.
        untested: why the calls could not be run; empty: they were, or there are none.
        problem: why there was no usable answer.
        calls: questions to the model.
    """

    group: Group
    status: Literal["generalised", "unchanged", "left", "changed"]
    made: Consolidated | None = None
    left: dict[int, str] = attrs.field(factory=dict)
    tested: dict[int, tuple[tuple[str, bool, str], ...]] = attrs.field(factory=dict)
    untested: str = ""
    problem: str = ""
    calls: int = 0

    @property
    def label(self) -> str:
        return ", ".join(dict.fromkeys(key_label(member.key) for member in self.group.members))


class Generalising:
    """Makes functions of the groups of one book with one model, each call run before it is believed."""

    def __init__(
        self,
        book: Skillbook,
        calls: ModelCalls,
        prompts: Prompts,
        robot: RobotDescription,
        skills: Mapping[str, Skill],
        subset: str,
        tester: Tester | None = None,
        reasks: int = 2,
        seed: int = 0,
        check: Callable[[str], Sequence[object]] = lambda program: (),
    ) -> None:
        """Prepare; nothing is asked.

        Args:
            book: the book.
            calls: the model.
            prompts: prompt files.
            robot: the robot whose functions are called.
            skills: the robot's functions by name.
            subset: the Python that the sandbox runs.
            tester: runs calls in place of programs; None: what is made is not tested.
            reasks: times that the model is asked again, after an unusable answer and after calls that failed.
            seed: seed of the model.
            check: finds what will not run in a program, without running it (``Sandbox.check``).
        """
        self._book = book
        self._calls = calls
        self._prompts = prompts
        self._robot = robot
        self._skills = skills
        self._subset = subset
        self._tester = tester
        self._reasks = reasks
        self._seed = seed
        self._check = check

    def groups(self, again: bool = False) -> list[Group]:
        """The groups that could be generalised; those considered already only with ``again``."""
        return consolidated_groups(self._book, again)

    def generalise(self, group: Group, commit: bool = True) -> GroupOutcome:
        """Ask, check, run, and (with ``commit``) store.

        A call that does worse than its program is shown to the model with what happened and with that answer, at
        most ``reasks`` times; after that its program is left as it is. A function is given up if it is left with
        programs of one key, is longer than they are, or loses a program that called it before. Of several answers the
        one counts whose calls replace most programs, the newest if several do.

        Returns:
            The outcome.

        Raises:
            LanguageModelError, BudgetExceeded, Stopped: then the group is as it was.
            KeyboardInterrupt: if a stop came while programs were run.
            MemoError: if the simulator failed.
        """
        asked, shown, answer, tried, problem = 0, group, "", list[tuple[Generalised, _Trials]](), ""
        for _ in range(self._reasks + 1):
            try:
                proposal, answered, answer = self._ask(shown, answer)
            except Unreadable as error:
                asked, problem = asked + self._reasks + 1, error.problem
                break
            asked += answered
            trials = _Trials(self._book, self._tester).run(group, proposal)
            tried.append((trials.without_failed(group, proposal), trials))
            if not trials.failed:
                break
            shown = trials.shown_in(shown)
        if not tried:
            return GroupOutcome(group, "left", problem=problem, calls=asked)
        return self._settled(group, *max(reversed(tried), key=lambda one: _replaced(one[0])), asked, commit)

    def _ask(self, group: Group, before: str) -> tuple[Generalised, int, str]:
        """A proposal, the times asked, and the answer. ``before``: the answer of which calls failed; "" for none."""
        taken = {one.function.name for one in functions_of(self._book)}
        context = prompt_context(group, documentation(dict(self._skills)), self._subset) | {"robot": self._robot}
        messages = self._prompts.messages(PHASE, context)
        if before:
            messages = (*messages, Message("assistant", before), Message("user", _MEND))

        def read(text: str) -> tuple[Generalised, str]:
            proposal = read_generalised(text, group, self._skills, taken)
            for one in proposal.functions:
                if findings := self._check(as_program(one.code, one.calls[0][1])):
                    raise Unreadable(PHASE, f"{one.name} cannot be run: {findings[0]}", text)
            return proposal, text

        stamp = self._prompts.text(PHASE).stamp
        (proposal, answer), asked = put(self._calls, PHASE, messages, read, self._reasks, self._seed, stamp)
        return proposal, asked.calls, answer

    def _settled(self, group: Group, proposal: Generalised, trials: _Trials, asked: int, commit: bool) -> GroupOutcome:
        change = change_of(group, proposal, trials.trials)
        left = {group.members[one.number - 1].entry.id: one.why for one in proposal.left}
        entries = {entry.id: entry for entry in (*(member.entry for member in group.members), *group.notes)}
        functions = {entry.id: entry for entry in group.functions}
        gone = tuple(entries[number] for number in change.gone if number in entries)
        made = Consolidated(change, gone, tuple(functions[number] for number in change.replaced))
        outcome = GroupOutcome(
            group,
            "generalised" if change.gone else "unchanged",
            made if change.gone else None,
            left,
            trials.trials,
            trials.untested if proposal.functions else "",
            calls=asked,
        )
        if not commit:
            return outcome
        try:
            revision = store(self._book, change, self._calls.model)
        except GroupChanged as error:
            return attrs.evolve(outcome, status="changed", made=None, problem=str(error))
        return outcome if revision is None else attrs.evolve(outcome, made=attrs.evolve(made, revision=revision))


@attrs.define
class _Trials:
    """Runs the calls of one proposal."""

    book: Skillbook
    tester: Tester | None
    failed: dict[int, str] = attrs.field(factory=dict)  # number of the program: the call, and what came of it
    trials: dict[int, tuple[tuple[str, bool, str], ...]] = attrs.field(factory=dict)  # by the program's entry
    untested: str = ""

    def run(self, group: Group, proposal: Generalised) -> _Trials:
        """Run every call in place of its program; what cannot be run is not held against it."""
        if self.tester is None:
            self.untested = "no simulator was at hand"
            return self
        for function in proposal.functions:
            for number, call in function.calls:
                member = group.members[number - 1]
                verdict = self.tester.compare(program_behind(self.book, member.entry), as_program(function.code, call))
                if verdict.untestable:
                    self.untested = verdict.untestable
                    continue
                self.trials[member.entry.id] = tuple(verdict.starts)
                if not verdict.accepted:
                    self.failed[number] = f"{call} failed: {verdict.reason}"
        return self

    def shown_in(self, group: Group) -> Group:
        """The group with what failed beside the programs."""
        members = [
            attrs.evolve(member, tried=(*member.tried, self.failed[number])) if number in self.failed else member
            for number, member in enumerate(group.members, start=1)
        ]
        return attrs.evolve(group, members=tuple(members))

    def without_failed(self, group: Group, proposal: Generalised) -> Generalised:
        """The proposal without the calls that failed and without the functions that are then given up. A note inside
        one of these stays, and notes that mention it stay as they were."""
        functions = [
            attrs.evolve(one, calls=tuple(call for call in one.calls if call[0] not in self.failed))
            for one in proposal.functions
        ]
        left = {one.number: one.why for one in proposal.left} | self.failed
        while True:
            found = _with_functions(group, proposal, functions, left)
            lost = next((one for one in functions if _has_lost(group, one, left)), None)
            why = "its function was given up"
            if lost is None and functions and (problem := problem_with(group, found, (), ())):
                lost = max(functions, key=lambda one: _growth(group, one))
                why = f"{why}: {problem}"
            if lost is None:
                return found
            functions.remove(lost)
            left |= {number: why for number, _ in lost.calls}


def _replaced(proposal: Generalised) -> int:
    """Number of programs that calls replace."""
    return sum(len(one.calls) for one in proposal.functions)


def _has_lost(group: Group, function: NewFunction, left: Collection[int]) -> bool:
    """Whether a function is left with programs of too few keys, or a program that calls it already is left."""
    keys = {group.members[number - 1].key for number, _ in function.calls}
    return len(keys) < LEAST_KEYS or any(group.members[number - 1].calls == function.name for number in left)


def _growth(group: Group, function: NewFunction) -> int:
    """Characters of a function and its calls, less those of the programs that they replace."""
    return len(function.code) + sum(
        len(call) - len(group.members[number - 1].entry.text) for number, call in function.calls
    )


def _with_functions(
    group: Group, proposal: Generalised, functions: Sequence[NewFunction], left: Mapping[int, str]
) -> Generalised:
    """The proposal with some of its functions only."""
    kept = {one.name: one for one in functions}
    given_up = {one.name for one in proposal.functions} - kept.keys()
    notes: list[MergedNote] = []
    for note in proposal.notes:
        mentions = given_up & set(_WORD.findall(note.text))
        notes += [_as_it_was(group, number) for number in note.of] if mentions else [note]
    inside = []
    for number, name in proposal.inside:
        called = {group.members[program - 1].key for program, _ in kept[name].calls} if name in kept else set()
        if group.notes[number - 1].key in called:
            inside.append((number, name))
        else:
            notes.append(_as_it_was(group, number))
    return Generalised(
        tuple(functions), tuple(Left(number, why) for number, why in left.items()), tuple(notes), tuple(inside)
    )


def _as_it_was(group: Group, note: int) -> MergedNote:
    return MergedNote(group.notes[note - 1].text, (note,))


def change_of(
    group: Group, proposal: Generalised, trials: Mapping[int, Sequence[tuple[str, bool, str]]]
) -> GroupChange:
    """A proposal as a change of the book."""
    names = [function.name for function in proposal.functions]
    entry_of = [member.entry.id for member in group.members]
    staying = {entry.id for entry in stays(group, proposal)}
    changed = [
        one for one in proposal.notes if len(one.of) > 1 or one.text.split() != group.notes[one.of[0] - 1].text.split()
    ]
    return GroupChange(
        tuple(
            GeneralFunction(one.code, tuple((entry_of[number - 1], call.strip()) for number, call in one.calls))
            for one in proposal.functions
        ),
        tuple(entry.id for entry in group.functions if entry.id not in staying) if proposal.functions else (),
        tuple((group.notes[note - 1].id, names.index(name)) for note, name in proposal.inside),
        tuple(WiderNote(one.text, tuple(group.notes[note - 1].id for note in one.of)) for one in changed),
        entries_of(group),
        {entry: tuple(starts) for entry, starts in trials.items()},
    )
