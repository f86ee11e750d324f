"""A study in the browser, as the run's process sees it: who is who, consent and questions before a session, the end.

Each participant, and the person who runs the study, has a key. A visitor who opens the address with a key and confirms
is known from then on by the cookie of their browser, also after a restart: keys and visitors are kept in
``browser.json`` in the study's folder.
"""

from __future__ import annotations

import atexit
import itertools
import json
import os
import queue
import secrets
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from memo_core.plugin import (
    LONGEST_WORDS,
    Demographics,
    Event,
    InvalidArgument,
    SessionEnded,
    SessionTask,
    Stopped,
    TimeLeft,
)
from memo_core.study import load_study
from memo_web.robot_side.listening import listen, session_task
from memo_web.robot_side.pages_process import PagesProcess, pages_process
from memo_web.settings import WebSettings

FILE = "browser.json"
OPERATOR = "operator"
_POLL_S = 0.05
_FAREWELL_S = 4.0  # on a machine under load
_MOST_VISITORS = 500  # browsers that are remembered


class Visitors:
    """Keys of the people of a study, and the visitors who brought one."""

    def __init__(self, folder: Path, people: tuple[str, ...]) -> None:
        """Read the file in the study's folder, and make keys for those who have none.

        Args:
            folder: the study's folder.
            people: ids of the participants.

        Raises:
            InvalidArgument: if the file is damaged.
        """
        self._file = folder / FILE
        kept = self._read()
        self.keys: dict[str, str] = dict(kept.get("keys", {}))
        self.roles: dict[str, str] = dict(kept.get("visitors", {}))
        for name in (OPERATOR, *people):
            self.keys.setdefault(name, secrets.token_urlsafe(16))
        self._write()

    def enter(self, key: str, visitor: str) -> str:
        """Remember a visitor as the person whose key they bring.

        Args:
            key: the key.
            visitor: identity of the visitor.

        Returns:
            ``operator``, or the participant's id.

        Raises:
            InvalidArgument: if it is nobody's key.
        """
        name = next(
            (one for one, kept in self.keys.items() if secrets.compare_digest(kept.encode(), key.encode())), None
        )
        if name is None:
            raise InvalidArgument("key", "it is nobody's in this study", "the address as the experimenter gave it")
        self.roles.pop(visitor, None)
        self.roles[visitor] = name
        while len(self.roles) > _MOST_VISITORS:
            del self.roles[next(iter(self.roles))]
        self._write()
        return name

    def newest(self, name: str) -> str | None:
        """Identity of the visitor who came last with a person's key; None: nobody did."""
        return next((visitor for visitor, role in reversed(self.roles.items()) if role == name), None)

    def _read(self) -> dict[str, Any]:
        if not self._file.exists():
            return {}
        try:
            kept = json.loads(self._file.read_text(encoding="utf-8"))
            if all(isinstance(kept[name], dict) for name in ("keys", "visitors")):
                return dict(kept)
        except (ValueError, KeyError, TypeError):
            pass
        remedy = "the file as it was written; without it, everybody gets a new address"
        raise InvalidArgument(str(self._file), "it is damaged", remedy)

    def _write(self) -> None:
        """Whole or not at all, readable by its owner only."""
        new = self._file.with_name(f".{FILE}.new")
        new.unlink(missing_ok=True)
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
            json.dump({"keys": self.keys, "visitors": self.roles}, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        os.replace(new, self._file)


@attrs.define
class _Open:
    """The question that a participant is asked before a session."""

    number: int
    participant: str
    check: Callable[[dict[str, Any]], Any]  # the answer as a value; raises ``InvalidArgument``
    answers: queue.SimpleQueue[Any]


class StudyPages:
    """One study's pages. Use ``study_pages``: a process of MEMO has one."""

    def __init__(self, pages: PagesProcess, folder: Path) -> None:
        """Tell the pages about a study.

        Args:
            pages: the web server.
            folder: the study's folder.

        Raises:
            InvalidArgument: if ``browser.json`` is damaged, or the folder holds no study.
        """
        self.pages, self.folder = pages, folder
        self.visitors = Visitors(folder, participants_in(folder))
        self.end_run: Callable[[], None] = lambda: None
        self._lock = threading.RLock()
        self._numbers = itertools.count(1)
        self._open: _Open | None = None
        self._paused = False
        self._state: dict[str, Any] = {"phase": "waiting", "participant": "", "session_over": []}
        pages.offer("study.enter", self._enter)
        pages.offer("study.answer", self._take_answer)
        pages.offer("study.pause", self._pause)
        if (known := session_task()) is not None:
            self._begin_task(known[1], known[0])
        self._unlisten = listen(self._hear)
        atexit.register(self._part)  # before the server is ended
        self._show()
        for name, key in self.visitors.keys.items():
            who = "the person who runs the study" if name == OPERATOR else name
            print(f"memo: {who} opens {pages.url}enter/{key}", file=sys.stderr)

    def close(self) -> None:
        """Tell the pages nothing more."""
        atexit.unregister(self._part)
        self._unlisten()

    # -- to the pages --------------------------------------------------------------------------------------------------
    def show(self, **state: Any) -> None:
        """Show where the study stands.

        Args:
            **state: values that changed: ``phase``, ``participant``, and what the phase shows.
        """
        with self._lock:
            self._state |= state
            self._show()

    def _show(self) -> None:
        owner = self.visitors.newest(self._state["participant"]) if self._state["participant"] else None
        shared = {
            "folder": str(self.folder),
            "url": self.pages.url,
            "keys": self.visitors.keys,
            "roles": self.visitors.roles,
        }
        token = self.pages.settings.checked_token()
        self.pages.send("study", keep="study", study={**shared, **self._state, "owner": owner, "token": token})

    def _hear(self, event: Event) -> None:
        if isinstance(event, SessionTask):
            self._begin_task(event, time.time())
        elif isinstance(event, TimeLeft):
            self.show(ends_at=time.time() + event.left_s)
        elif isinstance(event, SessionEnded):
            with self._lock:
                self.show(phase="over", session_over=[*self._state["session_over"], event.participant])

    def _begin_task(self, event: SessionTask, when: float) -> None:
        task = {"session": event.session, "number": event.number, "participant": event.participant}
        with self._lock:
            over = [one for one in self._state["session_over"] if one != event.participant]
            self.show(phase="task", session_over=over, ends_at=when + event.left_s, **task)

    def _part(self) -> None:
        """Give the pages of the last participant and of the operator the time to show an end that needs no server."""
        if self._state["phase"] == "over":
            self.show(phase="ended")
            time.sleep(_FAREWELL_S)

    # -- from the pages ------------------------------------------------------------------------------------------------
    def _enter(self, key: str, visitor: str) -> str:
        with self._lock:
            name = self.visitors.enter(str(key), str(visitor))
            self._show()
        return name

    def _take_answer(self, number: int, visitor: str, answer: dict[str, Any]) -> bool:
        with self._lock:
            asked = self._open
            if asked is None or asked.number != number:
                raise InvalidArgument("answer", "this was answered already", "the page as it is now")
            if self.visitors.roles.get(visitor) != asked.participant:
                raise InvalidArgument("visitor", "this is another participant's session", "your own address")
            asked.answers.put(asked.check(answer))
            self._open = None
        return True

    def _pause(self, visitor: str) -> bool:
        if self.visitors.roles.get(visitor) != OPERATOR:
            raise InvalidArgument("visitor", "only the person who runs the study may pause it", "their address")
        self._paused = True
        self.end_run()
        return True

    def ask(self, phase: str, participant: str, check: Callable[[dict[str, Any]], Any], **shown: Any) -> Any:
        """Ask a participant before a session, and wait.

        Args:
            phase: ``consent`` or ``about``.
            participant: the participant's id.
            check: turns the page's answer into the result; raises ``InvalidArgument``, which the page shows.
            **shown: what the page shows.

        Returns:
            Result of ``check``.

        Raises:
            Stopped: if the study is paused, or the pages are gone.
        """
        asked = _Open(next(self._numbers), participant, check, queue.SimpleQueue())
        with self._lock:
            self._open = asked
            over = [one for one in self._state["session_over"] if one != participant]
            self.show(phase=phase, participant=participant, asked=asked.number, session_over=over, **shown)
        try:
            while True:
                if self._paused:
                    raise Stopped("waiting for the participant; the study was paused in the browser")
                if self.pages.lost:
                    raise Stopped("waiting for the participant; the server of the pages ended")
                try:
                    return asked.answers.get(timeout=_POLL_S)
                except queue.Empty:
                    continue
        finally:
            with self._lock:
                self._open = None
                self.show(phase="waiting", asked=0)


def participants_in(folder: Path) -> tuple[str, ...]:
    """Ids of a study's participants.

    Args:
        folder: the study's folder.

    Returns:
        Ids in the order of the experiment file.
    """
    return tuple(one.id for one in load_study(folder).section("study").participants)


class WebReception:
    """Meets participants on the page ``/study`` (``memo_core.plugin.Reception``)."""

    def __init__(self, settings: WebSettings, folder: Path) -> None:
        """Prepare; no server is started yet.

        Args:
            settings: of the participant's teacher.
            folder: the study's folder.
        """
        self._settings, self._folder = settings, folder

    def agrees(self, participant: str, text: str) -> bool:
        """Ask on the page ``/study``; as ``Reception.agrees``."""
        pages = study_pages(self._settings, self._folder)
        return bool(pages.ask("consent", participant, _agreed, consent=text))

    def about(self, participant: str, known: Demographics) -> Demographics:
        """Ask on the page ``/study``; as ``Reception.about``."""
        missing = [name for name, value in attrs.asdict(known).items() if value is None]
        if not missing:
            return known
        pages = study_pages(self._settings, self._folder)
        told = pages.ask("about", participant, lambda answer: read_answers(answer, missing), missing=missing)
        return attrs.evolve(known, **told)


def _agreed(answer: dict[str, Any]) -> bool:
    if answer.get("agrees") not in (True, False):
        raise InvalidArgument("answer", "neither yes nor no", "one of the two buttons")
    return bool(answer["agrees"])


def read_answers(answer: dict[str, Any], wanted: list[str]) -> dict[str, Any]:
    """Check what a participant told of themselves.

    Args:
        answer: the fields of the form.
        wanted: names of the fields of ``Demographics`` that were asked.

    Returns:
        A value for each answered field; fields that were left empty are left out.

    Raises:
        InvalidArgument: for an age that is none.
    """
    told: dict[str, Any] = {}
    for name in wanted:
        text = str(answer.get(name) if answer.get(name) is not None else "").strip()[:LONGEST_WORDS]
        if not text:
            continue
        if name == "age":
            if not (text.isdecimal() and text.isascii() and 0 < int(text[:4]) < Demographics.OLDEST):
                raise InvalidArgument("age", f"{text[:20]!r} is no age", "a whole number of years, or nothing")
            told[name] = int(text)
        else:
            told[name] = text
    return told


@attrs.define
class _Current:
    study: StudyPages | None = None


_current = _Current()


def study_pages(settings: WebSettings, folder: Path) -> StudyPages:
    """The pages of a study, with the web server that shows them.

    Args:
        settings: of a server that is not started yet.
        folder: the study's folder.

    Returns:
        The same for all runs of the study in this process.

    Raises:
        InvalidArgument: as ``pages_process`` and ``StudyPages``.
        BackendUnavailable: if the server cannot be started.
    """
    pages = pages_process(settings, for_study=True)
    if _current.study is None or _current.study.pages is not pages or _current.study.folder != folder:
        if _current.study is not None:
            _current.study.close()
        _current.study = StudyPages(pages, folder)
    return _current.study
