"""Clusters: all corrections under one key, or the general statements, with the templates they are condensed against.

``problem_with`` enforces what condensing may do, whatever a model answers: the numbers of entries and characters never
grow, every member is accounted for, and only a member that contradicts a template in the prompt is removed without a
successor.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence

import attrs

from memo_core.skillbook.model.entries import GLOBAL_KEY, Entry, key_label, same_words
from memo_core.skillbook.model.keys import Key

_NUMBER = re.compile(r"\d+(?:[.,]\d+)?")


@attrs.frozen
class RelatedTemplate:
    """An active template against which a cluster is condensed. It is related by the rule of retrieval: r(cluster's key,
    template's key) is not below the cut, and the actions are not opposites. ``score`` is r; 1 for general statements,
    to which every template is related."""

    entry: Entry
    score: float

    @property
    def key(self) -> str:
        return key_label(self.entry.key)

    @property
    def text(self) -> str:
        return self.entry.text


@attrs.frozen
class Cluster:
    """Entries that are condensed together. ``part`` of ``parts``: large clusters are divided into parts that fit into a
    prompt. ``said_after``: members that correct code which was written with the key's own template; they are newer than
    the template, so it does not overrule them. ``whole`` and ``related`` are the ids of all members of the key and of
    all templates related to it, including those that did not fit into this part.
    """

    key: Key
    members: tuple[Entry, ...]
    templates: tuple[RelatedTemplate, ...] = ()
    said_after: frozenset[int] = frozenset()
    whole: frozenset[int] = frozenset()
    related: frozenset[int] = frozenset()
    part: int = 1
    parts: int = 1
    drop_covered: bool = False  # whether a member that says no more than the key's own template may go

    @property
    def label(self) -> str:
        name = key_label(self.key)
        return name if self.parts == 1 else f"{name} {self.part}/{self.parts}"

    @property
    def left_out(self) -> int:
        """Number of related templates that did not fit into this part."""
        return len(self.related) - len(self.templates)

    @property
    def state(self) -> str:
        """State of the whole key; a key that was clustered in this state need not be clustered again."""
        return state_digest(self.whole, self.related, self.said_after)

    @property
    def general(self) -> bool:
        return self.key == GLOBAL_KEY

    @property
    def characters(self) -> int:
        return sum(len(member.text) for member in self.members)


def _without_repeats(numbers: Iterable[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(numbers))


@attrs.frozen
class Merged:
    """One entry of a condensed cluster and the members it derives from, by their positions in the cluster (1 is the
    first)."""

    text: str
    of: tuple[int, ...] = attrs.field(converter=_without_repeats)


@attrs.frozen
class Dropped:
    """A member that is removed because it contradicts a template (position among the cluster's templates, 1 is the
    first). If only a part of it does, an entry derives from the rest. ``covered``: it is removed because it says no
    more than the key's own template."""

    number: int
    template: int
    why: str = ""
    covered: bool = False


@attrs.frozen
class Condensed:
    """A model's proposal for a cluster, not yet checked."""

    entries: tuple[Merged, ...]
    dropped: tuple[Dropped, ...] = ()

    @property
    def characters(self) -> int:
        return sum(len(one.text) for one in self.entries)

    def changes(self, cluster: Cluster) -> bool:
        """Whether anything would be different afterwards."""
        return bool(self.dropped) or any(not is_kept(cluster, one) for one in self.entries)


@attrs.frozen
class Clustered:
    """The result of condensing one cluster: entries and characters before and after, and the revision (None: nothing to
    do)."""

    key: Key
    entries_before: int
    entries_after: int
    characters_before: int
    characters_after: int
    revision: int | None = None
    added: tuple[Entry, ...] = ()


def is_kept(cluster: Cluster, one: Merged) -> bool:
    """Whether an entry of a proposal is an unchanged member."""
    return len(one.of) == 1 and cluster.members[one.of[0] - 1].text.split() == one.text.split()


def problem_with(cluster: Cluster, proposal: Condensed) -> str:
    """Why a proposal is refused, as one sentence for its author; "" if it is accepted. Every member is the source of
    one entry, or dropped, or both if a part of it is dropped; entries and characters do not grow; numbers that people
    stated are kept except in what is dropped; and a dropped member names a template in the prompt and does not correct
    code that was written with the key's own template.
    """
    return (
        _misplaced(cluster, proposal)
        or _lossy(cluster, proposal)
        or _wrongly_dropped(cluster, proposal)
        or _grown(cluster, proposal)
    )


def _misplaced(cluster: Cluster, proposal: Condensed) -> str:
    count = len(cluster.members)
    seen: set[int] = set()
    for position, one in enumerate(proposal.entries, start=1):
        if not one.text.strip():
            return f"entry {position} has no text"
        if not one.of:
            return f"entry {position} derives from no number; nothing may be added that nobody said"
        problem = _misnamed(one.of, seen, count, f"entry {position}")
        if problem:
            return problem
        seen |= set(one.of)
    dropped: set[int] = set()
    for gone in proposal.dropped:
        problem = _misnamed((gone.number,), dropped, count, '"dropped"')
        if problem:
            return problem
        dropped.add(gone.number)
    missing = [number for number in range(1, count + 1) if number not in seen | dropped]
    if missing:
        listed = ", ".join(map(str, missing))
        return f'the numbers {listed} are neither in an entry\'s "from" nor dropped; account for every number'
    return ""


def _misnamed(numbers: Iterable[int], before: set[int], count: int, where: str) -> str:
    for number in numbers:
        if not 1 <= number <= count:
            return f"{where} names number {number}; there are numbers 1 to {count}"
        if number in before:
            return f"number {number} stands twice, again in {where}; each number goes to one entry"
    return ""


def _lossy(cluster: Cluster, proposal: Condensed) -> str:
    in_part = {gone.number for gone in proposal.dropped}
    for position, one in enumerate(proposal.entries, start=1):
        said = [cluster.members[number - 1].text for number in one.of]
        same = any(one.text.split() == text.split() for text in said)
        if not same and not words_of(one.text) & set().union(*map(words_of, said)):
            return f"entry {position} has no word in common with what it derives from"
        for number, text in zip(one.of, said, strict=True):
            if number in in_part:
                if one.text.split() == text.split():
                    return f"number {number} is dropped, and yet entry {position} is the whole of it"
                continue
            lost = sorted(amounts(text) - amounts(one.text))
            if lost:
                return f"entry {position} loses the amount {lost[0]} of number {number}"
    return ""


def _wrongly_dropped(cluster: Cluster, proposal: Condensed) -> str:
    shown = len(cluster.templates)
    for gone in proposal.dropped:
        if not shown:
            return f"number {gone.number} is dropped, but there are no templates that it could contradict; keep it"
        if not 1 <= gone.template <= shown:
            return f"number {gone.number} is dropped for template {gone.template}; there are templates 1 to {shown}"
        member, template = cluster.members[gone.number - 1], cluster.templates[gone.template - 1]
        if member.id in cluster.said_after and template.entry.key == cluster.key:
            return (
                f"number {gone.number} is dropped for template {gone.template}, but was said of code written with that "
                "template: it says what is wrong with it; keep it"
            )
        if gone.covered and (problem := _not_covered(cluster, proposal, gone)):
            return f"number {gone.number} is dropped as covered by template {gone.template}, {problem}; keep it"
    return ""


def _not_covered(cluster: Cluster, proposal: Condensed, gone: Dropped) -> str:
    """Why a member may not be dropped as covered by a template; "" if it may."""
    text, template = cluster.members[gone.number - 1].text, cluster.templates[gone.template - 1]
    if not cluster.drop_covered:
        return "but what a template does anyway stays"
    if template.entry.key != cluster.key:
        return f"which is not of {cluster.label}"
    if any(gone.number in one.of for one in proposal.entries):
        return "and yet stands in an entry"
    lost = sorted(amounts(text) - amounts(template.text))
    if lost:
        return f"which does not have the amount {lost[0]}"
    return "" if words_of(text) & words_of(template.text) else "which has no word in common with it"


def _grown(cluster: Cluster, proposal: Condensed) -> str:
    count = len(cluster.members)
    if len(proposal.entries) > count:
        return f"there are {len(proposal.entries)} entries, more than the {count} there were"
    if proposal.characters > cluster.characters:
        return (
            f"the entries have {proposal.characters} characters together, more than the {cluster.characters} there "
            "were; say it more briefly"
        )
    return ""


def duplicates(members: Sequence[Entry]) -> Condensed | None:
    """The proposal that merges members with the same words (ignoring case, spaces and the last full stop); None if
    there are none. No model is asked."""
    groups: dict[str, list[int]] = {}
    for number, member in enumerate(members, start=1):
        groups.setdefault(same_words(member.text), []).append(number)
    if len(groups) == len(members):
        return None
    shortest = [min(numbers, key=lambda n: len(members[n - 1].text)) for numbers in groups.values()]
    return Condensed(
        tuple(Merged(members[n - 1].text, tuple(numbers)) for n, numbers in zip(shortest, groups.values(), strict=True))
    )


def state_digest(members: Iterable[int], templates: Iterable[int], said_after: Iterable[int] = ()) -> str:
    """A digest of a cluster's state: one part for each of the three arguments. Ids suffice, because entries never
    change."""
    listed = (",".join(map(str, sorted(ids))) for ids in (members, templates, said_after))
    return ":".join(hashlib.sha256(ids.encode()).hexdigest()[:20] for ids in listed)


def amounts(text: str) -> set[str]:
    """The numbers in a text, as they are written."""
    return set(_NUMBER.findall(text))


def words_of(text: str) -> set[str]:
    """The words in a text, without case and numbers."""
    return set(re.findall(r"[^\W\d_]+", text.casefold()))
