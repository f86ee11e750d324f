"""Offline clustering of what people taught: a language model proposes for each cluster, the book accepts or refuses.

Each cluster commits on its own. ``memo_core.skillbook.consolidation.rules`` enforces what a model may change: an
invalid answer is asked for again with the reason, and after that the cluster stays as it was. After a stop or a crash
the book is valid, and a second call continues where the first one ended."""

from __future__ import annotations

import builtins
from collections.abc import Callable, Collection, Container, Iterator
from typing import Any, Literal

import attrs

from memo_core.events import ClusterDone, Event
from memo_core.llm.calls import ModelCalls
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers.condensed import longest_entry, read_condensed
from memo_core.llm.readers.unreadable import Unreadable
from memo_core.policy.generalising import Generalising, GroupOutcome
from memo_core.policy.model_questions import put, schema_of
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.condensing import ClusterChanged, ClusterLimits, Clusters
from memo_core.skillbook.consolidation.grouping import entries_of
from memo_core.skillbook.consolidation.rules import Cluster, Clustered, Condensed, Merged
from memo_core.skillbook.functions import Consolidated, merge_notes, merge_programs
from memo_core.skillbook.model.entries import key_label
from memo_core.skillbook.writing.key_aliases import NearKeys

PHASE = "cluster"
Status = Literal["condensed", "unchanged", "left", "changed"]


def _positive(least: int) -> Any:
    return attrs.validators.and_(attrs.validators.instance_of(int), attrs.validators.ge(least))


@attrs.frozen
class ClusteringSettings:
    """The ``clustering`` section of an experiment."""

    llm: Any = attrs.field(
        default=None,
        metadata={
            "backend": "llm",
            "help": "language model that condenses, with its keys; default: the experiment's",
            "paper": "Sec. V: one language model",
        },
    )
    join_keys: bool = attrs.field(
        default=True,
        metadata={
            "help": "keep near-identical keys under one of them",
            "paper": "Sec. IV-C: a cluster is the entries that share one embedding vector",
        },
    )
    groups: bool = attrs.field(
        default=True,
        metadata={
            "help": "make functions of templates of several keys, each program left as one call",
            "paper": "Sec. IV-C: clusters of one key, whose templates stay as they are",
        },
    )
    members: int = attrs.field(
        default=40,
        validator=_positive(2),
        metadata={"help": "most notes in one question; larger clusters are parted", "paper": ""},
    )
    template_characters: int = attrs.field(
        default=24_000,
        validator=_positive(1),
        metadata={"help": "of related templates shown in one question", "paper": ""},
    )
    drop_covered: bool = attrs.field(
        default=False,
        metadata={
            "help": "drop notes that say no more than the template of their key (as in the paper)",
            "paper": "Sec. IV-C: entries say what is not included within the template",
        },
    )
    reasks: int = attrs.field(
        default=2,
        validator=_positive(0),
        metadata={"help": "times a model is asked again after an unusable answer", "paper": ""},
    )
    interval_s: float = attrs.field(
        default=5.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "seconds between looks of memo cluster --watch"},
    )


@attrs.frozen
class ClusterOutcome:
    """The result for one cluster. ``left``: there was no usable answer and it stayed as it was; ``changed``: it had
    changed since it was read. ``proposal`` is what was committed, or in a dry run would be. It refers to ``cluster``,
    which is what the model was shown: each distinct text once."""

    cluster: Cluster
    status: Status
    entries_before: int
    characters_before: int
    proposal: Condensed | None = None
    committed: Clustered | None = None
    problem: str = ""
    calls: int = 0

    @property
    def duplicates(self) -> int:
        """Number of entries with the same text as another."""
        return self.entries_before - len(self.cluster.members)

    @property
    def entries_after(self) -> int:
        return len(self.proposal.entries) if self.proposal is not None else len(self.cluster.members)

    @property
    def characters_after(self) -> int:
        return self.proposal.characters if self.proposal is not None else self.cluster.characters


class Clustering:
    """Condenses one book with one model."""

    def __init__(
        self,
        book: Skillbook,
        calls: ModelCalls,
        model: str,
        settings: ClusteringSettings | None = None,
        prompts: Prompts | None = None,
        emit: Callable[[Event], None] = lambda event: None,
        seed: int = 0,
        generalising: Generalising | None = None,
        names: Collection[str] = (),
    ) -> None:
        """Prepare; nothing is asked.

        Args:
            book: the book.
            calls: the model.
            model: name that is stored with its results.
            settings: clustering settings; None: the defaults.
            prompts: prompt files; None: the shipped ones.
            emit: receives events.
            seed: seed of the model.
            generalising: makes functions of groups of keys; None: only where no model need be asked.
            names: names of the robot's functions; no function gets one of these or of Python's.
        """
        self._book = book
        self._calls = calls
        self._model = model
        self._settings = settings or ClusteringSettings()
        self._prompts = prompts or Prompts()
        self._emit = emit
        self._seed = seed
        self._generalising = generalising
        self._names = {*names, *dir(builtins)}

    @property
    def model(self) -> str:
        return self._model

    def near_keys(self) -> list[NearKeys]:
        """Pairs of keys that would be merged; none if the settings turn this off."""
        return consolidating.near_keys(self._book) if self._settings.join_keys else []

    def join(self, near: NearKeys) -> None:
        """Move one key's entries under the other, and store future entries there too."""
        consolidating.add_alias(self._book, near.spelling, near.key)

    def clusters(self, unchanged: bool = False) -> Clusters:
        """The clusters to condense; with ``unchanged`` also those that have not changed since they were last
        condensed."""
        return consolidating.each_cluster(self._book, unchanged, self._limits)

    def condense_all(self, unchanged: bool = False) -> Iterator[ClusterOutcome | Consolidated | GroupOutcome]:
        """Merge near-identical keys, condense every cluster that needs it, then consolidate groups of keys. Raises as
        ``condense`` and ``Generalising.generalise``."""
        for near in self.near_keys():
            self.join(near)
        for cluster in self.clusters(unchanged):
            yield self.condense(cluster)
        yield from self.consolidate_groups(unchanged)

    def consolidate_groups(
        self, again: bool = False, commit: bool = True, skip: Container[tuple[int, ...]] = ()
    ) -> Iterator[Consolidated | GroupOutcome]:
        """Consolidate entries of several keys: notes with the same words, programs that differ in defaults only, then
        what a model makes of programs for things that are built alike.

        Args:
            again: also groups that were considered already.
            commit: False writes nothing.
            skip: entries of groups about which no model is asked.

        Yields:
            What was made of each group.
        """
        if not self._settings.groups:
            return
        for made in merge_notes(self._book, again, commit):
            yield self._noted(made)
        for made in merge_programs(self._book, self._names, again, commit):
            yield self._noted(made)
        if self._generalising is None:
            return
        for group in self._generalising.groups(again):
            if entries_of(group) in skip:
                continue
            outcome = self._generalising.generalise(group, commit)
            if outcome.made is not None:
                self._noted(outcome.made)
            yield outcome

    def _noted(self, made: Consolidated) -> Consolidated:
        if made.revision is not None:
            keys = ", ".join(dict.fromkeys(key_label(entry.key) for entry in made.members))
            counts = (made.entries_before, made.entries_after, made.characters_before, made.characters_after)
            self._emit(ClusterDone(keys, *counts))
        return made

    def condense(self, cluster: Cluster, commit: bool = True) -> ClusterOutcome:
        """Ask, check, and (with ``commit``) store. Raises ``LanguageModelError``, ``BudgetExceeded``, ``Stopped``;
        then this cluster is as it was."""
        before = (len(cluster.members), cluster.characters)
        try:
            if commit:
                cluster = consolidating.join_duplicates(self._book, cluster)  # for that nobody need be asked
            proposal, calls = self._proposal(cluster)
        except Unreadable as error:
            return ClusterOutcome(cluster, "left", *before, problem=error.problem, calls=self._settings.reasks + 1)
        except ClusterChanged as error:
            return ClusterOutcome(cluster, "changed", *before, problem=str(error))
        status: Status = "condensed" if proposal.changes(cluster) or before[0] > len(cluster.members) else "unchanged"
        if not commit:
            return ClusterOutcome(cluster, status, *before, proposal, calls=calls)
        try:
            committed = consolidating.condense(self._book, cluster, proposal, self._model)
        except ClusterChanged as error:
            return ClusterOutcome(cluster, "changed", *before, problem=str(error), calls=calls)
        self._emit(
            ClusterDone(
                key_label(cluster.key), before[0], committed.entries_after, before[1], committed.characters_after
            )
        )
        return ClusterOutcome(cluster, status, *before, proposal, committed, calls=calls)

    @property
    def _limits(self) -> ClusterLimits:
        return ClusterLimits(self._settings.members, self._settings.template_characters, self._settings.drop_covered)

    def _proposal(self, cluster: Cluster) -> tuple[Condensed, int]:
        if len(cluster.members) < 2 and not cluster.templates:
            return Condensed(tuple(Merged(member.text, (1,)) for member in cluster.members)), 0
        context = prompt_context(cluster, self._book)
        messages = self._prompts.messages(PHASE, context)
        stamp = self._prompts.text(PHASE).stamp
        reasks = self._settings.reasks
        proposal, asked = put(
            self._calls,
            PHASE,
            messages,
            lambda text: read_condensed(text, cluster),
            reasks,
            self._seed,
            stamp,
            schema_of(PHASE, context),
        )
        return proposal, asked.calls


def prompt_context(cluster: Cluster, book: Skillbook) -> dict[str, Any]:
    """The values for the placeholders of a cluster's prompt."""
    own = next((n for n, t in enumerate(cluster.templates, start=1) if t.entry.key == cluster.key), 0)
    records = {version.entry.id: version for t in cluster.templates for version in history.versions(book, t.entry.key)}
    return {
        "key": key_label(cluster.key),
        "entries": [
            {"text": " ".join(member.text.split()), "after": own if member.id in cluster.said_after else 0}
            for member in cluster.members
        ],
        "templates": [
            {
                "key": template.key,
                "text": template.text.rstrip("\n"),
                "uses": records[template.entry.id].uses,
                "confirmed": records[template.entry.id].confirmed_uses,
            }
            for template in cluster.templates
        ],
        "characters": cluster.characters,
        "longest": longest_entry(cluster),
        "covered": own if cluster.drop_covered else 0,
    }
