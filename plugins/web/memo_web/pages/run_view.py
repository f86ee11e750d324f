"""The run as the pages see it: everything that its process said, and what is said back."""

from __future__ import annotations

import asyncio
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from memo_web.channel import Channel, StopLine

FRESH_S = 0.5  # older than this, a picture or the state of the robot is not live
_ATTEMPTS = 24  # recordings that are kept
_FRAMES = 12_000  # of one recording: ten minutes
_LOG = 400  # events that are kept
_ASK_S = 30.0
_KNOWN_PRESSES = 4096
_MOVED = 1e-4  # m, or of a quaternion: less is no motion


class AskFailed(Exception):
    """A request that the run's process could not answer; its text says why."""


@attrs.define(eq=False)
class Recording:
    """An attempt, as it can be looked at again."""

    title: str
    code: str = ""
    times: list[float] = attrs.field(factory=list)  # s on the robot's clock
    poses: list[np.ndarray] = attrs.field(factory=list)  # (n, 7) each: position, then quaternion w, x, y, z
    lines: list[int] = attrs.field(factory=list)  # of the program, from 1; 0: none


@attrs.frozen
class Picture:
    """A camera's picture."""

    data: bytes  # JPEG
    number: int
    taken: float  # s, monotonic
    note: str = ""  # such as that it is the last look's


@attrs.define(eq=False)
class RunView:
    """State of the run, kept in the event loop. ``version`` grows with every change but those of ``poses``,
    ``pictures`` and ``beat``.

    Attributes:
        for_study: whether nothing is shown before it is known who is who in a study.
        stage: shapes of robot and scene, names of bodies; None while no run goes on.
        drawn: the last stage there was, to which ``attempts`` belong.
        meshes: bytes of the meshes (STL) that ``stage`` names, by number.
        poses: (n, 7), position and quaternion (w, x, y, z) of each body of ``stage``.
        progress: instruction, subtasks done, current activity (``memo_core.plugin.RunProgress``).
        question: the open question; None if there is none.
        stop: ``clear``, ``stopping`` or ``stopped``.
        owner: visitor who alone may answer and see the session; None: every visitor whom the guard lets in.
    """

    channel: Channel
    stop_line: StopLine
    loop: asyncio.AbstractEventLoop
    for_study: bool = False
    version: int = 0
    stage: dict[str, Any] | None = None
    drawn: dict[str, Any] | None = None
    stage_number: int = 0
    meshes: dict[int, bytes] = attrs.field(factory=dict)
    poses: np.ndarray | None = None
    poses_number: int = 0
    line: int = 0
    pictures: dict[str, Picture] = attrs.field(factory=dict)
    no_pictures: str = ""
    progress: dict[str, Any] = attrs.field(factory=dict)
    events: deque[dict[str, Any]] = attrs.field(factory=lambda: deque(maxlen=_LOG))
    retrieved: dict[str, Any] | None = None
    code: str = ""
    writing: str = ""  # what a model has written so far of its present answer
    question: dict[str, Any] | None = None
    notice: str = ""
    stop: str = "clear"
    beat: int = 0
    attempts: list[Recording] = attrs.field(factory=list)
    owner: str | None = None
    lost: bool = False  # whether the run's process is gone
    offers: dict[str, Any] = attrs.field(factory=dict)  # what the run's process can begin (``memo web``)
    more: dict[str, Any] = attrs.field(factory=dict)  # state of further pages, by their name
    _heard: float = 0.0
    _moved: float = 0.0  # when the last poses came that were new
    _current: bool = True
    _handlers: dict[str, list[Callable[[dict[str, Any], bytes], None]]] = attrs.field(factory=dict)
    _asked: dict[int, asyncio.Future[Any]] = attrs.field(factory=dict)
    _numbers: Any = attrs.field(factory=lambda: itertools.count(1))
    _presses: deque[str] = attrs.field(factory=lambda: deque(maxlen=_KNOWN_PRESSES))
    _watchers: dict[str, float] = attrs.field(factory=dict)
    _watched: bool = False

    # -- from the run --------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """Begin to read what the run's process says."""
        threading.Thread(target=self._read, name="memo-messages", daemon=True).start()
        threading.Thread(target=self._read_stops, name="memo-stop", daemon=True).start()

    def _read(self) -> None:
        try:
            while True:
                message, blob = self.channel.receive()
                self.loop.call_soon_threadsafe(self.take, message, blob)
        except EOFError:
            self.loop.call_soon_threadsafe(self._end)
        except RuntimeError:  # the loop is closed
            pass

    def _end(self) -> None:
        self.lost = True
        self.version += 1

    def _read_stops(self) -> None:
        try:
            for line in self.stop_line.lines():
                self.loop.call_soon_threadsafe(self._take_stop, line)
        except RuntimeError:
            pass

    def _take_stop(self, state: str) -> None:
        self.stop = state
        self.version += 1

    def on(self, kind: str, handler: Callable[[dict[str, Any], bytes], None]) -> None:
        """Have a function called with every message of a kind from the run's process.

        Args:
            kind: kind of the message; ``event`` for a run's events.
            handler: called with the message and its bytes, in the event loop.
        """
        self._handlers.setdefault(kind, []).append(handler)

    def take(self, message: dict[str, Any], blob: bytes) -> None:
        """Take in a message of the run's process.

        Args:
            message: the message with its ``kind``.
            blob: its bytes.
        """
        kind = message["kind"]
        take = getattr(self, f"_take_{kind}", None)
        if take is not None:
            take(message, blob)
        for handler in self._handlers.get(kind, ()):
            handler(message, blob)
        if kind not in ("beat", "frame", "picture"):
            self.version += 1

    def _take_beat(self, message: dict[str, Any], blob: bytes) -> None:
        self._heard, self._current = time.monotonic(), message["current"]

    def _take_stage(self, message: dict[str, Any], blob: bytes) -> None:
        self.stage, self.poses, self.pictures = message["stage"], None, {}
        self.drawn = self.stage or self.drawn
        self.stage_number += 1
        self.no_pictures = ""

    def _take_mesh(self, message: dict[str, Any], blob: bytes) -> None:
        self.meshes[message["number"]] = blob

    def _take_frame(self, message: dict[str, Any], blob: bytes) -> None:
        before, self.poses = self.poses, np.frombuffer(blob, np.float32).reshape(-1, 7)
        self.line = message["line"]
        self.poses_number += 1
        if before is None or before.shape != self.poses.shape or np.abs(before - self.poses).max(initial=0.0) > _MOVED:
            self._moved = time.monotonic()
        if self.attempts and len(self.attempts[-1].times) < _FRAMES:
            last = self.attempts[-1]
            last.times.append(message["time"])
            last.poses.append(self.poses)
            last.lines.append(self.line)

    def _take_picture(self, message: dict[str, Any], blob: bytes) -> None:
        before = self.pictures.get(message["camera"])
        number = before.number + 1 if before is not None else 1
        self.pictures[message["camera"]] = Picture(blob, number, time.monotonic(), message.get("note", ""))

    def _take_no_pictures(self, message: dict[str, Any], blob: bytes) -> None:
        self.no_pictures = message["why"]

    def _take_progress(self, message: dict[str, Any], blob: bytes) -> None:
        self.progress = message | {"heard": time.monotonic()}

    def _take_question(self, message: dict[str, Any], blob: bytes) -> None:
        self.question = message["question"]

    def _take_notice(self, message: dict[str, Any], blob: bytes) -> None:
        self.notice = message["text"]

    def _take_offers(self, message: dict[str, Any], blob: bytes) -> None:
        self.offers = message["offers"]

    def _take_own(self, message: dict[str, Any], blob: bytes) -> None:
        self.owner = message["visitor"]

    def _take_text(self, message: dict[str, Any], blob: bytes) -> None:
        self.writing = (self.writing + message["text"])[-20_000:] if message["phase"] == "code" else ""

    def _take_event(self, message: dict[str, Any], blob: bytes) -> None:
        name, data = message["event"], message["data"]
        self.events.append({"event": name, "data": data})
        if name == "RunStarted":
            self.attempts, self.retrieved, self.code, self.notice = [], None, "", ""
            self.events = deque([self.events[-1]], maxlen=_LOG)
        elif name == "Retrieved":
            self.retrieved = data
        elif name == "ModelAsked":
            self.writing = ""
        elif name == "SubtaskStarted":
            take = f", take {data['take']}" if data["take"] > 1 else ""
            self.attempts.append(Recording(f"{data['number']}. {data['subtask']}, attempt {data['attempt']}{take}"))
            del self.attempts[:-_ATTEMPTS]
        elif name == "CodeWritten":
            self.code, self.writing = data["code"], ""
            if self.attempts:
                self.attempts[-1].code = data["code"]

    def _take_reply(self, message: dict[str, Any], blob: bytes) -> None:
        asked = self._asked.pop(message["id"], None)
        if asked is None or asked.done():
            return
        if "error" in message:
            asked.set_exception(AskFailed(message["error"]))
        else:
            asked.set_result(message["value"])

    def clear(self) -> None:
        """Forget what the run did, because another visitor's session begins."""
        self.attempts, self.retrieved, self.question = [], None, None
        self.code = self.writing = self.notice = ""
        self.events.clear()
        self.pictures = {}
        self.progress = {}
        self.version += 1

    @property
    def live(self) -> bool:
        """Whether what is shown of the robot is not older than ``FRESH_S``."""
        return self._current and time.monotonic() - self._heard <= FRESH_S

    def behind(self, picture: Picture) -> float:
        """Delay of a picture behind the robot's poses.

        Args:
            picture: one of ``pictures``.

        Returns:
            Seconds; 0 or less where the robot has not moved since.
        """
        return self._moved - picture.taken

    # -- to the run ----------------------------------------------------------------------------------------------------
    def tell(self, kind: str, **fields: Any) -> None:
        """Send a message to the run's process (``PagesProcess.on``).

        Args:
            kind: kind of the message.
            **fields: JSON values.
        """
        try:
            self.channel.send(kind, **fields)
        except OSError:
            self.lost = True

    async def ask(self, name: str, **fields: Any) -> Any:
        """Have the run's process answer a request (``PagesProcess.offer``).

        Args:
            name: name of the request.
            **fields: its arguments, JSON values.

        Returns:
            The answer, a JSON value.

        Raises:
            AskFailed: if the process could not answer, or not in time.
        """
        number = next(self._numbers)
        self._asked[number] = asked = self.loop.create_future()
        self.tell("ask", id=number, name=name, fields=fields)
        try:
            return await asyncio.wait_for(asked, _ASK_S)
        except TimeoutError:
            raise AskFailed(f"no answer within {_ASK_S:g} s") from None
        finally:
            self._asked.pop(number, None)

    def press_stop(self, press: str) -> None:
        """Stop the robot. Never limited.

        Args:
            press: what tells one press from another; the same one again does nothing.
        """
        press = "".join(c for c in press[:40] if c.isascii() and c.isalnum()) or f"unnamed{next(self._numbers)}"
        if press in self._presses:
            return
        self._presses.append(press)
        if self.stop != "stopped":
            self.stop = "stopping"
        self.version += 1
        try:
            self.stop_line.send(f"stop {press}")
        except OSError:
            self.lost = True

    def may_answer(self, visitor: str) -> bool:
        """Whether a visitor may answer, and see the session.

        Args:
            visitor: identity of the visitor.

        Returns:
            True if nobody owns the session, or this visitor does.
        """
        return self.owner is None or self.owner == visitor

    # -- who watches ---------------------------------------------------------------------------------------------------
    def pulse(self, page: str) -> None:
        """Note that a page is open and shows what happens.

        Args:
            page: id of the page's client.
        """
        self._watchers[page] = time.monotonic()
        self._check_watchers()

    def gone(self, page: str) -> None:
        """Note that a page was closed.

        Args:
            page: id of the page's client.
        """
        self._watchers.pop(page, None)
        self._check_watchers()

    async def attend(self) -> None:
        """Count the beats that tell pages that they are live, and note when nobody watches any more; never ends."""
        while True:
            await asyncio.sleep(0.1)
            if self.live or (self.stage is None and not self.lost):
                self.beat += 1
            self._check_watchers()

    def _check_watchers(self) -> None:
        now = time.monotonic()
        self._watchers = {page: at for page, at in self._watchers.items() if now - at < 3 * FRESH_S}
        watched = bool(self._watchers)
        if watched != self._watched:
            self._watched = watched
            try:
                self.stop_line.send("back" if watched else "gone")
            except OSError:
                self.lost = True
