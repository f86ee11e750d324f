"""Books with templates of which one function can be made, for the tests of functions."""

from __future__ import annotations

import ast
import json
from collections import Counter
from typing import Any

from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, merge_programs
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import as_template
from tests.support.cluster_books import approve

MICROWAVE, OVEN, FRIDGE = KEYS = ("OPEN(microwave)", "OPEN(oven)", "OPEN(fridge)")


def program(thing: str, angle: int = 85, name: str = "open_hinged", said: str = "Open a door on a hinge.") -> str:
    """The code of a template; those of two things differ in defaults only."""
    return (
        f'def {name}(door="{thing} door", angle={angle}):\n    """{said}"""\n'
        "    take_handle(door)\n    lead_along_arc(door, angle)\n    look()\n"
    )


def teach_doors(book: Skillbook, *keys: str, who: tuple[str, ...] = ("ana", "ben", "cleo")) -> list[int]:
    """A template a key, each approved by another person; the entries' ids."""
    things = [key[key.index("(") + 1 : -1] for key in keys or (MICROWAVE, OVEN)]
    return [
        approve(book, key, program(thing), person)
        for key, thing, person in zip(keys or (MICROWAVE, OVEN), things, who, strict=False)
    ]


def merged(book: Skillbook, **given: bool) -> int:
    """Make one function; the revision."""
    [made] = merge_programs(book, (), **given)
    assert made.revision is not None
    return made.revision


def approve_call(book: Skillbook, key: str, call: str, who: str = "cleo", function: int | None = None) -> Entry:
    """Approve a program that was one call of the book's only function, or of ``function``."""
    called = functions_of(book)[0].entry.id if function is None else function
    return book.add_call(book.record_feedback("", who, subtask=key, kind="approval"), key, call, called)


def active(book: Skillbook) -> list[tuple[str, str, str]]:
    """Kind, key and text of every active program and function."""
    return [(e.kind, str(e.key), e.text) for e in book.entries() if e.kind in ("template", "function", "call")]


def tree(code: str) -> str:
    """A program's code without name and docstring, for comparing what it does."""
    parsed = ast.parse(code)
    [function] = [node for node in parsed.body if isinstance(node, ast.FunctionDef)]
    function.name, function.body = "", function.body[1:]
    return ast.dump(parsed)


def programs(book: Skillbook) -> dict[str, set[str]]:
    """List by key the trees of the active programs; every call must have an active function."""
    function_of = {call.id: one.entry.text for one in functions_of(book) for call in one.calls}
    found: dict[str, set[str]] = {}
    for entry in book.entries():
        if entry.kind in ("template", "call"):
            code = entry.text if entry.kind == "template" else as_template(function_of[entry.id], entry.text)
            found.setdefault(str(entry.key), set()).add(tree(code))
    return found


def exported(book: Skillbook) -> list[dict[str, Any]]:
    """The book's export as a file holds it."""
    return [json.loads(json.dumps(record)) for record in exchange.export(book)]


def content(book: Skillbook) -> dict[str, Counter[tuple[object, ...]]]:
    """The contents of a book, without numbers."""
    records = exported(book)
    said = {r["id"]: (r["words"], r["who"], r["subtask"], r["kind"]) for r in records if r["record"] == "feedback"}
    entries = {r["id"]: r for r in records if r["record"] == "entry"}
    texts = {number: record["text"] for number, record in entries.items()}
    return {
        "feedback": Counter(said.values()),
        "entries": Counter(
            (
                *(r[name] for name in ("kind", "action", "text", "scene", "uses")),
                *(tuple(r["objects"]), r["superseded_by"] is None),
                tuple(sorted(said[source] for source in r["sources"])),
                tuple(sorted(texts[function] for function in r.get("calls", ()))),
                tuple(sorted(map(tuple, r.get("keys", ())))),
            )
            for r in entries.values()
        ),
        "uses": Counter(
            (texts[r["entry"]], r["action"], tuple(r["objects"]), r["uses"]) for r in records if r["record"] == "uses"
        ),
    }
