"""Why pages without a study: hostile text is shown as text wherever it comes from, and a person is forgotten."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from memo_core.skillbook import Skillbook
from memo_core.skillbook.functions import LearntFunction, functions_of
from memo_core.skillbook.track_record import note_trial
from tests.support.chromium import launched
from tests.support.function_books import merged, teach_doors
from tests.support.web_command import WebCommand

pytestmark = [pytest.mark.process, pytest.mark.wire, pytest.mark.slow, pytest.mark.timeout(900)]

HOSTILE = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>{{ 777*777 }} `a` **b** ![c](x) </pre>'
KEY = "OPEN(microwave)"
CODE = f'def open_it(door="m"):\n    """{HOSTILE}"""\n    look()\n'


def hostile_book(folder: Path) -> LearntFunction:
    """Make a book whose texts want to be more than text, with the folder of a run and a function of two people."""
    run = folder / "run-one"
    run.mkdir()
    with Skillbook(str(folder / "book.db")) as book:
        about = {"task": HOSTILE, "subtask": KEY, "scene": HOSTILE, "code": CODE, "run": HOSTILE}
        said = book.record_feedback(HOSTILE, HOSTILE, **about)
        [note] = book.add_lessons(said, KEY, [HOSTILE], [f"general {HOSTILE}"], HOSTILE)[:1]
        program = book.add_template(book.record_feedback(HOSTILE, "ben", kind="approval", **about), KEY, CODE)
        note_trial(book, program.id, HOSTILE, True)
        book.note_place("run", run)
        teach_doors(book, "OPEN(oven)", "OPEN(fridge)")
        merged(book)
        [learnt] = functions_of(book)
        served = [{"entry": one, "score": 0.5} for one in (note.id, program.id)]
    events = [
        {"event": "RunStarted", "run": HOSTILE, "instruction": HOSTILE},
        {"event": "SubtaskStarted", "subtask": KEY, "attempt": 1},
        {"event": "Retrieved", "subtask": HOSTILE, "served": served, "time": 1.0},
        {"event": "CodeWritten", "code": CODE},
        {"event": "CodeEnded", "error": HOSTILE},
        {"event": "FeedbackGiven", "words": HOSTILE},
    ]
    (run / "events.jsonl").write_text("".join(f"{json.dumps(one)}\n" for one in events))
    return learnt


def checked(page: Any) -> str:
    """The page's text, after a look for anything that ran or became an element."""
    page.wait_for_timeout(800)
    ran = page.evaluate("() => window.hacked !== undefined || document.querySelector('[src=x]') !== null")
    assert not ran and "603729" not in page.inner_text("body")
    return str(page.inner_text("body"))


def test_hostile_text_is_text_on_every_why_page_and_its_author_can_be_forgotten(tmp_path: Path):
    learnt = hostile_book(tmp_path)
    with WebCommand(tmp_path, "--book", str(tmp_path / "book.db")) as web, launched() as browser:
        page = browser.new_page()
        page.set_default_timeout(120_000)
        dialogs: list[str] = []
        page.on("dialog", lambda dialog: (dialogs.append(dialog.message), dialog.dismiss()))
        page.goto(f"{web.url}why")
        assert "6 entries" in checked(page)
        page.get_by_label("words").fill(HOSTILE[:60])
        page.wait_for_timeout(500)
        assert "entries" in checked(page)
        for number, times in ((1, 5), (2, 1), (3, 6)):
            page.goto(f"{web.url}why/{number}")
            page.get_by_text("What people said").wait_for()
            for fold in page.locator(".q-expansion-item").all():
                fold.click()
            assert checked(page).count(HOSTILE) >= times, number
        _see_function(page, web.url, learnt)
        page.goto(f"{web.url}why")
        page.get_by_text("newest first").wait_for()
        checked(page)
        page.get_by_label("person").click()
        page.get_by_role("option").filter(has_text="onerror").click()
        page.get_by_role("button", name="Forget …").click()
        checked(page)
        page.get_by_label("to confirm").fill(HOSTILE)
        page.get_by_role("button", name="Forget for good").click()
        page.get_by_text("is forgotten").wait_for()
        checked(page)
        assert not dialogs
    with Skillbook(str(tmp_path / "book.db"), read_only=True) as book:
        assert book.people() == ["ana", "ben"]
        assert [entry.kind for entry in book.entries()] == ["template", "function", "call", "call"]


def _see_function(page: Any, url: str, learnt: LearntFunction) -> None:
    """Check the page of a function, and the way to it from one of its calls."""
    page.goto(f"{url}why/{learnt.calls[0].id}")
    page.get_by_role("link", name=f"function {learnt.entry.id}").click()
    page.get_by_text(f"Function open_hinged ({learnt.entry.id})").wait_for()
    page.get_by_text("in place of the program").first.click()
    page.get_by_text("lead_along_arc").nth(1).wait_for()
    shown = checked(page)
    for text in ("Learnt from 2 programs of ana, ben.", "(said that it worked)", "the code of approved programs"):
        assert text in shown, shown
    for call in learnt.calls:
        assert call.text in shown


def test_pages_of_what_is_not_there_say_so_and_nothing_is_made(tmp_path: Path):
    with WebCommand(tmp_path, "--book", str(tmp_path / "none.db")) as web, launched() as browser:
        page = browser.new_page()
        for path in ("why", "why/7"):
            page.goto(f"{web.url}{path}")
            page.get_by_text("This cannot be shown").first.wait_for()
        assert page.request.get(f"{web.url}why/x").status in (404, 422)
        page.goto(f"{web.url}study")
        page.get_by_text("No study is held").wait_for()
        page.goto(f"{web.url}operator")
        page.get_by_text("for the person who runs the study").wait_for()
    assert not (tmp_path / "none.db").exists()
