"""Finding clusters and committing the result for each: one transaction per cluster, only if its members are still those
that were read. Superseded entries stay in the book with the reason; ``history`` shows and restores them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.errors import MemoError
from memo_core.skillbook.consolidation.rules import (
    Cluster,
    Clustered,
    Condensed,
    Merged,
    RelatedTemplate,
    duplicates,
    is_kept,
    problem_with,
    state_digest,
)
from memo_core.skillbook.model.entries import GLOBAL_KEY, NOTE_KINDS, Entry
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.superseding import supersede
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.writing.functions import calls_as_templates
from memo_core.skillbook.writing.templates import Records, records_of

_E, _K, _S, _C = tables.entries.c, tables.keys.c, tables.sources.c, tables.clusterings.c
CONDENSED = sa.and_(_E.kind.in_(NOTE_KINDS), _E.id.not_in(sa.select(tables.entry_keys.c.entry)))  # notes of one key
_TIE = 1e-6
CLUSTERED, DUPLICATES = "cluster", "duplicates"  # how the reasons of clustering's revisions begin


@attrs.define(auto_exc=True, eq=False)
class ClusterChanged(MemoError):
    """The book changed while a model was asked about a cluster; nothing was written. Read the cluster again and
    retry."""

    cluster: str

    def __str__(self) -> str:
        return f"cluster {self.cluster} has changed since it was read; nothing was written"


@attrs.frozen
class ClusterLimits:
    """How much one prompt can hold, and what may be dropped."""

    members: int = 40
    template_characters: int = 24_000
    drop_covered: bool = False  # whether notes that say no more than the key's own template may go


@attrs.frozen(eq=False)
class Clusters:
    """A book's clusters, keys in order, general statements last, read one key after the other as they are iterated: the
    entries of a large book are not in memory at once. ``len`` is an upper bound that is close to their number.
    """

    database: Database
    limits: ClusterLimits
    order: Callable[[Sequence[str]], list[int]]
    unchanged: bool
    records: Records
    keys: tuple[tuple[Key, int, int], ...]  # with its id and the number of its members
    related: Related
    clustered: dict[Key, str]

    def __len__(self) -> int:
        return sum(max(1, -(-members // self.limits.members)) for _, _, members in self.keys)

    def __iter__(self) -> Iterator[Cluster]:
        for key, number, _ in self.keys:
            cluster = self._read(key, number)
            if not cluster.members or (len(cluster.members) < 2 and not cluster.related):
                continue  # somebody was quicker
            if self.unchanged or self.clustered.get(key) != cluster.state:
                yield from _parts(cluster, self.limits, self.order)

    def _read(self, key: Key, number: int) -> Cluster:
        with self.database.read() as connection:
            valid = (_E.superseded_by.is_(None), _E.key == number, _is_condensed(self.database, connection))
            mine = queries.entries_where(connection, *valid)
        near = self.related.of(key)
        faulted = _faulted(key, near, self.records)
        return Cluster(
            key,
            tuple(mine),
            _within(near, self.limits.template_characters),
            said_after=frozenset(m.id for m in mine for t in faulted if (m.created, m.id) > (t.created, t.id)),
            whole=frozenset(m.id for m in mine),
            related=frozenset(self.related.ids(key)),
            drop_covered=self.limits.drop_covered,
        )


def find_clusters(
    database: Database,
    key_vectors: KeyVectors,
    settings: RetrievalSettings,
    limits: ClusterLimits,
    order: Callable[[Sequence[str]], list[int]],
    unchanged: bool = False,
) -> Clusters:
    """The book's clusters; those that have not changed since they were last clustered only with ``unchanged``. A
    cluster that cannot be condensed (one member without related templates) is left out. ``order`` returns the indices
    of texts sorted so that similar ones are adjacent, for clusters that are divided into parts.
    """
    valid = _E.superseded_by.is_(None)
    ids: dict[int, list[int]] = {}
    with database.read() as connection:
        known = queries.keys_by_id(connection)
        notes = sa.select(_E.key, _E.id).where(valid, _is_condensed(database, connection))
        for number, entry in connection.execute(notes):
            ids.setdefault(number, []).append(entry)
        templates = queries.entries_where(connection, valid, _E.kind == "template")
        templates += calls_as_templates(database, connection)
        clustered = _clustered(database, connection)
        records = records_of(database, connection)
    related = _related([known[number] for number in ids], templates, key_vectors, settings)
    failed = {template.key for template in templates if records.failed(template.id, template.key)}
    keys = []
    for number in sorted(ids, key=lambda number: (known[number] == GLOBAL_KEY, known[number])):
        key = known[number]
        theirs = related.ids(key)
        if len(ids[number]) < 2 and not theirs:
            continue
        if unchanged or key in failed or clustered.get(key) != state_digest(ids[number], theirs):
            keys.append((key, number, len(ids[number])))  # of the others, mostly all, nothing more need be read
    return Clusters(database, limits, order, unchanged, records, tuple(keys), related, clustered)


def _is_condensed(database: Database, connection: sa.Connection) -> sa.ColumnElement[bool]:
    """Whether an entry is a note of one key, also in a book of an older version that is open read-only."""
    return CONDENSED if database.has(connection, tables.entry_keys) else _E.kind.in_(NOTE_KINDS)


def _faulted(key: Key, near: Iterable[RelatedTemplate], records: Records) -> list[Entry]:
    """The key's own templates that were corrected."""
    return [t.entry for t in near if t.entry.key == key and records.failed(t.entry.id, key)]


def condense(database: Database, cluster: Cluster, proposal: Condensed, model: str, reason: str) -> Clustered:
    """Commit a proposal for a cluster. Returns the result; the last part also marks the key as clustered.

    Raises ``ClusterChanged`` when the members or templates are not those that were read, ``ValueError`` for a proposal
    that ``problem_with`` refuses (nothing is written then), ``ReadOnlyBook``.
    """
    problem = problem_with(cluster, proposal)
    if problem:
        raise ValueError(problem)
    now = database.now()
    with database.write() as connection:
        key = _unchanged_key(connection, cluster)
        revision, added = None, []
        if proposal.changes(cluster):
            revision = queries.insert(connection, tables.revisions, key=key, time=now, reason=reason)
            added = _replace(connection, cluster, proposal, revision, key)
            database.next_generation(connection)
        if cluster.part == cluster.parts and reason != DUPLICATES:
            note_clustered(database, connection, key, _state_now(connection, cluster, key), model)
        stored = queries.entries_by_id(connection, added)
    return Clustered(
        cluster.key,
        len(cluster.members),
        len(proposal.entries),
        cluster.characters,
        proposal.characters,
        revision,
        tuple(stored[entry] for entry in added),
    )


def without_duplicates(database: Database, cluster: Cluster) -> Cluster:
    """Merge members with the same text and commit that. Returns the cluster as it is afterwards."""
    proposal = duplicates(cluster.members)
    if proposal is None:
        return cluster
    joined = [one for one in proposal.entries if not is_kept(cluster, one)]
    added = condense(database, cluster, proposal, "", DUPLICATES).added
    gone = {cluster.members[number - 1].id for one in joined for number in one.of}
    said_after = {
        entry.id
        for one, entry in zip(joined, added, strict=True)
        if any(cluster.members[number - 1].id in cluster.said_after for number in one.of)
    }
    return attrs.evolve(
        cluster,
        members=(*(member for member in cluster.members if member.id not in gone), *added),
        said_after=(cluster.said_after - gone) | said_after,
        whole=(cluster.whole - gone) | {entry.id for entry in added},
    )


def _unchanged_key(connection: sa.Connection, cluster: Cluster) -> int:
    """The id of the cluster's key. Raises ``ClusterChanged``."""
    read = {m.id for m in cluster.members}
    shown = [t.entry.id for t in cluster.templates]
    valid = queries.entries_by_id(connection, [*read, *shown])
    there = all(entry in valid and valid[entry].superseded_by is None for entry in [*read, *shown])
    key = connection.execute(sa.select(_E.key).where(_E.id == min(read))).scalar()
    if not there or key is None or any(valid[entry].key != cluster.key for entry in read):
        raise ClusterChanged(cluster.label)
    if cluster.parts == 1:
        now = connection.execute(sa.select(_E.id).where(_E.key == key, CONDENSED, _E.superseded_by.is_(None)))
        if set(queries.ids_of(now)) != read:
            raise ClusterChanged(cluster.label)
    return int(key)


def _replace(connection: sa.Connection, cluster: Cluster, proposal: Condensed, revision: int, key: int) -> list[int]:
    added: list[int] = []
    into: dict[int, int] = {}  # number of a member -> the entry that it is part of
    for ordinal, one in enumerate(proposal.entries):
        if is_kept(cluster, one):
            continue
        made_of = [cluster.members[number - 1] for number in one.of]
        entry = _merged_entry(connection, made_of, one, revision, key, ordinal)
        added.append(entry)
        for number in one.of:
            into[number] = entry
    gone = {one.number: one for one in proposal.dropped}
    for number in sorted(into.keys() | gone.keys()):
        why, because = [], into.get(number)
        if number in gone:
            template = cluster.templates[gone[number].template - 1].entry.id
            how = "says no more than" if gone[number].covered else "contradicts"
            why.append(gone[number].why.strip() or f"{how} template {template}")
            because = because or template
        if number in into:
            why.append(f"{'the rest ' if why else ''}merged into {into[number]}")
        supersede(connection, revision, cluster.members[number - 1].id, "; ".join(why), because)
    return added


def _merged_entry(
    connection: sa.Connection, made_of: Sequence[Entry], one: Merged, revision: int, key: int, ordinal: int
) -> int:
    """A merged entry has the sources of all its members; its use count is the largest of theirs, since they were mostly
    retrieved together."""
    scenes = {member.scene for member in made_of}
    entry = queries.insert(
        connection,
        tables.entries,
        kind=made_of[0].kind,
        key=key,
        text=one.text,
        scene=scenes.pop() if len(scenes) == 1 else "",
        feedback=None,
        phase="cluster",
        ordinal=ordinal,
        revision=revision,
        superseded_by=None,
        uses=max(member.uses for member in made_of),
        confirmed_uses=max(member.confirmed_uses for member in made_of),
        created=max(member.created for member in made_of),
    )
    origins = sa.select(_S.feedback).where(_S.entry.in_([member.id for member in made_of])).distinct()
    for source in sorted(queries.ids_of(connection.execute(origins))):
        queries.insert_plain(connection, tables.sources, entry=entry, feedback=source)
    return entry


# -- which were clustered already --------------------------------------------------------------------------------------


def _clustered(database: Database, connection: sa.Connection) -> dict[Key, str]:
    if not database.has(connection, tables.clusterings):
        return {}
    query = sa.select(_K.action, _K.objects, _C.digest).join(tables.keys, _C.key == _K.id)
    return {queries.key_of(action, objects): digest for action, objects, digest in connection.execute(query)}


def note_clustered(database: Database, connection: sa.Connection, key: int, digest: str, model: str) -> None:
    """Skip a key as long as it is in this state."""
    connection.execute(sa.delete(tables.clusterings).where(_C.key == key))
    queries.insert_plain(connection, tables.clusterings, key=key, digest=digest, time=database.now(), model=model)


def _state_now(connection: sa.Connection, cluster: Cluster, key: int) -> str:
    """The state after the cluster's own changes, without changes that others made in the meantime."""
    query = sa.select(_E.id).where(
        _E.key == key,
        CONDENSED,
        _E.superseded_by.is_(None),
        sa.or_(_E.id.in_(cluster.whole), _E.phase == "cluster"),
    )
    members = queries.ids_of(connection.execute(query))
    newest = {entry.id for entry in queries.entries_by_id(connection, members).values()}
    return state_digest(newest, cluster.related, cluster.said_after & newest)


# -- relations and parts -----------------------------------------------------------------------------------------------


@attrs.frozen(eq=False)
class Related:
    """Which templates are related to which keys; all are related to general statements, those with the most approvals
    first. They are computed per key on demand, since a key of a large book may have hundreds."""

    proven: list[Entry]  # the templates, the best proven first
    of_key: list[list[int]]  # of each key that has templates, their places in ``proven``
    row_of: dict[Key, int]
    scores: (
        np.ndarray
    )  # r of keys and keys that have templates; -inf for opposites. Float32 (keys, keys with templates)
    least: float

    def places(self, key: Key) -> list[tuple[int, float]]:
        """Places in ``proven`` with r, nearest first."""
        if key == GLOBAL_KEY:
            return [(place, 1.0) for place in range(len(self.proven))]
        scores = self.scores[self.row_of[key]]
        near = np.flatnonzero(scores >= self.least)
        near = near[np.argsort(-scores[near], kind="stable")]
        return [
            (place, score)
            for j, score in zip(near.tolist(), scores[near].tolist(), strict=True)
            for place in self.of_key[j]
        ]

    def ids(self, key: Key) -> list[int]:
        return [self.proven[place].id for place, _ in self.places(key)]

    def of(self, key: Key) -> list[RelatedTemplate]:
        """Nearest first."""
        return [RelatedTemplate(self.proven[place], score) for place, score in self.places(key)]


def _related(keys: list[Key], templates: list[Entry], key_vectors: KeyVectors, settings: RetrievalSettings) -> Related:
    proven = [template for template in templates if template.key != GLOBAL_KEY]  # under it only in a damaged book
    proven.sort(key=lambda template: (-template.confirmed_uses, -template.created, -template.id))
    own = [key for key in keys if key != GLOBAL_KEY]
    theirs = list(dict.fromkeys(template.key for template in proven))
    place_of = {key: place for place, key in enumerate(theirs)}
    of_key: list[list[int]] = [[] for _ in theirs]
    for place, template in enumerate(proven):
        of_key[place_of[template.key]].append(place)
    scores = np.zeros((len(own), len(theirs)), dtype=np.float32)
    if own and theirs:
        (a, b), (c, d) = key_vectors.get(own), key_vectors.get(theirs)
        first, second = settings.weights
        scores = (first * (a @ c.T) + second * (b @ d.T)) / (first + second)
        mine, mine_of = _distinct([key.action for key in own])
        others, others_of = _distinct([key.action for key in theirs])
        undone = np.array([[settings.actions.opposite(one, other) for other in others] for one in mine])
        scores[undone[mine_of][:, others_of]] = -np.inf
    return Related(proven, of_key, {key: row for row, key in enumerate(own)}, scores, settings.cut - _TIE)


def _distinct(words: list[str]) -> tuple[list[str], list[int]]:
    """The different words, and the place of each among them."""
    place_of = {word: place for place, word in enumerate(dict.fromkeys(words))}
    return list(place_of), [place_of[word] for word in words]


def _within(templates: Sequence[RelatedTemplate], characters: int) -> tuple[RelatedTemplate, ...]:
    """As many as fit, but at least the first."""
    shown: list[RelatedTemplate] = []
    for template in templates:
        characters -= len(template.text)
        if characters < 0 and shown:
            break
        shown.append(template)
    return tuple(shown)


def _parts(cluster: Cluster, limits: ClusterLimits, order: Callable[[Sequence[str]], list[int]]) -> Iterable[Cluster]:
    if len(cluster.members) <= limits.members:
        return [cluster]
    ordered = [cluster.members[place] for place in order([member.text for member in cluster.members])]
    count = -(-len(ordered) // limits.members)
    size = -(-len(ordered) // count)
    return [
        attrs.evolve(cluster, members=tuple(ordered[i * size : (i + 1) * size]), part=i + 1, parts=count)
        for i in range(count)
    ]
