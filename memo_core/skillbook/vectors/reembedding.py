"""Switching a book to another embedder."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.interfaces.embedder import Embedder
from memo_core.skillbook.model.entries import spoken
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.text_vectors import TextVectors


def reembed(url: str, embedder: Embedder) -> int:
    """Embed all texts of a book with another embedder. Returns the number of texts.

    The switch is one transaction; if interrupted before it, the book still uses the former embedder.
    """
    database = Database(url)
    database.open()
    try:
        embedder.open()
        with database.read() as connection:
            texts = sorted({spoken(row.kind, row.text) for row in queries.valid_entry_rows(connection)})
        with database.write() as connection:
            connection.execute(sa.delete(tables.vectors))
            database.set_meta(connection, "embedder", embedder.name)
            database.set_meta(connection, "dimension", str(embedder.dimension))
            database.set_meta(connection, "reembedded", str(database.next_generation(connection)))
        if texts:
            TextVectors(database, embedder).get(texts)
        return len(texts)
    except Exception as error:
        database.blame(error)
        raise
    finally:
        database.close()
