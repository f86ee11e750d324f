"""Going on with a run that was cut off: what is kept for it, and what is checked before (``memo run --resume DIR``).

``progress.json`` in the run's folder is written whole at every step of the loop, before the step is made. It names
the checkpoint that the run goes on from; the answers of models that were given since then are taken from ``calls/``
when the same question comes again, so nothing is paid for twice.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.errors import InvalidArgument
from memo_core.events import ModelCalled
from memo_core.experiment.folder import nested
from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_core.policy.progress import Progress, Resumed, progress_of, progress_record
from memo_core.skillbook.book import Skillbook

VERSION = 1
FILE = "progress.json"
# What may be another in the second part: limits that were reached, what is filmed.
MAY_DIFFER = ("run.max_", "run.study_", "run.video")
KEPT = "kept from before the run was cut off: not asked, not paid again"


@attrs.frozen(eq=False)
class State:
    """What ``progress.json`` holds. ``calls``: how many were kept when the step at hand began; ``book``: the
    skillbook's URL and generation; ``teacher``: what the teacher needs to go on; ``ended``: why there is nothing to go
    on with."""

    run: str
    started_in: str
    part: int = 1
    calls: int = 0
    teacher: str = ""
    book: tuple[str, int] | None = None
    when: float = 0.0
    progress: Progress | None = None
    ended: str = ""

    def record(self) -> dict[str, Any]:
        """As JSON can hold it."""
        kept = attrs.asdict(self, recurse=False)
        kept["progress"] = None if self.progress is None else progress_record(self.progress)
        return {"version": VERSION, **kept}

    def resumed(self, folder: Path) -> Resumed | None:
        """What the loop goes on from; None where the run had not begun. Raises ``InvalidArgument`` naming a checkpoint
        that is missing or damaged."""
        progress = self.progress
        if progress is None:
            return None
        start = _world(folder, progress, "" if progress.key else "-plan")
        stays = progress.key and progress.said is not None and progress.said.stays
        return Resumed(progress, start, _world(folder, progress, "-after") if stays else b"")


def _world(folder: Path, progress: Progress, which: str) -> bytes:
    """A checkpoint of the step at hand; empty where the world had none. Raises ``InvalidArgument``."""
    file = folder / "checkpoints" / f"{progress.number:02d}{which}.json"
    kept = _read(file, "a run that has all its checkpoints")
    if not isinstance(kept, dict) or not {"number", "subtask", "world"} <= set(kept):
        raise InvalidArgument("--resume", f"{file} is damaged (it lacks its world)", "the file as the run wrote it")
    if (kept["number"], kept["subtask"]) != (progress.number, progress.key):
        raise InvalidArgument("--resume", f"{file} is of another subtask", f"one of {progress.key or 'planning'}")
    return json.dumps(kept["world"]).encode() if kept["world"] else b""


def read_state(folder: Path) -> State:
    """Raises ``InvalidArgument``: no run, a finished one, a file that is damaged or of another version."""
    if not folder.is_dir():
        raise InvalidArgument("--resume", f"{folder} is no folder", "the folder of a run, e.g. runs/…")
    file = folder / FILE
    kept = _read(file, "the folder of a run")
    try:
        version = kept.pop("version")
        if version != VERSION:
            raise InvalidArgument("--resume", f"{file} is of version {version}", f"one of version {VERSION}")
        progress = None if kept["progress"] is None else progress_of(kept["progress"])
        book = None if kept["book"] is None else (str(kept["book"][0]), int(kept["book"][1]))
        state = State(**{**kept, "progress": progress, "book": book})
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InvalidArgument("--resume", f"{file} is damaged ({error})", "the file as the run wrote it") from None
    if state.ended:
        raise InvalidArgument("--resume", f"the run in {folder} has ended: {state.ended}", "a run that was cut off")
    return state


def _read(file: Path, expected: str) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidArgument("--resume", f"{file}: {error.strerror}", expected) from None
    except ValueError as error:
        raise InvalidArgument("--resume", f"{file} is damaged ({error})", expected) from None


def run_config(folder: Path) -> Path:
    """The resolved experiment of a run, which is an experiment file. Raises ``InvalidArgument``."""
    file = folder / "config.yaml"
    if not file.exists():
        raise InvalidArgument("--resume", f"{folder} holds no run ({file.name} is missing)", "the folder of a run")
    return file


def check_config(folder: Path, now: Mapping[str, Any]) -> None:
    """Raises ``InvalidArgument`` naming what the experiment says otherwise than the run's ``config.yaml``. A key that
    the file does not have came with a newer version, and has its default."""
    file = folder / "config.yaml"
    try:
        before = _flat(yaml.safe_load(file.read_text(encoding="utf-8")))
    except (OSError, yaml.YAMLError) as error:
        problem = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise InvalidArgument("--resume", f"{file}: {problem}", "the folder of a run") from None
    after = _flat(nested(dict(now)))
    differ = [key for key in sorted(before) if before[key] != after.get(key)]
    differ = [key for key in differ if not key.startswith(MAY_DIFFER)]
    if differ:
        told = "; ".join(f"{key} was {before.get(key)!r}, is {after.get(key)!r}" for key in differ[:5])
        more = f" (and {len(differ) - 5} more)" if len(differ) > 5 else ""
        raise InvalidArgument("--resume", f"another config: {told}{more}", "the config the run began with")


def _flat(tree: Any, path: str = "") -> dict[str, Any]:
    if not isinstance(tree, dict) or not tree:
        return {path: tree if tree not in ({}, []) else None}
    items = [(f"{path}.{key}" if path else str(key), value) for key, value in tree.items()]
    return {key: value for name, branch in items for key, value in _flat(branch, name).items()}


def check_place(state: State, book_url: str, here: Path) -> None:
    """Raises ``InvalidArgument`` where the run's book has a name that means another file here."""
    relative = "://" not in book_url and not Path(book_url).is_absolute()
    if relative and state.book is not None and str(here) != state.started_in:
        problem = f"the skillbook {book_url!r} is named from where the run was started"
        raise InvalidArgument("--resume", problem, f"the same command in {state.started_in}")


def book_changes(state: State, book: Skillbook) -> str:
    """What others did to the book since the run's last step; empty where nothing."""
    if state.book is None or book.generation() == state.book[1]:
        return ""
    own = {feedback.id for feedback in book.feedback_of_run(state.run)}
    since = [entry for entry in book.entries(superseded=True) if entry.created >= state.when]
    others = sum(entry.feedback not in own for entry in since)
    if not others and book.generation() > state.book[1] and len(since) > 0:
        return ""
    before, now = state.book[1], book.generation()
    return f"it was at generation {before} and is at {now}; {others} of the entries since are not of this run"


@attrs.frozen
class Spending:
    """What earlier parts of a run took: calls of models as events, and wall time (s)."""

    calls: tuple[ModelCalled, ...]
    wall_s: float


def earlier_parts(folder: Path) -> Spending:
    """Read back from ``events.jsonl``."""
    names = {field.name for field in attrs.fields(ModelCalled)}
    calls: list[ModelCalled] = []
    wall, first, last = 0.0, 0.0, 0.0
    for line in (folder / "events.jsonl").read_text(encoding="utf-8").splitlines():
        try:
            event = json.loads(line)
        except ValueError:
            continue  # half a line
        if event["event"] in ("RunStarted", "RunResumed"):
            wall += last - first
            first = event["time"]
        last = max(first, event["time"])
        if event["event"] == "ModelCalled":
            calls.append(ModelCalled(**{name: value for name, value in event.items() if name in names}))
    return Spending(tuple(calls), wall + last - first)


class KeptAnswers(LanguageModel):
    """Gives the answers that are kept in ``calls/`` to the questions they were given to, each once and in their order,
    and asks ``inner`` everything else. What is kept costs nothing."""

    def __init__(self, inner: LanguageModel, folder: Path, after: int) -> None:
        """``after``: the number of the last call before the step that the run goes on from."""
        self.name = inner.name
        self._inner = inner
        self._lock = threading.Lock()
        self._kept: dict[str, deque[Answer]] = {}
        late: list[tuple[str, Answer]] = []
        for file in sorted((folder / "calls").glob("*.json")):
            kept = json.loads(file.read_text(encoding="utf-8"))
            given = kept.get("answer")
            if int(file.name.split("-")[0]) <= after or given is None or given.get("note", "").startswith(KEPT):
                continue
            answer = Answer(given["text"], given["finish"], Usage(cost=0.0), given["model"], note=KEPT)
            if kept["abandoned"]:
                late.append((kept["digest"], answer))  # paid for as well, but not what the run went on with
            else:
                self._kept.setdefault(kept["digest"], deque()).append(answer)
        for digest, answer in late:
            self._kept.setdefault(digest, deque()).append(answer)
        self.count = sum(map(len, self._kept.values()))

    def open(self) -> None:
        self._inner.open()

    def close(self) -> None:
        self._inner.close()

    def unpriced(self) -> str:
        return self._inner.unpriced()

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        with self._lock:
            kept = self._kept.get(request.digest)
            if kept:
                return kept.popleft()
        return self._inner.answer(request, on_text, cancelled)
