"""The process of the web server, as the run's process sees it: started once, started again if it ends.

Messages go out in a thread of their own, so that the run never waits for a page. What the pages must know is kept, and
sent again to a server that had to be started anew.
"""

from __future__ import annotations

import atexit
import contextlib
import queue
import socket
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import IO, Any

import attrs

from memo_core.plugin import BackendUnavailable, Event, RunProgress, end_companion, start_companion
from memo_web.channel import Channel, StopLine
from memo_web.robot_side.event_data import event_data
from memo_web.robot_side.listening import listen
from memo_web.settings import WebSettings

_START_S = 60.0  # in which a server listens, on a machine under load
_BEHIND = 200  # messages that wait to be sent, from which on those that may be dropped are
_RESTARTS = 5  # a server that ended more often than this ...
_RESTARTS_S = 120.0  # ... within this time is not started again
_KEPT_EVENTS = 2000
_POLL_S = 0.005  # between two looks at whether the link is still stopped

Handler = Callable[[dict[str, Any]], None]


class PagesProcess:
    """One web server. Use ``pages_process``: a process of MEMO has one."""

    def __init__(self, settings: WebSettings, for_study: bool = False) -> None:
        """Check the settings; nothing is started.

        Args:
            settings: address, port, token and TLS.
            for_study: whether the server shows nothing before it knows who is who in a study.

        Raises:
            InvalidArgument: as ``WebSettings.checked_token``.
        """
        self.settings = settings
        self.url = ""
        self._server = settings.server(settings.checked_token()) | {"for_study": for_study}
        self._kept: dict[str, tuple[str, bytes, dict[str, Any]]] = {}
        self._events: deque[dict[str, Any]] = deque(maxlen=_KEPT_EVENTS)
        self._handlers: dict[str, list[Handler]] = {}
        self._offered: dict[str, Callable[..., Any]] = {}
        self._lock = threading.Lock()
        self._connection: _Connection | None = None
        self._starts: deque[float] = deque(maxlen=_RESTARTS)
        self._closed = False
        self._unlisten: Callable[[], None] = lambda: None
        self._progress = RunProgress()
        self.stop_pressed: Callable[[str], None] = lambda press: None
        self.keep_stopped: Callable[[], None] = lambda: None
        self.watchers_changed: Callable[[bool], None] = lambda present: None
        self.watched = False  # whether a page is open

    # -- life ----------------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """Start the server and wait until it listens. Raises ``BackendUnavailable`` if it does not."""
        self._connect()
        self._unlisten = listen(self._hear, recent=True)

    def close(self) -> None:
        """End the server. Idempotent."""
        with self._lock:
            closed, self._closed = self._closed, True
            connection, self._connection = self._connection, None
        if not closed:
            self._unlisten()
        if connection is not None:
            connection.close()

    @property
    def lost(self) -> bool:
        """Whether the server ended and is not started again."""
        return self._closed

    def _connect(self) -> None:
        connection = _Connection(self._server)
        self.url = connection.url
        if not self._server["port"]:
            self._server["port"] = connection.port  # the same again if it has to be started anew
        with self._lock:
            if self._closed:
                connection.close()
                return
            self._connection = connection
            for kind, blob, fields in self._kept.values():
                connection.post(kind, blob, fields)
            for data in self._events:
                connection.post("event", b"", {**data, "again": True})
        threading.Thread(target=self._read, args=(connection,), name="memo-web-messages", daemon=True).start()
        threading.Thread(target=self._read_stops, args=(connection,), name="memo-web-stop", daemon=True).start()

    def _ended(self, connection: _Connection) -> None:
        """The server is gone: nobody watches, and it is started again unless it was to end."""
        with self._lock:
            if self._closed or self._connection is not connection:
                return
            self._connection = None
        self._present(False)
        connection.close()
        now = time.monotonic()
        if len(self._starts) == _RESTARTS and now - self._starts[0] < _RESTARTS_S:
            self._closed = True
            return
        self._starts.append(now)
        try:
            self._connect()
        except BackendUnavailable as error:
            print(f"memo: the pages could not be started again: {error}", file=sys.stderr)
            self._closed = True

    # -- to the pages --------------------------------------------------------------------------------------------------
    def send(self, kind: str, blob: bytes = b"", keep: str = "", droppable: bool = False, **fields: Any) -> None:
        """Send a message to the pages; never waits.

        Args:
            kind: kind of the message.
            blob: raw bytes that go with it.
            keep: name under which it is kept for a server that is started anew, in place of the last of that name.
            droppable: leave it out if the server is behind.
            **fields: JSON values.
        """
        with self._lock:
            if keep:
                self._kept[keep] = (kind, blob, fields)
            if self._connection is not None:
                self._connection.post(kind, blob, fields, droppable)

    def forget(self, keep: str) -> None:
        """Keep a message no longer.

        Args:
            keep: its name, as in ``send``, or the beginning of the names of several.
        """
        with self._lock:
            self._kept = {name: kept for name, kept in self._kept.items() if not name.startswith(keep)}

    def say_stop(self, state: str) -> None:
        """Tell the pages about the stop.

        Args:
            state: ``stopping``, ``stopped`` or ``clear``.
        """
        connection = self._connection
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.stop_line.send(state)

    def _hear(self, event: Event) -> None:
        data = event_data(event)
        self._progress(event)
        progress = self._progress
        shown = {
            "instruction": progress.instruction,
            "done": [list(one) for one in progress.done],
            "subtask": progress.subtask,
            "attempt": progress.attempt,
            "activity": progress.activity,
            "time_left": progress.time_left,
        }
        with self._lock:
            if data["event"] in ("RunStarted", "RunResumed"):
                self._events.clear()
            self._events.append(data)
            self._kept["progress"] = ("progress", b"", shown)
            if self._connection is not None:
                self._connection.post("event", b"", data)
                self._connection.post("progress", b"", shown)

    # -- from the pages ------------------------------------------------------------------------------------------------
    def on(self, kind: str, handler: Handler) -> Callable[[], None]:
        """Have a function called with every message of a kind that pages send.

        Args:
            kind: kind of the message.
            handler: called with it in the thread that reads messages; must be quick.

        Returns:
            Function that ends this.
        """
        self._handlers.setdefault(kind, []).append(handler)
        return lambda: self._handlers[kind].remove(handler)

    def offer(self, name: str, answer: Callable[..., Any]) -> None:
        """Answer requests of pages (``RunView.ask``).

        Args:
            name: name of the request.
            answer: called with its fields in a thread of its own; returns a JSON value. What it raises is an answer
                too: ``AskFailed`` on the page.
        """
        self._offered[name] = answer

    def _read(self, connection: _Connection) -> None:
        with contextlib.suppress(EOFError):
            while True:
                message, _ = connection.channel.receive()
                kind = message.pop("kind")
                if kind == "ask":
                    threading.Thread(target=self._answer, args=(message,), daemon=True).start()
                for handler in tuple(self._handlers.get(kind, ())):
                    handler(message)
        self._ended(connection)

    def _answer(self, message: dict[str, Any]) -> None:
        try:
            answer = self._offered[message["name"]]
        except KeyError:
            self.send("reply", id=message["id"], error=f"nothing answers {message['name']!r}")
            return
        try:
            self.send("reply", id=message["id"], value=answer(**message["fields"]))
        except Exception as error:  # the page says so
            self.send("reply", id=message["id"], error=" ".join(str(error).split()) or type(error).__name__)

    def _read_stops(self, connection: _Connection) -> None:
        """Pass presses of stop on; this thread does nothing else."""
        for line in connection.stop_line.lines(_POLL_S):
            word, _, rest = line.partition(" ")
            if word == "stop":
                self.stop_pressed(rest)
            elif word in ("gone", "back"):
                self._present(word == "back")
            self.keep_stopped()

    def _present(self, present: bool) -> None:
        self.watched = present
        self.watchers_changed(present)


class _Connection:
    """One process of the server."""

    def __init__(self, server: dict[str, Any]) -> None:
        """Start it and wait until it listens. Raises ``BackendUnavailable``."""
        here, there = socket.socketpair()
        stop_here, stop_there = socket.socketpair()
        self._printed: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        inherited = (there.fileno(), stop_there.fileno())
        command = [sys.executable, "-m", "memo_web.pages.program", *map(str, inherited)]
        self.channel, self.stop_line = Channel(here), StopLine(stop_here)
        self._outbox: queue.SimpleQueue[tuple[str, bytes, dict[str, Any]] | None] = queue.SimpleQueue()
        self._process = start_companion(command, self._printed, inherited)
        there.close()
        stop_there.close()
        here.settimeout(_START_S)
        try:
            self.channel.send("settings", **server)
            message, _ = self.channel.receive()
        except (EOFError, OSError):
            self.close()
            raise self._unavailable() from None
        except BaseException:
            self.close()
            raise
        here.settimeout(None)
        if message["kind"] != "listening":
            self.close()
            raise BackendUnavailable("teacher", "web", message.get("problem", ""), message.get("remedy", ""))
        self.url, self.port = message["url"], message["port"]
        threading.Thread(target=self._write, name="memo-web-outbox", daemon=True).start()

    def _unavailable(self) -> BackendUnavailable:
        self._printed.seek(0)
        lines = [line.strip() for line in self._printed.read().decode(errors="replace").splitlines() if line.strip()]
        return BackendUnavailable("teacher", "web", f"its server ended: {' / '.join(lines[-3:]) or 'it said nothing'}")

    def post(self, kind: str, blob: bytes, fields: dict[str, Any], droppable: bool = False) -> None:
        """Queue a message."""
        if not (droppable and self._outbox.qsize() > _BEHIND):
            self._outbox.put((kind, blob, fields))

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (message := self._outbox.get()) is not None:
                kind, blob, fields = message
                self.channel.send(kind, blob, **fields)

    def close(self) -> None:
        """End the process. Idempotent."""
        self._outbox.put(None)
        self.channel.close()
        self.stop_line.close()
        if self._process.poll() is None:
            end_companion(self._process)


@attrs.define
class _Current:
    pages: PagesProcess | None = None


_current = _Current()


def pages_process(settings: WebSettings, for_study: bool = False) -> PagesProcess:
    """The web server of this process of MEMO, started when it is first asked for.

    Args:
        settings: address, port, token and TLS of a server that is not started yet.
        for_study: whether a server that is not started yet shows nothing before it knows who is who in a study.

    Returns:
        The server.

    Raises:
        InvalidArgument: as ``WebSettings.checked_token``.
        BackendUnavailable: if the server cannot be started.
    """
    if _current.pages is None or _current.pages.lost:
        pages = PagesProcess(settings, for_study)
        pages.start()
        token = f"?token=…, the value of {settings.token_env}" if settings.checked_token() else ""
        print(f"memo: teach at {pages.url}{token}", file=sys.stderr, flush=True)
        _current.pages = pages
        atexit.register(pages.close)
    return _current.pages


def close_pages() -> None:
    """End the web server of this process, if there is one."""
    pages, _current.pages = _current.pages, None
    if pages is not None:
        pages.close()
