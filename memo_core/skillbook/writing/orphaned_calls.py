"""Calls that are active while none of their functions is: they become templates that do the same.

What retires a function retires its calls as well, but a call may come back later: by a rollback, as the version with
the best record, or from another book. Functions that a call ever called stay linked to it, so its program is known.
"""

from __future__ import annotations

from collections.abc import Collection

import sqlalchemy as sa

from memo_core.skillbook.model.functions import NotACall, NotAFunction, as_template
from memo_core.skillbook.store import queries, tables

_E, _C = tables.entries.c, tables.calls.c


def calls_to_templates(connection: sa.Connection, gone: Collection[int] = (), back: Collection[int] = ()) -> None:
    """Make templates of the active calls none of whose functions is active, inside a write transaction.

    Args:
        connection: a write transaction.
        gone: calls and functions that are about to be deleted; a call that would have no function left, active or not,
            becomes a template too.
        back: calls and functions that are about to become active again.
    """
    function = tables.entries.alias()
    served = sa.select(_C.entry).join(function, _C.function == function.c.id)
    served = served.where(_stays(function.c, gone, back))
    linked = sa.select(_C.entry).where(_C.function.not_in(list(gone)))
    orphaned = sa.or_(sa.and_(_stays(_E, gone, back), _E.id.not_in(served)), _E.id.not_in(linked))
    for call in queries.entries_where(connection, _E.kind == "call", _E.id.not_in(list(gone)), orphaned):
        called = sa.select(_C.function).where(_C.entry == call.id)
        codes = [one.text for one in queries.entries_where(connection, _E.id.in_(called))]
        text = next(filter(None, (_program(code, call.text) for code in reversed(codes))), None)
        if text is not None:
            mine = sa.update(tables.entries).where(_E.id == call.id)
            connection.execute(mine.values(kind="template", text=text))
            connection.execute(sa.delete(tables.calls).where(_C.entry == call.id))


def _stays(
    columns: sa.ColumnCollection[str, sa.ColumnElement[int]], gone: Collection[int], back: Collection[int]
) -> sa.ColumnElement[bool]:
    stays = sa.and_(columns.superseded_by.is_(None), columns.id.not_in(list(gone)))
    return sa.or_(stays, columns.id.in_(list(back)))


def _program(code: str, call: str) -> str | None:
    try:
        return as_template(code, call)
    except (NotAFunction, NotACall):
        return None
