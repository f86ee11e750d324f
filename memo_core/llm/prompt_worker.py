"""The process that reads prompt files which replace the built-in ones: their text decides how much work that is. The
parent (``prompt_process``) starts ``serve`` with an empty environment. It reads one line of JSON per question and
answers with one; the system ends it when a question takes too long."""

from __future__ import annotations

import json
import resource
import sys
from typing import Any

from memo_core.llm.prompt_filling import Unfit, filled, names_in
from memo_core.llm.prompt_language import prompt_environment

MEMORY = 512 << 20  # bytes
FIELDS, TEXT = "fields", "text"  # of an object that the parent wrote; of a dict only the first
_INTERPRETER_BYTES = 256 << 20  # of addresses that the process has before it has read any text


class Fields:
    """A value of the parent's with its public fields, and nothing that could be called."""

    def __init__(self, fields: dict[str, Any], text: str) -> None:
        self.__dict__.update(fields)
        self.__text = text

    def __str__(self) -> str:
        return self.__text


def restored(value: Any) -> Any:
    """A value as the parent wrote it, with ``Fields`` for objects."""
    if isinstance(value, list):
        return [restored(item) for item in value]
    if not isinstance(value, dict):
        return value
    fields = {key: restored(item) for key, item in value[FIELDS]}
    return Fields(fields, value[TEXT]) if TEXT in value else fields


def serve() -> None:
    """Answer questions until stdin ends."""
    prompt_environment()  # imports before memory is limited
    _confine()
    for line in sys.stdin:
        asked = json.loads(line)
        _allow(asked["seconds"])
        try:
            answer = _answer(asked)
        except MemoryError:
            answer = {"line": 0, "problem": f"needs more than {MEMORY >> 20} MiB of memory to be filled in"}
        print(json.dumps(answer), flush=True)


def _answer(asked: dict[str, Any]) -> dict[str, Any]:
    try:
        if "values" in asked:
            return {"text": filled(asked["text"], {name: restored(one) for name, one in asked["values"].items()})}
        return {"names": names_in(asked["text"])}
    except Unfit as error:
        return {"line": error.line, "problem": error.problem}


def _allow(seconds: int) -> None:
    """More time of the processor; at its end the system ends this process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    wanted = int(used.ru_utime + used.ru_stime) + 1 + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (wanted if most == resource.RLIM_INFINITY else min(wanted, most), most))


def _confine() -> None:
    """Forbid core dumps and writing files, and limit memory."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY + _INTERPRETER_BYTES,) * 2)
