"""Books of the paper authors' public code: a pickle of ``{"vectors": [...], "metadata": [{"key": "", "value": ""}]}``.

A key is ``ACTION(objects) scene objects…`` for a correction, ``GENERAL scene objects…`` for a general statement, or
``TEMPLATE ACTION(objects)`` for code. They are converted to the records of a book and merged like any book: an entry is
identified by a digest of its key and text, and reading a file again, even a longer version of it, adds only what is
new.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from typing import Any

import attrs

from memo_core.errors import MemoError
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.skillbook.model.keys import Key, NotAKey
from memo_core.skillbook.sharing.export import FORMAT
from memo_core.skillbook.sharing.safe_pickle import Opaque, load, looks_like_pickle
from memo_core.text.parsing import parse_json

BOOK = "lorebook"  # all of them count as one book: what stands in two of them is one entry
_KEYED = re.compile(r"\s*(TEMPLATE\b)?([^()]*\([^()]*\))(.*)", re.DOTALL)
_GENERAL = re.compile(r"\s*GENERAL\b(.*)", re.DOTALL)
_SHOWN = 5


@attrs.define(auto_exc=True, eq=False)
class NotALorebook(MemoError):
    """Plain data that is not a lorebook. ``where`` is the path to the error, such as ``["metadata"][3]``."""

    where: str
    problem: str

    def __str__(self) -> str:
        return f"this is not a lorebook: {self.where or 'the whole'} {self.problem}"


@attrs.frozen
class Lorebook:
    """The contents of a file as the records of a book, and what was skipped."""

    records: tuple[dict[str, Any], ...]
    items: int
    corrections: int
    general: int
    templates: int
    keys: int  # different keys of corrections and templates
    spellings: int  # in which they were written
    empty: int  # without a text
    repeated: int  # the same text under the same key once more
    unread: tuple[str, ...]  # keys that name no action with its objects, the first few
    unread_count: int
    vectors: int  # how many there are; they are not used, texts are embedded by this book's own embedder


def format_of(start: bytes) -> str | None:
    """The format of a file by its ``start``: "memo", a book of MEMO; "lorebook", a pickle or one JSON object with
    "metadata" or "vectors"; or None."""
    if not start.strip():
        return "memo"  # there is nothing in it
    if not _begins_json(start):
        return "lorebook" if looks_like_pickle(start) else None
    text = start.decode(json.detect_encoding(start), "replace").lstrip("\ufeff \t\r\n")
    if not text.startswith("{"):
        return None
    first = text.splitlines()[0]
    named = '"metadata"' in text or '"vectors"' in text
    return "lorebook" if named and '"record"' not in first else "memo"


def _begins_json(data: bytes) -> bool:
    """Whether data that is no text is excluded: no pickle begins like this."""
    return data.lstrip()[:1] in (b"{", b"[") or data.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"))


def _from_json(data: bytes) -> Any:
    try:
        return parse_json(data)
    except ValueError as error:
        raise NotALorebook("", f"is no JSON ({str(error)[:80]})") from None


def read_lorebook(data: bytes, who: str, when: float) -> Lorebook:
    """Read a lorebook, a pickle or the same as JSON. ``who`` taught it (for `forget`); ``when``: the time it gets, s
    since the epoch.

    Raises ``UnsafePickle`` for anything but plain data, ``NotALorebook``.
    """
    book = _from_json(data) if _begins_json(data) else load(data)
    if not isinstance(book, dict) or not isinstance(book.get("metadata"), (list, tuple)):
        raise NotALorebook("", 'has no list "metadata"')
    items = book["metadata"]
    vectors = _count_of_vectors(book.get("vectors", ()), len(items))
    reading = _Reading(who, when)
    for place, item in enumerate(items):
        if not isinstance(item, dict) or not isinstance(item.get("key"), str):
            raise NotALorebook(f'["metadata"][{place}]', 'has no text "key"')
        if not isinstance(item.get("value"), (str, type(None))):
            raise NotALorebook(f'["metadata"][{place}]["value"]', f"is a {type(item['value']).__name__}, not a text")
        reading.item(item["key"], item.get("value") or "")
    return reading.finished(len(items), vectors)


class _Reading:
    def __init__(self, who: str, when: float) -> None:
        self._who, self._when = who, when
        self._records: list[dict[str, Any]] = []
        self._seen: set[str] = set()
        self._spellings: dict[str, Key] = {}
        self._counts: Counter[str] = Counter()
        self._unread: list[str] = []

    def item(self, written: str, text: str) -> None:
        if not text.strip():
            self._counts["empty"] += 1
            return
        text = text.encode("utf-8", "replace").decode().replace("\0", "")  # no database takes half characters
        found = _parse(written)
        if found is None:
            self._unread.append(written)
            return
        kind, key, spelling, scene = found
        if kind != "general":
            self._spellings[spelling] = key
        digest = hashlib.sha256(f"{kind}\n{key}\n{text}".encode()).hexdigest()[:32]
        if digest in self._seen:
            self._counts["repeated"] += 1
            return
        self._seen.add(digest)
        self._counts[kind] += 1
        self._records += self._made(digest, kind, key, text, scene)

    def finished(self, items: int, vectors: int) -> Lorebook:
        book = {"record": "book", "format": FORMAT, "book": BOOK}
        return Lorebook(
            records=(book, *self._records),
            items=items,
            corrections=self._counts["correction"],
            general=self._counts["general"],
            templates=self._counts["template"],
            keys=len(set(self._spellings.values())),
            spellings=len(self._spellings),
            empty=self._counts["empty"],
            repeated=self._counts["repeated"],
            unread=tuple(self._unread[:_SHOWN]),
            unread_count=len(self._unread),
            vectors=vectors,
        )

    def _made(self, digest: str, kind: str, key: Key, text: str, scene: str) -> list[dict[str, Any]]:
        number = len(self._seen)
        subtask = "" if key == GLOBAL_KEY else str(key)
        template = kind == "template"
        origin = {"id": number, "origin": [BOOK, digest]}
        feedback = {
            "record": "feedback",
            **origin,
            "kind": "approval" if template else "correction",
            "words": "" if template else text,
            "who": self._who,
            "time": self._when,
            "task": "",
            "subtask": subtask,
            "scene": scene,
            "scene_graph": "",
            "code": text if template else "",
            "run": "",
            "status": "processed",
            "reason": "read from a lorebook: a paraphrase, the person's own words are not in it",
        }
        phase = "template" if template else "feedback"
        revision = {"record": "revision", **origin, "time": self._when, "reason": f"{phase} of a lorebook"}
        entry = {
            "record": "entry",
            **origin,
            "kind": kind,
            "action": key.action,
            "objects": list(key.objects),
            "text": text,
            "scene": scene,
            "feedback": number,
            "phase": phase,
            "ordinal": 0,
            "revision": number,
            "superseded_by": None,
            "uses": 0,
            "confirmed_uses": 0,
            "created": self._when,
            "sources": [number],
        }
        return [feedback, revision, entry]


def _parse(written: str) -> tuple[str, Key, str, str] | None:
    """Kind, key, the key as it was spelt, and the scene."""
    general = _GENERAL.fullmatch(written)
    if general:
        return "general", GLOBAL_KEY, "", _scene(general[1])
    match = _KEYED.fullmatch(written)
    if not match:
        return None
    try:
        key = Key.parse(match[2])
    except NotAKey:
        return None
    return ("template" if match[1] else "correction"), key, match[2].strip(), _scene(match[3])


def _scene(text: str) -> str:
    return " ".join(text.split())


def _count_of_vectors(vectors: Any, items: int) -> int:
    """Count the vectors. Raises ``NotALorebook`` unless there is none, or one for each item."""
    if isinstance(vectors, Opaque):  # an array
        return items
    if not isinstance(vectors, (list, tuple)):
        raise NotALorebook('["vectors"]', f"is a {type(vectors).__name__}, not a list")
    if len(vectors) not in (0, items):
        raise NotALorebook('["vectors"]', f"has {len(vectors)} items, metadata has {items}")
    return len(vectors)
