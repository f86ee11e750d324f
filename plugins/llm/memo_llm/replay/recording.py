"""The file of a recording: JSON lines, appended and flushed to disk call by call.

    {"memo_recording": 1}
    {"image": "<sha-256>", "media_type": "image/png", "data": "<base64>"}       once for each picture, before its call
    {"call": {"phase": …, "seed": …, "schema": …, "messages": [{"role", "text", "images"?: ["<sha-256>", …]}, …]},
     "answer": {"text", "finish", "model", "not_understood", "note", "usage": {…}} or null,
     "error": {"problem", "retryable", "cause", "usage"} or null, "abandoned": false}

The last line of a process that was killed may be half a line: it is ignored when reading and removed before appending.
"""

from __future__ import annotations

import base64
import gzip
import json
import os
import threading
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import attrs

from memo_core.plugin import (
    Answer,
    Cause,
    Image,
    InvalidArgument,
    LanguageModelError,
    MemoError,
    Message,
    Request,
    Usage,
    parse_json,
    read_as,
)

VERSION = 1
_ALWAYS_FITS = 64 << 20  # bytes
_MOST_COMPRESSED = 300  # times; recordings come to a tenth of that
_HEADER = {"memo_recording": VERSION}


@attrs.define(auto_exc=True, eq=False)
class BadRecording(MemoError):
    """A recording that cannot be read: which file, which line (0: the file as a whole), why."""

    file: str
    line: int
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        return f"recording {self.file}{f', line {self.line}' if self.line else ''}: {self.problem}"


@attrs.frozen(eq=False)
class Call:
    """One recorded question with its answer or error. ``abandoned``: its result was not waited for."""

    request: Request
    answer: Answer | None
    error: LanguageModelError | None = None
    abandoned: bool = False


def read_recording(path: Path) -> list[Call]:
    """All calls in the order in which they ended. Raises ``BadRecording``."""
    lines = _lines(path)
    if not lines:
        raise BadRecording(str(path), 0, "it is empty")
    calls: list[Call] = []
    images: dict[str, Image] = {}
    for number, line in enumerate(lines, start=1):
        try:
            record = parse_json(line)
            if number == 1:
                _check_header(path, record)
            elif "image" in record:
                images[str(record["image"])] = Image(base64.b64decode(record["data"]), str(record["media_type"]))
            else:
                calls.append(_call(record, images))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if number == len(lines) > 1 and not line.endswith(b"\n"):
                break  # half a line: whoever wrote it was killed
            what = f"it lacks {error}" if isinstance(error, KeyError) else f"{error}"
            raise BadRecording(str(path), number, f"this is not a recorded call ({what})") from None
    return calls


def _lines(path: Path) -> list[bytes]:
    if path.exists() and not path.is_file():
        raise BadRecording(str(path), 0, "it is not a file")  # a device may have no end
    try:
        data = _decompressed(path) if path.suffix == ".gz" else path.read_bytes()
    except (OSError, EOFError, zlib.error) as error:
        raise BadRecording(str(path), 0, getattr(error, "strerror", None) or str(error)) from None
    return data.splitlines(keepends=True)


def _decompressed(path: Path) -> bytes:
    """Raises ``BadRecording`` for a small file that would decompress to an excessive size."""
    pieces, size = [], 0
    most = max(_ALWAYS_FITS, _MOST_COMPRESSED * path.stat().st_size)
    with gzip.open(path) as file:
        while piece := file.read(1 << 20):
            pieces.append(piece)
            size += len(piece)
            if size > most:
                raise BadRecording(str(path), 0, f"it holds more than {_MOST_COMPRESSED} times its size")
    return b"".join(pieces)


def _check_header(path: Path, record: Any) -> None:
    version = record.get("memo_recording") if isinstance(record, dict) else None
    if version is None:
        raise BadRecording(str(path), 1, f"this is not a recording; its first line would be {json.dumps(_HEADER)}")
    if version != VERSION:
        raise BadRecording(str(path), 1, f"it is of version {version}; this MEMO reads version {VERSION}")


@attrs.frozen
class _Message:
    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[str, ...] = ()


@attrs.frozen
class _Asked:
    phase: str
    messages: tuple[_Message, ...]
    schema: dict[str, Any] | None
    seed: int | None


@attrs.frozen
class _Failed:
    problem: str
    retryable: bool
    usage: Usage | None
    cause: Cause = ""


def _call(record: dict[str, Any], images: dict[str, Image]) -> Call:
    call, answered, failure, abandoned = (record[name] for name in ("call", "answer", "error", "abandoned"))
    asked = read_as(_Asked, call)
    if missing := sorted({digest for m in asked.messages for digest in m.images} - images.keys()):
        raise ValueError(f"its picture {missing[0]} is not in the file")
    messages = tuple(Message(m.role, m.text, tuple(images[digest] for digest in m.images)) for m in asked.messages)
    request = Request(asked.phase, messages, asked.schema, asked.seed)
    if answered is not None:
        return Call(request, read_as(Answer, answered), None, abandoned is True)
    failed = read_as(_Failed, failure)
    error = LanguageModelError("replay", failed.problem, failed.retryable, usage=failed.usage, cause=failed.cause)
    return Call(request, None, error, abandoned is True)


class RecordingFile:
    """A recording that is appended to. Safe to use from several threads, also after the run has ended, since late
    answers of abandoned calls may still arrive."""

    def __init__(self, path: Path, clean: Callable[[str], str] = lambda text: text) -> None:
        """Opens or creates the file. ``clean`` removes secrets from every text. Raises ``BadRecording`` for a file of
        something else, ``InvalidArgument`` where it cannot be written."""
        self._path = path
        self._clean = clean
        self._lock = threading.Lock()
        self._images: set[str] = set()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists() and path.stat().st_size:
                for call in read_recording(path):
                    self._images |= {image.digest for m in call.request.messages for image in m.images}
                _cut_half_line(path)
            else:
                self._write([_HEADER])
        except OSError as error:
            raise InvalidArgument(
                "file", f"{path} cannot be written: {error.strerror}", "a file to record to"
            ) from None

    def add(self, call: Call) -> None:
        """On disk when this returns."""
        with self._lock:
            records: list[dict[str, Any]] = []
            for message in call.request.messages:
                for image in message.images:
                    if image.digest not in self._images:
                        self._images.add(image.digest)
                        data = base64.b64encode(image.data).decode()
                        records.append({"image": image.digest, "media_type": image.media_type, "data": data})
            self._write([*records, self._record(call)])

    def _record(self, call: Call) -> dict[str, Any]:
        request, answer, error = call.request, call.answer, call.error
        messages = [
            {"role": m.role, "text": self._clean(m.text)}
            | ({"images": [image.digest for image in m.images]} if m.images else {})
            for m in request.messages
        ]
        asked = {"phase": request.phase, "seed": request.seed, "schema": request.response_schema, "messages": messages}
        answered = None
        if answer is not None:
            answered = attrs.asdict(answer) | {"text": self._clean(answer.text), "note": self._clean(answer.note)}
        failed = None
        if error is not None:
            spent = None if error.usage is None else attrs.asdict(error.usage)
            failed = {"problem": self._clean(error.problem), "retryable": error.retryable, "cause": error.cause}
            failed |= {"usage": spent}
        return {"call": asked, "answer": answered, "error": failed, "abandoned": call.abandoned}

    def _write(self, records: Sequence[dict[str, Any]]) -> None:
        text = "".join(json.dumps(record, ensure_ascii=False) + "\n" for record in records)
        with self._path.open("ab") as file:
            file.write(text.encode("utf-8", "surrogatepass"))
            file.flush()
            os.fsync(file.fileno())


def _cut_half_line(path: Path) -> None:
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        os.truncate(path, whole)
