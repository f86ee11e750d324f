"""The whole book as records, one a line in a file: everything but the vectors, which are derived."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.skillbook import rows, tables

FORMAT = 1


def records(connection: sa.Connection, meta: dict[str, str]) -> Iterator[dict[str, Any]]:
    """First the book, then feedback, aliases, revisions and entries by id. ``record`` names the kind of each."""
    yield {"record": "book", "format": FORMAT, **meta}
    for feedback in rows.feedback_where(connection):
        yield {"record": "feedback", **attrs.asdict(feedback)}
    for spelling, key in sorted(rows.alias_rows(connection).items()):
        yield {"record": "alias", "spelling": spelling, "action": key.action, "objects": list(key.objects)}
    for revision in connection.execute(sa.select(tables.revisions).order_by(tables.revisions.c.id)):
        yield {"record": "revision", "id": revision.id, "time": revision.time, "reason": revision.reason}
    sources: dict[int, list[int]] = {}
    for entry, source in connection.execute(sa.select(tables.sources.c.entry, tables.sources.c.feedback)):
        sources.setdefault(entry, []).append(source)
    for one in rows.entries_where(connection):
        fields = attrs.asdict(one, filter=lambda field, _: field.name != "key")
        key_fields = {"action": one.key.action, "objects": list(one.key.objects)}
        yield {"record": "entry", **fields, **key_fields, "sources": sorted(sources.get(one.id, []))}
