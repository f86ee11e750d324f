"""Calls of models as files of a run (``calls/``): question, answer or error, and cost."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_core.interfaces.llm import Answer, LanguageModelError, Request, Usage
from memo_core.llm.spending import Spent
from memo_core.runlog.log_file import FILE
from memo_core.runlog.log_history import History, LogEntry
from memo_core.text.parsing import parse_json, read_as

ASK = "ask a model"


def call_name(number: int, phase: str) -> str:
    """The file of the call that is this entry of the run's log."""
    return f"calls/{number:04d}-{phase}.json"


def call_text(
    request: Request, result: Answer | BaseException, problem: str, abandoned: bool, unusable: str = ""
) -> str:
    """The contents of a call's file; ``problem``: why there is no answer, ``unusable``: why it cannot be used."""
    answer = result if isinstance(result, Answer) else None
    spent = None if answer is not None else usage_of(result)
    kept = {
        "phase": request.phase,
        "time": time.time(),
        "seed": request.seed,
        "digest": request.digest,
        "prompt": request.prompt,
        "abandoned": abandoned,
        "problem": problem,
        "unusable": unusable,
        "error": _error_record(result),
        "answer": None if answer is None else attrs.asdict(answer),
        "usage": None if spent is None else attrs.asdict(spent),  # of a call without an answer
        "messages": [
            {"role": m.role, "text": m.text} | ({"images": len(m.images)} if m.images else {}) for m in request.messages
        ],
    }
    return json.dumps(kept, indent=1, ensure_ascii=False) + "\n"


def read_call(folder: Path, name: str) -> dict[str, Any]:
    """A call's file. Raises ``InvalidArgument`` for one that is missing or damaged."""
    file = folder / name
    try:
        kept = parse_json(file.read_text(encoding="utf-8", errors="surrogatepass"))
        if not {"answer", "usage", "digest", "problem"} <= set(kept):
            raise ValueError("it lacks its answer")
        if kept["answer"] is not None and not isinstance(kept["answer"]["text"], str):
            raise ValueError("its answer is no text")
        return dict(kept)
    except OSError as error:
        problem = f"{file}: {error.strerror}; what was asked or answered may have been withdrawn (forget)"
    except (KeyError, ValueError, TypeError) as error:
        problem = f"{file} is damaged ({error})"
    raise InvalidArgument("--resume", problem, "the file as the run wrote it")


def answer_in(folder: Path, name: str) -> Answer:
    """The answer that a call's file holds. Raises ``InvalidArgument``."""
    try:
        return read_as(Answer, read_call(folder, name)["answer"])
    except ValueError as error:
        problem = f"{folder / name} is damaged (its answer: {' '.join(str(error).split())})"
        raise InvalidArgument("--resume", problem, "the file as the run wrote it") from None


def usage_of(result: Answer | BaseException) -> Usage | None:
    """The cost of a call; None if nothing was spent."""
    return getattr(result, "usage", None)


def result_in(folder: Path, name: str, model: str) -> Answer | LanguageModelError | None:
    """The result of a call that has no end in the log, from its file, which is written first; None without a file."""
    if not (folder / name).exists():
        return None
    kept = read_call(folder, name)
    if kept["answer"] is not None:
        return answer_in(folder, name)
    usage = None if kept["usage"] is None else _usage(kept["usage"], folder / name)
    return _error_in(kept, folder / name, model, usage)


def _error_record(result: Answer | BaseException) -> dict[str, Any] | None:
    """A model's error without the cost, which stands beside it, and the model, which the run knows."""
    if not isinstance(result, LanguageModelError):
        return None
    return attrs.asdict(result, filter=attrs.filters.exclude("backend", "usage"))


def _error_in(kept: dict[str, Any], file: Path, model: str, usage: Usage | None) -> LanguageModelError:
    if kept.get("error") is None:  # of an earlier version, or of another kind
        return LanguageModelError(model, str(kept["problem"]), usage=usage)
    try:
        found = read_as(LanguageModelError, {"backend": model, **kept["error"]})
        found.usage = usage
        return found
    except ValueError as error:
        problem = f"{file} is damaged (its error: {' '.join(str(error).split())})"
        raise InvalidArgument("--resume", problem, "the file as the run wrote it") from None


def spent_in(history: History, folder: Path) -> Spent:
    """What a run has spent so far, from its log and the files of its calls; each call counts once."""
    spent = Spent()
    for over, usage in _calls_in(history, folder).values():
        spent = spent.plus(usage) if over else attrs.evolve(spent, unfinished=spent.unfinished + 1)
    return spent


def usages_in(history: History, folder: Path) -> dict[int, Usage | None]:
    """The cost of each finished call of a run, by its entry in the log."""
    return {number: usage for number, (over, usage) in _calls_in(history, folder).items() if over}


def _calls_in(history: History, folder: Path) -> dict[int, tuple[bool, Usage | None]]:
    found = {}
    for entry in history.effects:
        refused = (entry.raised or {}).get("type") == "BudgetExceeded"
        again = isinstance(entry.value, dict) and entry.value.get("kept")  # paid for as another entry
        if entry.name == ASK and not refused and not again:
            found[entry.number] = _usage_in(entry, folder)
    return found


def _usage_in(entry: LogEntry, folder: Path) -> tuple[bool, Usage | None]:
    """Whether the call is known to be over, and what it cost."""
    for found in (entry.late, entry.value, entry.raised):
        if isinstance(found, dict) and "usage" in found:
            return True, None if found["usage"] is None else _usage(found["usage"], folder / FILE)
    result = result_in(folder, call_name(entry.number, entry.about.split()[0]), "")
    return (True, usage_of(result)) if result is not None else (entry.raised is not None and not entry.stopped, None)


def _usage(record: Any, file: Path) -> Usage:
    """Raises ``InvalidArgument``, which names the file."""
    try:
        return read_as(Usage, record)
    except ValueError as error:
        problem = f"{file} is damaged (what a call cost: {error})"
        raise InvalidArgument("--resume", problem, "the file as the run wrote it") from None
