"""The event log of a run, ``events.jsonl``: all events, one JSON object per line, written as they happen."""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from memo_core.errors import InvalidArgument
from memo_core.runlog.whole_files import writing
from memo_core.text.parsing import parse_json

FILE = "events.jsonl"


class EventLog:
    """Appends to the event log of a run folder, one process at a time. Safe to use from several threads."""

    def __init__(self, folder: Path, option: str) -> None:
        """Raises ``InvalidArgument``, naming ``option``, if another process writes to it, and ``CannotWrite``."""
        with writing(folder / FILE):
            self._file = (folder / FILE).open("a", encoding="utf-8", errors="surrogatepass")
        self._lock = threading.Lock()
        self._reserve(folder, option)

    def _reserve(self, folder: Path, option: str) -> None:
        """The system releases the lock however the process ends."""
        try:
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            problem = f"the run in {folder} is still going on"
            raise InvalidArgument(option, problem, "a run that has ended; wait for it, or stop it") from None
        except OSError:
            return  # a file system without locks

    @property
    def closed(self) -> bool:
        return self._file.closed

    def close(self) -> None:
        """Idempotent."""
        with self._lock:
            self._file.close()

    def append(self, line: str) -> None:
        """Add one event as JSON. It survives the end of this process; ignored once the log is closed."""
        with self._lock:
            if not self._file.closed:
                with writing(Path(self._file.name)):
                    self._file.write(line + "\n")
                    self._file.flush()

    def cut_incomplete_line(self) -> int:
        """Remove an incomplete last line; returns its number of bytes."""
        path = Path(self._file.name)
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(path, whole)
        return len(data) - whole


def read_events(folder: Path) -> list[dict[str, Any]]:
    """Read the events of a run.

    Args:
        folder: the run's folder.

    Returns:
        One dictionary for each event, in order; incomplete and damaged lines are left out. Empty if there is no log.
    """
    try:
        text = (folder / FILE).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    found = []
    for line in text.splitlines():
        try:
            event = parse_json(line)
        except ValueError:
            continue
        if isinstance(event, dict) and isinstance(event.get("event"), str):
            found.append(event)
    return found


def goes_on(folder: Path) -> bool:
    """Check whether a process is carrying out the run in a folder.

    Args:
        folder: the run's folder.

    Returns:
        True while a process holds the event log; False also on a file system without locks.
    """
    try:
        with (folder / FILE).open("rb") as file:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def check_quiet(folders: Iterable[Path], argument: str) -> None:
    """Check that no run is going on in folders or below them, before files that runs write to are replaced.

    Args:
        folders: folders of runs, or folders with such folders in them.
        argument: name of the argument that the error is about.

    Raises:
        InvalidArgument: naming the first run that is going on.
    """
    for folder in (log.parent for place in folders for log in place.rglob(FILE)):
        if goes_on(folder):
            raise InvalidArgument(
                argument, f"the run in {folder} is still going on", "runs that have ended; wait for it, or stop it"
            )
