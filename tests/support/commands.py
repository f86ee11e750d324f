"""``memo`` commands in this process, and what may never be wrong with how they end."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator, Sequence

from memo_core.cli.main import main

DOCUMENTED = (0, 1, 2, 130)  # exit codes
LONGEST_LINE = 20_000  # characters of an error
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]|\r(?!\n)")


def run(command: Sequence[str]) -> tuple[int | None, str, str]:
    """``memo`` with these arguments: exit code, stdout, stderr. None: it did not exit."""
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)]
    code: int | None = None
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            main(list(command))
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else None
        except BaseException as error:
            streams[1].write(f"\nTraceback (most recent call last): escaped {type(error).__name__}: {error!r}")
    out, err = (stream.buffer.getvalue().decode("utf-8", "replace") for stream in streams)
    return code, out, err


def faults_of(code: int | None, out: str, err: str) -> Iterator[str]:
    """Name what is wrong with how a command ended and with what it printed."""
    if code not in DOCUMENTED:
        yield f"exit {code}: {err.strip()[-300:]}"
    if "Traceback (most recent call last)" in err or "Exception ignored" in err:
        yield f"traceback: {err.strip()[-300:]}"
    for name, text in (("stdout", out), ("stderr", err)):
        if found := _CONTROL.search(text):
            yield f"control character on {name}: {text[max(0, found.start() - 60) : found.end() + 20]!r}"
    if (longest := max(map(len, err.split("\n")))) > LONGEST_LINE:
        yield f"a line of {longest} characters on stderr"
