"""Forgetting a person in files: removing their words from the files that the book has registered.

Copies that MEMO cannot find (files that were moved or sent, books that others imported, a server's backups, data at a
model's provider) are reported, so that a person can remove them.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError, UnknownName
from memo_core.skillbook.forgetting.scrubbing import Scrubber
from memo_core.skillbook.model.functions import as_template
from memo_core.skillbook.store.known_copies import Place
from memo_core.skillbook.writing.adding import CLUSTER, EDIT, FUNCTION
from memo_core.text.parsing import parse_json

BEYOND = (
    "copies of the book, its exports, run folders and recordings that were moved, sent or made by hand",
    "run folders of runs and evaluations that could only read the book: name them with --in",
    "books into which an export was imported (their next import of this book's export withdraws the words there)",
    "what the providers of language models keep of the prompts",
)
BEYOND_SERVER = "the database server's backups, write-ahead logs and dead rows"


@attrs.define
class Cleaned:
    """What was changed outside the book: rewritten files, deleted backups, and what could not be reached."""

    rewritten: list[str] = attrs.field(factory=list)
    deleted: list[str] = attrs.field(factory=list)
    unreached: list[str] = attrs.field(factory=list)  # path and reason


def clean(places: Iterable[Place], who: str, words: Iterable[str], forget_in: Callable[[Path], None]) -> Cleaned:
    """Clean all places. ``forget_in`` forgets the person in another book; it raises ``UnknownName`` if that book has
    nothing from them."""
    scrubber, cleaned = Scrubber(words), Cleaned()
    for place in places:
        if not place.path.exists():
            cleaned.unreached.append(f"{place.path}: {place.kind} is not there any more; was it moved?")
            continue
        try:
            _place(place, who, scrubber, forget_in, cleaned)
        except (OSError, MemoError) as error:
            cleaned.unreached.append(f"{place.path}: {getattr(error, 'strerror', None) or error}")
    return cleaned


def _place(place: Place, who: str, scrubber: Scrubber, forget_in: Callable[[Path], None], cleaned: Cleaned) -> None:
    if place.kind == "backup":
        for file in sorted(place.path.parent.glob(place.path.name + "*")):
            file.unlink()
        cleaned.deleted.append(str(place.path))
        return
    if place.kind == "book":
        try:
            forget_in(place.path)
        except UnknownName:
            return
        cleaned.rewritten.append(str(place.path))
        return
    changed = set()
    if place.kind == "export":
        changed |= {place.path} if _rewrite(place.path, lambda lines: _export_without(lines, who)) else set()
    for file in sorted(place.path.glob("**/words/*.jsonl")) if place.path.is_dir() else ():
        if _rewrite(file, lambda lines: [line for line in lines if line.get("who") != who]):
            changed.add(file)
    scrubbed = scrubber.path(place.path)
    cleaned.rewritten += sorted(map(str, changed | set(scrubbed.rewritten)))
    cleaned.unreached += scrubbed.unreached


def _rewrite(file: Path, change: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> bool:
    """Rewrite a file of JSON objects, one per line. Returns whether anything changed. Lines that are not JSON objects
    are left to scrubbing."""
    text = file.read_text(encoding="utf-8", errors="replace")
    try:
        before = [parse_json(line) for line in text.splitlines() if line.strip()]
    except ValueError:
        return False
    if not all(isinstance(line, dict) for line in before):
        return False
    after = change(before)
    if after == before:
        return False
    temporary = file.with_name(f".{file.name}.new")
    temporary.write_text("".join(json.dumps(line, ensure_ascii=False) + "\n" for line in after), encoding="utf-8")
    temporary.replace(file)
    return True


def _export_without(records: list[dict[str, Any]], who: str) -> list[dict[str, Any]]:
    """Rewrite an export as the book would write it after the person was forgotten."""
    theirs = {one["id"]: one for one in records if one.get("record") == "feedback" and one.get("who") == who}
    if not theirs:
        return records
    book = str(records[0].get("book", ""))
    entries = [one for one in records if one.get("record") == "entry"]
    made_with = {one["id"]: set(one["sources"]) for one in entries if one["kind"] == "function"}
    gone = {one["id"] for one in entries if _goes(one, set(theirs), made_with)}
    touched = {
        one["revision"] for one in records if one.get("record") == "change" and gone & {one["entry"], one["because"]}
    }
    gave_way = {
        (one["entry"], one["revision"])
        for one in records
        if one.get("record") == "change" and one.get("because") in gone and one["change"] == "superseded"
    }
    kept = []
    for one in records:
        kind = one.get("record")
        if kind == "feedback" and one["id"] in theirs:
            continue
        if kind == "entry" and one["id"] in gone:
            continue
        if kind in ("change", "uses") and one["entry"] in gone:
            continue
        if kind == "change" and (one["entry"], one["revision"]) in gave_way:
            continue
        if kind == "read_back" and (one["feedback"] in theirs or one["who"] == who):
            continue
        if kind == "entry":
            back = (one["id"], one["superseded_by"]) in gave_way
            one = one | {
                "sources": [source for source in one["sources"] if source not in theirs],
                "feedback": None if one["feedback"] in theirs else one["feedback"],
                "superseded_by": None if back else one["superseded_by"],
            }
        if kind == "change" and one["revision"] in touched and one["change"] != "joined":
            one = one | {"why": ""}  # it may quote the entry
        kept.append(one)
    _calls_to_templates(kept, {one["id"]: one for one in entries})
    if (counts := kept[0].get("counts")) is not None:
        left = Counter(str(one.get("record")) for one in kept)
        kept[0] = kept[0] | {"counts": {kind: left[kind] for kind in counts}}
    origins = [one.get("origin") or [book, str(one["id"])] for one in theirs.values()]
    return kept + [{"record": "withdrawn", "kind": "feedback", "origin": origin} for origin in origins]


def _goes(entry: dict[str, Any], theirs: set[int], made_with: dict[int, set[int]]) -> bool:
    sources = set(entry["sources"])
    if not sources & theirs:
        return False
    mine = entry.get("phase") == EDIT and entry["feedback"] in theirs
    of_function = {source for function in entry.get("calls") or () for source in made_with.get(function, ())}
    approved_since = entry["kind"] == "call" and sources - theirs - of_function
    several = entry.get("phase") in (CLUSTER, FUNCTION) and not approved_since
    return mine or several or sources <= theirs


def _calls_to_templates(kept: list[dict[str, Any]], before: dict[int, dict[str, Any]]) -> None:
    """Make templates of calls that have no function left, or are active without an active one."""
    left = {one["id"]: one["superseded_by"] is None for one in kept if one.get("record") == "entry"}
    for place, one in enumerate(kept):
        if one.get("record") != "entry" or one["kind"] != "call":
            continue
        calls = [function for function in one.get("calls") or () if function in left]
        if any(left[function] for function in calls) or (calls and not left[one["id"]]):
            kept[place] = one | {"calls": calls}
        elif one.get("calls"):
            text = as_template(before[max(one["calls"])]["text"], one["text"])
            kept[place] = {name: value for name, value in one.items() if name != "calls"}
            kept[place] |= {"kind": "template", "text": text}
