"""Participants of a study in a real browser: they see their own session only, and nothing that they said is lost."""

from __future__ import annotations

import io
import json
import re
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from memo_core.skillbook import Skillbook
from tests.support.chromium import launched
from tests.support.web_study import Operator, Participant, StudyCommand, Visitor

pytestmark = [pytest.mark.process, pytest.mark.wire, pytest.mark.slow, pytest.mark.timeout(900)]

HOSTILE = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>{{777*777}}'
FURTHER = f"pull further {HOSTILE}"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as running:
        yield running


def feedback_in(study: StudyCommand) -> list[tuple[str, str]]:
    """Speakers and words of the feedback in the first history's book."""
    with Skillbook(str(study.folder / "history-0" / "skillbook.db"), read_only=True) as book:
        ids = book.sources([entry.id for entry in book.entries(superseded=True)])
        said = {one.id: one for one in (*map(book.feedback, ids), *book.pending_feedback(parked=True))}
    return [(one.who, one.words) for _, one in sorted(said.items()) if one.words]


def unharmed(visitor: Visitor) -> None:
    """Check that nothing typed ran as code or became an element."""
    assert not visitor.dialogs
    assert visitor.page.evaluate(
        "() => [window.hacked === undefined, document.querySelector('img[src=x]') === null]"
    ) == [
        True,
        True,
    ]


def test_pages_closed_twice_a_killed_server_and_a_killed_command_lose_nothing(browser, tmp_path: Path):
    with StudyCommand(tmp_path) as study:
        operator = Operator(browser, study)
        participant = Participant(browser, study, operator.address_of("P01"))
        participant.sees("Do you want to take part?")
        participant.close_and_come_back()
        participant.agree()
        participant.introduce(age="31", gender=HOSTILE, robots=HOSTILE, models="")
        assert participant.asked() == "OPEN(cupboard), attempt 1. Did it work?"
        assert re.search(r"Task 1 of this session\s+2\d:\d\d left", participant.says())
        participant.close_and_come_back()
        assert participant.asked() == "OPEN(cupboard), attempt 1. Did it work?"
        with participant.loaded_anew():
            study.kill_server()
            participant.sees("Not live")
        participant.answer(words=FURTHER)
        assert participant.asked() == "I noted:"
        participant.sees(FURTHER)
        unharmed(participant)
        with participant.loaded_anew():
            study.kill()
            study.resume()
        assert participant.asked() == "I noted:"
        for link in ("Teach", "Why"):
            assert participant.page.get_by_role("link", name=link, exact=True).count() == 0
        assert re.search(r"Task 1 of this session\s+2\d:\d\d left", participant.says())
        participant.answer("accept")
        assert participant.asked() == "OPEN(cupboard), attempt 2. Did it work?"
        _see_uses(operator, "not over yet")
        participant.answer("approve")
        participant.asked()
        _see_uses(operator, "it worked")
        _cannot_forget_now(operator)
        operator.go("operator")
        export = f"memo study export {study.folder.parent} --to PUBLIC"
        assert export in operator.says()
        with operator.page.expect_navigation(url=re.compile("/ended$")):
            participant.approve_the_rest()
        assert export in operator.says()
        assert study.ended() == 0, study.printed
        assert "Thank you for taking part" in participant.says()
        assert export in study.printed and re.search(r"open-the-cupboard: (not )?done, 1 correction\n", study.printed)
        assert feedback_in(study) == [("P01", FURTHER)]
        lines = study.journal()
        assert [line["participant"] for line in lines if "session" in line and "begin" not in line] == ["P01"]
        assert [line["corrections"] for line in lines if "end" in line] == [1]
        told = [json.loads(line) for line in (study.folder / "people.jsonl").read_text().splitlines()]
        assert told == [
            {"participant": "P01", "age": 31, "gender": HOSTILE, "robots": HOSTILE, "language_models": None}
        ]


def test_each_sees_their_own_session_and_the_operator_what_was_said_and_can_forget_it(browser, tmp_path: Path):
    with StudyCommand(tmp_path, ("P01", "P02"), rounds=2, minutes=0.02) as study:
        operator = Operator(browser, study)
        addresses = [operator.address_of(one) for one in ("P01", "P02")]
        operator.sees(addresses[0])
        assert all(
            f"memo: {who} opens {at}" in study.printed for who, at in zip(("P01", "P02"), addresses, strict=True)
        )
        first = Participant(browser, study, operator.address_of("P01"))
        second = Participant(browser, study, operator.address_of("P02"))
        stranger = Visitor(browser, study)
        stranger.page.goto(addresses[0])
        stranger.sees("This address was opened in another browser before")
        assert stranger.page.get_by_role("link", name="Your session").count() == 0
        assert stranger.page.request.get(f"{study.url}ended").status == 404
        second.sees("Your session has not begun")
        first.agree()
        first.introduce()
        first.asked()
        for other in (second, stranger):
            for path in ("teach", "replay"):
                assert "Somebody else teaches the robot now." in other.go(path), path
            for path in ("operator", "why", "why/1"):
                assert "for the person who runs the study" in other.go(path), path
            assert other.page.request.get(f"{study.url}picture/front").status == 404
        assert "cupboard" not in second.go("study") and "Nobody's session" in stranger.go("study")
        assert "nobody's in this study" in stranger.go("enter/0000000000000000000000")
        assert first.page.request.get(f"{study.url}picture/front").status == 200
        assert "for the person who runs the study" in Visitor.go(second, "why")
        second.go("study")
        first.answer(words=FURTHER)
        first.answer("accept")
        first.sees("Thank you for taking part")
        second.sees("Do you want to take part?")
        assert "pull further" not in second.says()
        _see_why(operator)
        _export(operator)
        _forget(operator, study)
        operator.go("operator")
        operator.press("Pause the study …")
        operator.press("Pause now")
        assert study.ended() == 130 and "to continue: memo study resume" in study.printed
        for one in (operator, first, second, stranger):
            unharmed(one)


def _see_why(operator: Operator) -> None:
    """Check the list, a search, and the page of the note."""
    operator.go("operator")
    operator.sees("pull further")
    assert "between sessions" not in operator.says() and "P02 · reading the consent text" in operator.says()
    operator.go("why")
    operator.sees("1 entry")
    assert "OPEN(cupboard)" in operator.says()
    operator.fill("words", "drawer")
    operator.sees("Nothing was found.")
    operator.fill("words", "FURTHER cupboard")
    operator.sees("1 entry")
    operator.page.get_by_role("link", name="correction 1").click()
    operator.sees("What people said")
    shown = operator.says()
    assert "Go further than the plain way." in shown and FURTHER in shown, "the note, and its words"
    for text in ("P01", "about OPEN(cupboard)", 'in "open the cupboard"', "Read back to P01", "accepted"):
        assert text in shown, text
    assert "It was not retrieved yet." in shown
    operator.page.get_by_text("The program that this was said about").click()
    operator.sees("open_gripper")
    unharmed(operator)
    operator.go("why/999")
    operator.sees("This cannot be shown")


def _see_uses(operator: Operator, outcome: str) -> None:
    """The retrieval of the only note for the second attempt, and what came of it."""
    operator.go("why/1")
    operator.sees(outcome)
    shown = operator.says()
    assert "OPEN(cupboard), attempt 2" in shown and 'in "open the cupboard"' in shown
    operator.page.get_by_text("The program that was written with it").first.click()
    operator.sees("open_gripper")


def _cannot_forget_now(operator: Operator) -> None:
    """Forgetting would rewrite files that the run writes to."""
    operator.go("why")
    operator.sees("2 entries")
    assert "program 2" in operator.says()
    _ask_to_forget(operator)
    operator.fill("type P01 to confirm", "P01")
    operator.press("Forget for good")
    operator.sees("still going on")
    operator.sees("2 entries")
    _ask_to_forget(operator)  # the person can still be chosen
    operator.sees("Forget P01 for good?")
    operator.press("Keep")


def _ask_to_forget(operator: Operator) -> None:
    person = operator.page.get_by_label("person")
    for key in ("ArrowDown", "ArrowDown", "Enter"):  # no menu need be drawn, which a 3-D view elsewhere can hold up
        person.press(key)
    operator.sees("P01")
    operator.press("Forget …")


def _export(operator: Operator) -> None:
    """The archive has the words; ids only where they are asked for."""
    operator.go("operator")
    for with_ids in (False, True):
        if with_ids:
            operator.page.get_by_text("with ids, and").click()
        with operator.page.expect_download() as download:
            operator.press("Export")
        files = zipfile.ZipFile(io.BytesIO(Path(download.value.path()).read_bytes()))
        assert ("people.jsonl" in files.namelist()) == with_ids
        [remark] = [json.loads(line) for line in files.read("remarks.jsonl").splitlines()]
        assert remark["words"] == FURTHER and ("participant" in remark) == with_ids


def _forget(operator: Operator, study: StudyCommand) -> None:
    """Only by the person's id, typed once more."""
    operator.go("why")
    _ask_to_forget(operator)
    operator.fill("type P01 to confirm", "P1")
    operator.press("Forget for good")
    operator.sees("exactly as it is written")
    assert feedback_in(study) == [("P01", FURTHER)]
    operator.fill("type P01 to confirm", "P01")
    operator.press("Forget for good")
    operator.sees("P01 is forgotten")
    operator.sees("Nothing was found.")
    assert feedback_in(study) == []
    for file in study.folder.rglob("*"):
        if file.is_file() and file.name not in ("skillbook.db",):
            assert b"pull further" not in file.read_bytes(), file


@pytest.mark.on_request
@pytest.mark.timeout(40 * 60)
def test_twenty_minutes_with_pages_closed_twice_and_a_killed_server_lose_nothing(browser, tmp_path: Path):
    """A participant teaches one task after the other in real time. No two remarks are alike."""
    tasks = ("open-the-cupboard", "open-the-locker", "open-the-dresser", "open-the-medicine-cabinet")
    minutes = 20
    with StudyCommand(tmp_path, tasks=tasks, rounds=20, minutes=minutes, hours=minutes / 60, pace="auto") as study:
        participant = Participant(browser, study, Operator(browser, study).address_of("P01"))
        participant.agree()
        participant.introduce()
        began = time.monotonic()
        incidents = [
            (minutes * 0.2, participant.close_and_come_back),
            (minutes * 0.4, lambda: _kill_server(participant)),
            (minutes * 0.6, participant.close_and_come_back),
        ]
        while not participant.is_over():
            if incidents and time.monotonic() - began > 60 * incidents[0][0]:
                incidents.pop(0)[1]()
            participant.teach(lambda number: f"remark {number}: pull further, along an arc")
        assert not incidents and study.ended() == 0, study.printed
        assert time.monotonic() - began > 60 * minutes * 0.95
        said = [("P01", words) for words in participant.said]
        assert len(said) > 5 and sorted(feedback_in(study)) == sorted(said)
        ends = [line for line in study.journal() if "end" in line]
        assert sum(line["corrections"] + line["planning_remarks"] for line in ends) == len(said)
        print(f"{len(said)} remarks in {len(ends)} runs, {time.monotonic() - began:.0f} s")


def _kill_server(participant: Participant) -> None:
    with participant.loaded_anew():
        participant.study.kill_server()
