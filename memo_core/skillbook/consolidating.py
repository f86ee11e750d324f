"""Consolidation of a book: its clusters, condensing one, and keys that mean the same."""

from __future__ import annotations

from collections import Counter

from memo_core.skillbook.book import Skillbook, as_key
from memo_core.skillbook.consolidation import condensing
from memo_core.skillbook.consolidation.rules import Cluster, Clustered, Condensed
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import queries
from memo_core.skillbook.writing import key_aliases
from memo_core.skillbook.writing.key_aliases import NearKeys


def clusters(book: Skillbook, unchanged: bool = False, limits: condensing.ClusterLimits | None = None) -> list[Cluster]:
    """All of ``each_cluster`` at once."""
    return list(each_cluster(book, unchanged, limits))


def each_cluster(
    book: Skillbook, unchanged: bool = False, limits: condensing.ClusterLimits | None = None
) -> condensing.Clusters:
    """The clusters (``memo_core.skillbook.consolidation.rules``): keys in order, general statements last, each read
    from the book when it is iterated. Those that have not changed since they were last clustered are included only
    with ``unchanged``. Needs the embedder."""
    key_vectors = book.key_vectors()
    return condensing.find_clusters(
        book.database,
        key_vectors,
        book.settings,
        limits or condensing.ClusterLimits(),
        book.text_vectors().chain,
        unchanged,
    )


def condense(book: Skillbook, cluster: Cluster, proposal: Condensed, model: str = "") -> Clustered:
    """Commit a proposal for a cluster in one transaction. Superseded entries stay in the book; a merged entry keeps
    all its people as sources. Raises ``ClusterChanged`` if the cluster has changed since it was read,
    ``ValueError`` for a proposal that ``problem_with`` refuses; nothing is written then."""
    return condensing.condense(
        book.database, cluster, proposal, model, f"{condensing.CLUSTERED} by {model}" if model else condensing.CLUSTERED
    )


def join_duplicates(book: Skillbook, cluster: Cluster) -> Cluster:
    """Merge members with the same text. Returns the cluster as it is afterwards. Raises ``ClusterChanged``."""
    return condensing.without_duplicates(book.database, cluster)


def near_keys(book: Skillbook) -> list[NearKeys]:
    """Keys that have the same meaning as another key with more entries
    (``memo_core.skillbook.writing.key_aliases``); ``add_alias`` merges them. Needs the embedder."""
    with book.database.read() as connection:
        known, sizes = queries.keys_by_id(connection), queries.group_sizes(connection)
    counted: Counter[Key] = Counter()
    for number, _, size in sorted(sizes):
        counted[known[number]] += size
    del counted[GLOBAL_KEY]
    keys = sorted(counted, key=lambda key: -counted[key])
    return key_aliases.near_keys(keys, book.key_vectors(), book.settings.actions)


def add_alias(book: Skillbook, spelling: Key | str, key: Key | str) -> None:
    """Store entries for one key under another of nearly the same spelling from now on, also in retrieval."""
    alias, target = as_key(spelling), as_key(key)
    if alias == target:
        return
    with book.database.write() as connection:
        key_aliases.join(book.database, connection, alias, target)
        book.database.next_generation(connection)
