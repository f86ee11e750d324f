"""Validating the records of another book before they are used."""

from __future__ import annotations

import json
import tempfile
from array import array
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import attrs

from memo_core.errors import MemoError
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.skillbook.model.functions import NotACall, NotAFunction, problem_with_call, read_call, read_function
from memo_core.skillbook.model.keys import Key, NotAKey
from memo_core.skillbook.sharing.export import COUNTED, FORMAT
from memo_core.skillbook.store.origins import Origin

When = tuple[float, str, str]  # of a revision: its time, and its origin for those of one time

_LARGEST = 2**63 - 1  # what a database holds
_LAST_TIME = 253_402_300_799.0  # s since the epoch: the last second of the year 9999


@attrs.define(auto_exc=True, eq=False)
class BadImport(MemoError):
    """Invalid records of a book. ``record`` counts from 1 and is the line number in a file."""

    record: int
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        return f"record {self.record}: {self.problem}" if self.record else self.problem


class ImportRecords:
    """The records of a file by kind, validated and stored in a temporary file; memory holds only an offset and an id
    for each. Raises ``BadImport``."""

    def __init__(self, records: Iterable[dict[str, Any]]) -> None:
        self._spool = tempfile.TemporaryFile("w+b", prefix="memo-import-")  # noqa: SIM115 - it lives as long as this
        self._places: dict[str, array[int]] = {}  # kind -> where its records begin in the spool
        self._revisions: dict[int, int] = {}  # id -> where its record begins
        for number, record in enumerate(records, start=1):
            kind = record.get("record") if isinstance(record, dict) else None
            if number == 1 and kind != "book":
                raise BadImport(1, "it does not begin with a book; expected what `memo skillbook export` writes")
            if not isinstance(kind, str) or kind not in _FIELDS:
                known = ", ".join(_FIELDS)
                raise BadImport(number, f"{str(kind)[:40]!r} is no kind of record; expected one of {known}")
            if kind == "book" and number > 1:
                raise BadImport(number, "a second book; a file holds one")
            _check(number, record)
            place = self._spool.tell()
            kept = {name: record[name] for name in ("record", *_FIELDS[kind], *_OPTIONAL) if name in record}
            self._spool.write(json.dumps(kept).encode() + b"\n")
            self._places.setdefault(kind, array("Q")).append(place)
            if kind == "revision":
                self._revisions[record["id"]] = place
        if not self._places:
            raise BadImport(0, "there is nothing in it")
        [book] = self.of("book")
        if not 1 <= book["format"] <= FORMAT:
            raise BadImport(1, f"it has format {book['format']}, this MEMO reads 1 to {FORMAT}; update memo-core")
        self.book: str = book["book"]
        self._check_counts()
        self._check_references()
        self.functions = {record["id"]: record for record in self.of("entry") if record["kind"] == "function"}
        self._check_calls()

    def of(self, kind: str) -> Iterator[dict[str, Any]]:
        """The records of a kind in their order, read one at a time."""
        for place in self._places.get(kind, ()):
            yield self._at(place)

    def has(self, kind: str) -> bool:
        return kind in self._places

    def revision(self, number: int) -> dict[str, Any]:
        return self._at(self._revisions[number])

    def _at(self, place: int) -> dict[str, Any]:
        self._spool.seek(place)
        record: dict[str, Any] = json.loads(self._spool.readline())
        return record

    def origin(self, record: dict[str, Any]) -> Origin:
        book, number = record.get("origin") or (self.book, record["id"])
        return str(book), str(number)

    def when(self, revision: int) -> When:
        record = self.revision(revision)
        return (record["time"], *self.origin(record))

    def _check_counts(self) -> None:
        for kind, expected in (self._at(0).get("counts") or {}).items():
            if (found := len(self._places.get(kind, ()))) != expected:
                problem = f"{found} records of kind {kind!r} where the first one says {expected}"
                raise BadImport(0, f"lines are missing or added: {problem}; export the book again")

    def _check_calls(self) -> None:
        """Every call must be one that the functions it calls accept."""
        for record in self.of("entry"):
            for number in record.get("calls") or () if record["kind"] == "call" else ():
                function = self.functions.get(number)
                problem = f"{number} is no function in the file" if function is None else ""
                if function is not None:
                    problem = problem_with_call(read_function(function["text"]), read_call(record["text"]))
                if problem:
                    raise BadImport(0, f"entry {record['id']}: calls: {problem}")
            if record["kind"] == "call" and not record.get("calls"):
                raise BadImport(0, f"entry {record['id']}: a call without the function that it calls")

    def _check_references(self) -> None:
        entries = {record["id"] for record in self.of("entry")}
        for kind, name, there in (
            ("entry", "revision", self._revisions),
            ("entry", "superseded_by", self._revisions),
            ("change", "revision", self._revisions),
            ("change", "entry", entries),
            ("uses", "entry", entries),
        ):
            for record in self.of(kind):
                if record[name] is not None and record[name] not in there:
                    raise BadImport(0, f"{kind} {record.get('id', '')}: {name} {record[name]} is not in the file")
        for kind in ("feedback", "revision", "entry"):
            seen: set[int] = set()
            for record in self.of(kind):
                if record["id"] in seen:
                    raise BadImport(0, f"{kind} {record['id']} is there twice")
                seen.add(record["id"])


def key_of(record: dict[str, Any]) -> Key:
    """The key of a record. Raises ``NotAKey``."""
    if not record["action"] and not record["objects"]:
        return GLOBAL_KEY
    return Key.make(record["action"], *record["objects"])


def phase_of(record: dict[str, Any]) -> str:
    """The phase that made an entry; format 1 does not store it."""
    return str(record.get("phase") or KINDS[record["kind"]])


# -- what each field may be --------------------------------------------------------------------------------------------
KINDS = {
    "correction": "feedback",
    "general": "feedback",
    "template": "template",
    "function": "function",
    "call": "function",
}
Check = Callable[[Any], bool]


def _text(value: Any) -> bool:
    if not isinstance(value, str) or "\0" in value:
        return False
    try:
        value.encode()
    except UnicodeEncodeError:  # half a character, which no database takes
        return False
    return True


def _said(value: Any) -> bool:
    return _text(value) and bool(value.strip())


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _LARGEST


def _maybe_whole(value: Any) -> bool:
    return value is None or _whole(value)


def _time(value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and 0 <= value <= _LAST_TIME  # false for NaN, too


def _name(value: Any) -> bool:
    return _said(value) and len(value) <= 100


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(_text(item) for item in value)


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_whole(item) for item in value)


def _origin(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(_name(o) or _whole(o) for o in value)


def _spelling(value: Any) -> bool:
    try:
        return _text(value) and bool(Key.parse(value))
    except NotAKey:
        return False


def _one_of(*names: str) -> Check:
    return lambda value: isinstance(value, str) and value in names


def _keys(value: Any) -> bool:
    try:
        return isinstance(value, list) and all(_texts(one) and Key.make(*one) for one in value)
    except (NotAKey, TypeError):  # no action, no object, or neither
        return False


_KEYED: dict[str, Check] = {"action": _text, "objects": _texts}


def _counts(value: Any) -> bool:
    return isinstance(value, dict) and all(kind in COUNTED and _whole(count) for kind, count in value.items())


_FIELDS: dict[str, dict[str, Check]] = {
    "book": {"format": _whole, "book": _name},
    "imported": {"book": _name},
    "feedback": {
        "id": _whole,
        "kind": _one_of("correction", "approval", "edit"),
        "who": _said,
        "time": _time,
        "status": _one_of("pending", "parked", "kept", "processed"),
        **dict.fromkeys(("words", "task", "subtask", "scene", "scene_graph", "code", "run", "reason"), _text),
    },
    "alias": {"spelling": _spelling, **_KEYED},
    "revision": {"id": _whole, "time": _time, "reason": _text},
    "entry": {
        "id": _whole,
        "kind": _one_of(*KINDS),
        "text": _said,
        "scene": _text,
        "feedback": _maybe_whole,
        "revision": _whole,
        "superseded_by": _maybe_whole,
        "uses": _whole,
        "confirmed_uses": _whole,
        "created": _time,
        "sources": _numbers,
        **_KEYED,
    },
    "change": {
        "revision": _whole,
        "entry": _whole,
        "change": _one_of("superseded", "restored", "joined"),
        "why": _text,
        "because": _maybe_whole,
    },
    "read_back": {
        "feedback": _whole,
        "entry": _maybe_whole,
        "who": _said,
        "time": _time,
        "outcome": _one_of("accepted", "reworded", "struck"),
        "note": _text,
        "text": _text,
    },
    "uses": {"entry": _whole, "uses": _whole, "confirmed_uses": _whole, **_KEYED},
    "withdrawn": {"kind": _text, "origin": _origin},
}
_OPTIONAL: dict[str, Check] = {
    "origin": _origin,
    "phase": _one_of("feedback", "template", "cluster", "edit", "function"),
    "calls": _numbers,
    "keys": _keys,
    "ordinal": _whole,
    "counts": _counts,
}


def _check(number: int, record: dict[str, Any]) -> None:
    kind = record["record"]
    for name, right in _FIELDS[kind].items():
        if name not in record:
            raise BadImport(number, f"{kind}: {name}: it is missing")
        if not right(record[name]):
            raise _wrong(number, record, name)
    for name, right in _OPTIONAL.items():
        if record.get(name) is not None and not right(record[name]):
            raise _wrong(number, record, name)
    if kind == "entry":
        try:
            {"function": read_function, "call": read_call}.get(record["kind"], str)(record["text"])
        except (NotAFunction, NotACall) as error:
            raise BadImport(number, f"entry: text: {error}") from None
    if "objects" in _FIELDS[kind]:
        try:
            key_of(record)
        except NotAKey as error:
            raise BadImport(number, f"{kind}: {error}") from None


def _wrong(number: int, record: dict[str, Any], name: str) -> BadImport:
    if name == "origin":
        return BadImport(number, f"{record['record']}: origin: expected [book, number]")
    shown = str(record[name])[:40].encode("ascii", "backslashreplace").decode()
    return BadImport(number, f"{record['record']}: {name}: {shown!r} is wrong")
