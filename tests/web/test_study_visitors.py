"""Identities of visitors in a study in the browser, and the questions before a session."""

from __future__ import annotations

import json
import stat
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from memo_web.pages.study_state import StudyState
from memo_web.robot_side import study as robot_side, teacher as teacher_module
from memo_web.robot_side.listening import pages_hear
from memo_web.robot_side.study import FILE, OPERATOR, StudyPages, Visitors, WebReception, read_answers
from memo_web.robot_side.teacher import WebTeacher
from memo_web.settings import WebSettings

from memo_core.errors import InvalidArgument, Stopped
from memo_core.events import SessionEnded, SessionTask, TimeLeft
from memo_core.interfaces.reception import Demographics
from memo_core.plugin import Stage

ME, OTHER = "m" * 22, "o" * 22


# -- keys --------------------------------------------------------------------------------------------------------------
def test_a_key_makes_a_visitor_somebody_also_after_a_restart(tmp_path: Path):
    visitors = Visitors(tmp_path, ("P01", "P02"))
    assert len(set(visitors.keys.values())) == 3 and visitors.newest("P01") is None
    assert visitors.enter(visitors.keys["P01"], ME) == "P01"
    again = Visitors(tmp_path, ("P01", "P02", "P03"))
    assert again.keys.items() >= visitors.keys.items() and again.roles == {ME: "P01"} and "P03" in again.keys
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600


def test_the_browser_that_came_last_is_a_persons_own(tmp_path: Path):
    visitors = Visitors(tmp_path, ("P01",))
    for who in (ME, OTHER):
        visitors.enter(visitors.keys["P01"], who)
    assert visitors.newest("P01") == OTHER
    visitors.enter(visitors.keys["P01"], ME)
    assert visitors.newest("P01") == ME
    assert visitors.enter(visitors.keys[OPERATOR], ME) == OPERATOR and visitors.newest("P01") == OTHER


@pytest.mark.parametrize("key", ["", "x", "0" * 22, "P01", "schlüssel"])
def test_a_wrong_key_is_nobodys(tmp_path: Path, key: str):
    visitors = Visitors(tmp_path, ("P01",))
    with pytest.raises(InvalidArgument, match="nobody's"):
        visitors.enter(key, ME)
    assert visitors.roles == {}


@pytest.mark.parametrize("text", ["", "{", "[]", '{"keys": []}', '{"keys": {}, "visitors": 1}'])
def test_a_damaged_file_is_named(tmp_path: Path, text: str):
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InvalidArgument, match=FILE):
        Visitors(tmp_path, ("P01",))


# -- a study's pages ---------------------------------------------------------------------------------------------------
class Pages:
    """Stands in for the process of the web server."""

    def __init__(self) -> None:
        self.settings = WebSettings()
        self.url, self.lost = "http://127.0.0.1:1/", False
        self.offered: dict[str, Any] = {}
        self.shown: list[dict[str, Any]] = []

    def offer(self, name: str, answer: Any) -> None:
        self.offered[name] = answer

    def send(self, kind: str, keep: str = "", **fields: Any) -> None:
        assert kind == keep == "study"
        self.shown.append(json.loads(json.dumps(fields["study"])))


@pytest.fixture
def pages() -> Pages:
    return Pages()


@pytest.fixture
def study(pages, tmp_path, monkeypatch) -> StudyPages:
    """A study of P01 and P02, both of whom have come."""
    monkeypatch.setattr(robot_side, "participants_in", lambda folder: ("P01", "P02"))
    made = StudyPages(pages, tmp_path)
    monkeypatch.setattr(robot_side, "study_pages", lambda settings, folder: made)
    for name, visitor in (("P01", ME), ("P02", OTHER)):
        pages.offered["study.enter"](key=made.visitors.keys[name], visitor=visitor)
    yield made
    made.close()


def asked(study: StudyPages, work: Any) -> tuple[threading.Thread, list[Any]]:
    """Begin to ask in another thread; its result or error is in the list when the thread ends."""
    got: list[Any] = []

    def ask() -> None:
        try:
            got.append(work())
        except Exception as error:
            got.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    while not study.pages.shown[-1].get("asked"):
        assert thread.is_alive(), got
    return thread, got


def test_consent_is_asked_of_its_participant_only(study, pages, tmp_path):
    reception = WebReception(pages.settings, tmp_path)
    thread, got = asked(study, lambda: reception.agrees("P01", "You may withdraw."))
    shown = pages.shown[-1]
    assert (shown["phase"], shown["participant"], shown["owner"]) == ("consent", "P01", ME)
    answer = pages.offered["study.answer"]
    with pytest.raises(InvalidArgument, match="another participant's session"):
        answer(number=shown["asked"], visitor=OTHER, answer={"agrees": True})
    with pytest.raises(InvalidArgument, match="another participant's session"):
        answer(number=shown["asked"], visitor="unknown", answer={"agrees": True})
    with pytest.raises(InvalidArgument, match="neither yes nor no"):
        answer(number=shown["asked"], visitor=ME, answer={"agrees": "yes"})
    with pytest.raises(InvalidArgument, match="answered already"):
        answer(number=shown["asked"] - 1, visitor=ME, answer={"agrees": True})
    assert answer(number=shown["asked"], visitor=ME, answer={"agrees": False})
    thread.join(5)
    assert got == [False] and pages.shown[-1]["phase"] == "waiting"
    with pytest.raises(InvalidArgument, match="answered already"):
        answer(number=shown["asked"], visitor=ME, answer={"agrees": True})


def test_only_what_is_not_known_is_asked(study, pages, tmp_path):
    reception = WebReception(pages.settings, tmp_path)
    everything = Demographics(30, "f", "none", "daily")
    assert reception.about("P01", everything) == everything
    thread, got = asked(study, lambda: reception.about("P01", Demographics(gender="f")))
    assert pages.shown[-1]["missing"] == ["age", "robots", "language_models"]
    given = {"age": " 41 ", "gender": "not asked", "robots": "", "language_models": "x" * 9000}
    pages.offered["study.answer"](number=pages.shown[-1]["asked"], visitor=ME, answer=given)
    thread.join(5)
    assert got == [Demographics(41, "f", None, "x" * 4000)]


@pytest.mark.parametrize("age", ["abc", "-3", "0", "130", "9" * 5000, "3.5", "³"])
def test_an_age_that_is_none_is_refused(age: str):
    with pytest.raises(InvalidArgument, match="is no age"):
        read_answers({"age": age}, ["age"])


def test_only_the_operator_pauses_and_that_ends_what_is_asked(study, pages):
    thread, got = asked(study, lambda: study.ask("consent", "P01", lambda answer: answer))
    with pytest.raises(InvalidArgument, match="only the person who runs the study"):
        pages.offered["study.pause"](visitor=ME)
    ended: list[bool] = []
    study.end_run = lambda: ended.append(True)
    pages.offered["study.enter"](key=study.visitors.keys[OPERATOR], visitor="operator's")
    assert pages.offered["study.pause"](visitor="operator's")
    thread.join(5)
    assert ended == [True] and isinstance(got[0], Stopped)


def test_a_server_that_is_gone_ends_what_is_asked(study, pages):
    thread, got = asked(study, lambda: study.ask("consent", "P01", lambda answer: answer))
    pages.lost = True
    thread.join(5)
    assert isinstance(got[0], Stopped)


def test_the_pages_follow_a_session(study, pages):
    pages_hear(SessionTask("P01", 1, 2, True, 1800.0, 600.0, False))
    shown = pages.shown[-1]
    assert (shown["phase"], shown["participant"], shown["number"], shown["owner"]) == ("task", "P01", 2, ME)
    before = shown["ends_at"]
    pages_hear(TimeLeft(300.0))
    assert 299 < before - pages.shown[-1]["ends_at"] < 301
    pages_hear(SessionEnded("P01", 1))
    assert (pages.shown[-1]["phase"], pages.shown[-1]["session_over"]) == ("over", ["P01"])
    pages_hear(SessionTask("P02", 2, 1, False, 1800.0, 1800.0, False))
    assert pages.shown[-1]["owner"] == OTHER
    pages_hear(SessionEnded("P02", 2))
    pages_hear(SessionTask("P01", 3, 1, False, 1800.0, 1800.0, False))
    assert pages.shown[-1]["session_over"] == ["P02"]
    pages_hear(SessionEnded("P01", 3))


def test_a_session_that_was_resumed_before_there_was_a_server_is_known(pages, tmp_path, monkeypatch):
    monkeypatch.setattr(robot_side, "participants_in", lambda folder: ("P01",))
    pages_hear(SessionTask("P01", 1, 2, True, 1800.0, 600.0, False))
    made = StudyPages(pages, tmp_path)
    assert (pages.shown[-1]["phase"], pages.shown[-1]["participant"], pages.shown[-1]["number"]) == ("task", "P01", 2)
    made.close()
    pages_hear(SessionEnded("P01", 1))


def test_each_run_also_a_resumed_one_names_its_book_to_the_pages(monkeypatch):
    sent: list[tuple[str, str, str]] = []
    teacher = WebTeacher(WebSettings())
    teacher._pages = SimpleNamespace(
        send=lambda kind, keep="", url="", **fields: sent.append((kind, keep, url)), say_stop=lambda state: None
    )
    monkeypatch.setattr(teacher_module, "Live", lambda *given: SimpleNamespace(close=lambda: None))
    stage = Stage(None, None, None, Path(), lambda: None, lambda: None, object(), book="book.db")
    teacher.watch(stage)
    assert ("book", "book", "book.db") in sent, "kept, for a server that has to be started anew"
    teacher.unwatch()


# -- what each sees ----------------------------------------------------------------------------------------------------
class View:
    """Stands in for the run's view."""

    def __init__(self) -> None:
        self.owner: str | None = None
        self.cleared = 0

    def clear(self) -> None:
        self.cleared += 1


def test_a_session_that_becomes_anothers_is_cleared_and_nobody_owns_it_before_they_come():
    view = View()
    state = StudyState(view)
    assert not state.held and state.sees_all(ME) and state.start_page(ME) == "/teach"
    shown = {"roles": {ME: "P01", "operator's": OPERATOR}, "phase": "task", "participant": "P01"}
    for owner, cleared in ((ME, 0), (ME, 0), (OTHER, 1), (None, 2)):
        state.take({"study": shown | {"owner": owner}}, b"")
        assert view.cleared == cleared
    assert view.owner not in (None, ME, OTHER), "while its participant has not come, nobody owns the session"
    assert not state.sees_all(ME) and state.sees_all("operator's") and not state.sees_all("stranger's")
    assert [state.start_page(one) for one in (ME, "operator's", "stranger's")] == ["/study", "/operator", "/study"]
