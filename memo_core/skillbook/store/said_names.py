"""What people said of names, read from the feedback that the book keeps anyway."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.scene.name_corrections import NameCorrection, read_name_corrections
from memo_core.scene.scene_table import NotASceneTable, read_scene_table
from memo_core.skillbook.model.keys import Key, NotAKey
from memo_core.skillbook.store import queries, tables
from memo_core.text.reading_limits import LONGEST_WORDS

# Every form of words that is read has one of these; most feedback has none, and is not looked at.
_MARKS = ("%not%", "%n't%", "%n’t%", "%isnt%", "%actually%", "%really%", "%in fact%", "%after all%")


def said_names(connection: sa.Connection) -> tuple[NameCorrection, ...]:
    """Oldest first, as they hold in other scenes than the one they were said in."""
    columns = tables.feedback.c
    short = sa.func.length(columns.words) <= LONGEST_WORDS
    marked = sa.and_(short, sa.or_(*(columns.words.ilike(mark) for mark in _MARKS)))
    found: list[NameCorrection] = []
    for one in queries.feedback_where(connection, columns.kind == "correction", marked, columns.scene_graph != ""):
        try:
            scene, about = read_scene_table(one.scene_graph), Key.parse(one.subtask).objects
        except (NotASceneTable, NotAKey):
            continue  # written by another program: there is no thing to go by
        found += [said.elsewhere() for said in read_name_corrections(one.words, scene, one.who, about)]
    return tuple(found)
