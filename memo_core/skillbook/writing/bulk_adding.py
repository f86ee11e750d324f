"""Adding many lessons in one durable transaction, which is much faster than one transaction per lesson."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.errors import InvalidArgument
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.writing import templates


def _said(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    if not value.strip():
        raise InvalidArgument(attribute.name, "nothing is there", "a text")


def _texts(instance: object, attribute: attrs.Attribute[tuple[str, ...]], value: tuple[str, ...]) -> None:
    if not all(text.strip() for text in value):
        raise InvalidArgument(attribute.name, "an entry without text", "a text")


@attrs.frozen
class Lesson:
    """One piece of feedback and the entries made from it."""

    words: str = attrs.field(validator=_said)
    who: str = attrs.field(validator=_said)
    key: Key
    corrections: tuple[str, ...] = attrs.field(default=(), validator=_texts)
    general: tuple[str, ...] = attrs.field(default=(), validator=_texts)
    template: str = ""  # code that was approved; "" for none
    task: str = ""
    scene: str = ""
    when: float | None = None  # s since the epoch; now


def add_lessons(database: Database, connection: sa.Connection, lessons: Sequence[Lesson]) -> int:
    """Store lessons inside a write transaction: all or none. Returns the number of entries."""
    now, upsert = database.now(), database.upsert(tables.keys)
    key_id = cache(lambda key: queries.key_id(connection, upsert, key))
    said = _insert(connection, tables.feedback, [_feedback(lesson, now) for lesson in lessons])
    items = []  # feedback, key id, phase, kind, text, ordinal, scene
    for feedback, lesson in zip(said, lessons, strict=True):
        ordinal = 0
        for kind, texts in (("correction", lesson.corrections), ("general", lesson.general)):
            for text in texts:
                under = key_id(GLOBAL_KEY if kind == "general" else lesson.key)
                items.append((feedback, under, "feedback", kind, text, ordinal, lesson.scene))
                ordinal += 1
        if lesson.template.strip():
            items.append((feedback, key_id(lesson.key), "template", "template", lesson.template, 0, lesson.scene))
    wanted = list(dict.fromkeys((feedback, key, phase) for feedback, key, phase, *_ in items))
    created = database.time_of_entry(connection)
    made = _insert(
        connection,
        tables.revisions,
        [{"key": key, "time": now, "reason": f"{phase} {feedback}"} for feedback, key, phase in wanted],
    )
    revision_of = dict(zip(wanted, made, strict=True))
    entries = _insert(
        connection,
        tables.entries,
        [
            {
                "kind": kind,
                "key": key,
                "text": text,
                "scene": scene,
                "feedback": feedback,
                "phase": phase,
                "ordinal": ordinal,
                "revision": revision_of[feedback, key, phase],
                "superseded_by": None,
                "uses": 0,
                "confirmed_uses": 0,
                "created": created,
            }
            for feedback, key, phase, kind, text, ordinal, scene in items
        ],
    )
    if entries:
        links = [{"entry": entry, "feedback": item[0]} for entry, item in zip(entries, items, strict=True)]
        connection.execute(sa.insert(tables.sources), links)
        newest = {
            key: (revision_of[feedback, key, phase], entry)
            for entry, (feedback, key, phase, kind, *_) in zip(entries, items, strict=True)
            if kind == "template"
        }
        for key, (revision, entry) in newest.items():
            templates.succeed(connection, key, revision, entry)
        database.next_generation(connection)
    return len(entries)


def _feedback(lesson: Lesson, now: float) -> dict[str, Any]:
    return {
        "kind": "correction",
        "words": lesson.words,
        "who": lesson.who,
        "time": now if lesson.when is None else lesson.when,
        "task": lesson.task,
        "subtask": str(lesson.key),
        "scene": lesson.scene,
        "scene_graph": "",
        "code": lesson.template,
        "run": "",
        "status": "processed",
        "reason": "",
    }


def _insert(connection: sa.Connection, table: sa.Table, values: list[dict[str, Any]]) -> list[int]:
    """Rows in order; their ids."""
    if not values:
        return []
    statement = sa.insert(table).returning(table.c.id, sort_by_parameter_order=True)
    return queries.ids_of(connection.execute(statement, values))
