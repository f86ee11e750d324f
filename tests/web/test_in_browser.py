"""The pages in a real browser: teaching, stopping, looking again; hostile text; what is not live says so."""

from __future__ import annotations

import contextlib
import io
import os
import queue
import signal
import sqlite3
import threading
import time
from urllib.parse import urlsplit

import numpy as np
import pytest
from memo_web.robot_side.listening import Reworded, pages_hear
from memo_web.robot_side.pages_process import PagesProcess
from memo_web.settings import WebSettings
from PIL import Image

from memo_core.events import (
    CodeWritten,
    EntryServed,
    EntryStored,
    EntryStruck,
    FeedbackGiven,
    Problem,
    Retrieved,
    RunEnded,
    RunStarted,
    SkillStarted,
    SubtaskEnded,
    SubtaskStarted,
)
from tests.support.chromium import launched
from tests.support.web_command import WebCommand

pytestmark = [pytest.mark.process, pytest.mark.wire]

WAIT_MS = 90_000
WAIT_S = WAIT_MS / 1000
TASK = "put-the-food-in-the-microwave"
WORDS = "no, pull the handle in an arc"
HOSTILE = (
    '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>'
    "{{constructor.constructor('window.hacked=1')()}}"
)


@pytest.fixture(scope="module")
def browser():
    with launched() as browser:
        yield browser


@contextlib.contextmanager
def opened(browser, url):
    """A page as a new visitor sees it. Errors in the page fail the test, and so does whatever comes from elsewhere."""
    context = browser.new_context(viewport={"width": 1300, "height": 1000})
    context.set_default_timeout(WAIT_MS)
    page = context.new_page()
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda request: problems.append(request.url) if _is_elsewhere(request.url, url) else None)
    try:
        page.goto(url)
        yield page
        assert not problems
    finally:
        context.close()


def _is_elsewhere(address, url):
    here = urlsplit(url).netloc
    return urlsplit(address).netloc != here and not address.startswith(("data:", "blob:"))


def asked(page):
    return int(page.get_by_test_id("question").get_attribute("data-asked") or 0)


def next_question(page, act):
    """Do something, and wait for the question that follows; its text."""
    before = asked(page)
    act()
    asked_now = "+document.querySelector('[data-testid=question]').dataset.asked"
    new = f"before => {asked_now} && {asked_now} != before"
    page.wait_for_function(new, arg=before)
    return page.get_by_test_id("question").inner_text()


def tab_to(page, selector):
    """Move the focus by the tab key alone."""
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("selector => document.activeElement.matches(selector)", selector):
            return
    raise AssertionError(f"the tab key does not reach {selector}")


@pytest.mark.sim
@pytest.mark.slow
def test_a_person_teaches_the_microwave(browser, tmp_path):
    """They begin a task, see the arm move, stop it, say what was wrong, accept the note and approve; by keys alone."""
    with WebCommand(tmp_path, "--task", TASK) as command, opened(browser, command.url) as page:
        page.get_by_test_id("begin").wait_for()
        tab_to(page, "[data-testid=begin]")
        page.keyboard.press("Enter")
        page.get_by_test_id("activity").filter(has_text="follow_path").wait_for()
        assert page.get_by_test_id("task").inner_text() == "Task: put the food in the microwave"
        first = _pixels(page)
        _until(lambda: np.abs(first - _pixels(page)).max() > 40)  # the arm is seen to move

        page.keyboard.press("Escape")
        page.get_by_test_id("stop-state").filter(has_text="stopped").wait_for()
        page.get_by_test_id("question").filter(has_text="Stopped during OPEN(microwave)").wait_for()
        still = _pixels(page)
        page.wait_for_timeout(700)
        assert np.abs(still - _pixels(page)).max() < 40

        tab_to(page, "[data-testid=words]")
        page.keyboard.type(WORDS)
        noted = next_question(page, lambda: page.keyboard.press("Control+Enter"))
        assert f"You said: {WORDS}" in noted and "arc" in noted.split(WORDS)[1]
        page.wait_for_timeout(700)
        assert np.abs(still - _pixels(page)).max() < 40  # the failure stays in view until the notes are settled
        tab_to(page, "[data-choice=accept]")
        done = next_question(page, lambda: page.keyboard.press("Enter"))
        assert "OPEN(microwave), attempt 2. Did it work?" in done
        tab_to(page, "[data-choice=approve]")
        page.keyboard.press("Enter")
        page.get_by_test_id("done").filter(has_text="OPEN(microwave) ✔ worked").wait_for()
        page.get_by_role("button", name="End the run").click()
        page.get_by_role("button", name="End it").click()
        page.get_by_test_id("begin").wait_for()  # another task can be begun

        _look_again(page, command.url)
    with contextlib.closing(sqlite3.connect(tmp_path / "skillbook.db")) as book:
        assert (WORDS,) in book.execute("SELECT words FROM feedback").fetchall()


def _pixels(page):
    data = page.locator("canvas").first.screenshot()
    return np.asarray(Image.open(io.BytesIO(data)).convert("L"), int)


def _look_again(page, url):
    """Both attempts can be scrubbed, with the line that ran."""
    page.goto(f"{url}replay")
    page.get_by_test_id("attempts").filter(has_text="attempt").wait_for()
    tab_to(page, "[data-testid=moment], [data-testid=moment] *")
    seen = set()
    for _ in range(6):
        page.keyboard.press("PageUp")
        page.wait_for_timeout(300)
        seen.add(page.get_by_test_id("clock").inner_text())
    assert len(seen) > 3
    assert _pixels(page).std() > 10  # robot and scene are drawn, though the run is over
    assert page.get_by_test_id("replay-code").inner_text().strip()


# -- without a simulator: the pages as a run's process drives them -----------------------------------------------------
@pytest.fixture(scope="module")
def server():
    pages = PagesProcess(WebSettings(port=0))
    pages.start()
    yield pages
    pages.close()


@pytest.fixture
def pages(server):
    """The server without a run."""
    server.forget("")
    server.stop_pressed = lambda press: None
    for kind, fields in (("stage", {"stage": None}), ("question", {"question": None}), ("own", {"visitor": None})):
        server.send(kind, **fields)
    server.send("notice", text="")
    server.say_stop("clear")
    return server


def stage(text="box", cameras=("front",)):
    shape = {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0, 0, 0], "rotation": np.eye(3).tolist()}
    body = {"name": text, "shapes": [shape | {"colour": "#ff0000", "opacity": 1.0}]}
    return {"robot": text, "real": False, "bodies": [body], "fixed": [], "cameras": list(cameras)}


def test_hostile_text_is_text_in_every_field(browser, pages):
    answers: queue.Queue[dict] = queue.Queue()
    pages.on("answer", answers.put)
    pages.on("remark", answers.put)
    pages_hear(RunStarted(HOSTILE, HOSTILE, HOSTILE, 0, {}))
    pages_hear(SubtaskStarted(HOSTILE, 1, 1))
    served = EntryServed(1, HOSTILE, HOSTILE, HOSTILE, 0.7, 0.9, 0.9, 0.8, hint=True)
    pages_hear(Retrieved(HOSTILE, (served,), ((HOSTILE, 0.1, HOSTILE),)))
    pages_hear(CodeWritten(HOSTILE, 1, f"{HOSTILE}\n```\n{HOSTILE}"))
    pages_hear(SkillStarted(HOSTILE, 1, HOSTILE))
    pages_hear(FeedbackGiven(1, HOSTILE, HOSTILE, HOSTILE))
    pages_hear(EntryStored(1, HOSTILE, HOSTILE, HOSTILE))
    pages_hear(Problem(HOSTILE, HOSTILE))
    pages_hear(SubtaskEnded(HOSTILE, HOSTILE, 1))
    pages.send("stage", keep="stage", stage=stage(HOSTILE, (HOSTILE,)))
    pages.send("frame", np.array([[0, 0, 0, 1, 0, 0, 0]], np.float32).tobytes(), keep="frame", time=0.0, line=1)
    pages.send("picture", _jpeg(), keep="picture", camera=HOSTILE, note=HOSTILE)
    pages.send("notice", keep="notice", text=HOSTILE)
    question = {
        "id": 1,
        "about": HOSTILE,
        "title": HOSTILE,
        "lines": [HOSTILE],
        "choices": [["yes", HOSTILE]],
        "words": HOSTILE,
        "code": HOSTILE,
        "notes": [{"key": HOSTILE, "text": HOSTILE}],
        "plan_choice": True,
    }
    pages.send("question", keep="question", question=question)
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_test_id("asked").wait_for()
        for name in ("The program", "What it remembered, and why", "What was said and noted"):
            page.get_by_text(name, exact=True).click()
        page.get_by_test_id("said").filter(has_text="noted").wait_for()
        for place in ("task", "question", "done", "program", "retrieved", "said"):
            page.get_by_test_id(place).filter(has_text=HOSTILE).wait_for()
        page.get_by_test_id("retrieved").filter(has_text="a hint").filter(
            has_text="score 0.70; likeness 0.80"
        ).wait_for()
        page.get_by_test_id("words").fill(HOSTILE)
        page.get_by_test_id("send").click()
        assert answers.get(timeout=WAIT_S)["words"] == HOSTILE
        page.goto(f"{pages.url}replay")
        page.get_by_test_id("replay-code").filter(has_text="onerror").wait_for()
        assert page.evaluate("window.hacked") is None
        assert not page.locator("img[src=x], .q-page script").count()


def test_a_note_that_was_struck_is_shown_as_struck(browser, pages):
    pages_hear(RunStarted("run-1", "task", "open it", 0, {}))
    for number, text in ((1, "Pull it."), (2, "Push it.")):
        pages_hear(EntryStored(number, "correction", "OPEN(door)", text))
    pages_hear(EntryStruck(1, "correction", "OPEN(door)", "Pull it."))
    pages.send("stage", keep="stage", stage=stage())
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_text("What was said and noted", exact=True).click()
        page.get_by_text("noted (OPEN(door)): Push it.").wait_for()
        page.locator(".text-strike", has_text="struck (OPEN(door)): Pull it.").wait_for()
        assert page.locator(".text-strike").count() == 1


def test_the_words_that_notes_were_made_of_are_shown_without_commands(browser, pages):
    pages_hear(RunStarted("run-1", "task", "open it", 0, {}))
    pages_hear(FeedbackGiven(1, "Kim", "OPEN(door)", "not so"))
    pages_hear(Problem("feedback 1 is set aside (see `memo skillbook list`)", "nothing could be learnt from it"))
    pages_hear(Reworded("Kim", "always in an arc"))
    pages_hear(EntryStored(1, "general", "*", "Go in an arc.", 2))
    pages_hear(EntryStored(2, "template", "OPEN(door)", "import math"))
    again = "stop was pressed; the next run, or `memo skillbook retry`, asks about it again"
    pages_hear(Problem("feedback 3 stays pending", again))
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_text("What was said and noted", exact=True).click()
        page.get_by_text("noted (everywhere): Go in an arc.").wait_for()
        assert page.get_by_test_id("said").inner_text().splitlines()[-6:] == [
            "Kim, about OPEN(door): not so",
            "not noted: nothing could be learnt from it",
            "Kim, in other words: always in an arc",
            "noted (everywhere): Go in an arc.",
            "kept (OPEN(door)): the program that worked",
            "not noted: stop was pressed; the next run asks about it again",
        ]


def test_without_a_run_the_field_is_off_and_says_so(browser, pages):
    with opened(browser, f"{pages.url}teach") as page:
        field, scene = page.get_by_label("No run goes on"), page.locator("canvas").first
        field.wait_for()
        assert field.is_disabled() and page.get_by_test_id("send").is_disabled() and not scene.is_visible()
        pages.send("stage", keep="stage", stage=stage())
        page.get_by_label("Say what is wrong at any time").wait_for()
        scene.wait_for()
        page.wait_for_function("document.querySelector('canvas').clientHeight > 400")
        assert page.get_by_test_id("words").is_enabled() and page.get_by_test_id("send").is_enabled()


def test_on_a_phone_the_question_is_above_the_pictures_and_nothing_is_cut_off(browser, pages):
    pages.send("stage", keep="stage", stage=stage())
    question = {
        "id": 1,
        "about": "attempt",
        "title": "Did it work?",
        "lines": [],
        "choices": [["approve", "It worked"]],
    }
    pages.send("question", keep="question", question=question | {"words": "What was wrong?"})
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_test_id("asked").wait_for()
        page.locator("canvas").first.wait_for()
        for width, above in ((1300, False), (390, True)):
            page.set_viewport_size({"width": width, "height": 844})
            _until(lambda above=above: _question_above(page) == (above, above))
            _until(lambda width=width: page.evaluate("document.documentElement.scrollWidth") == width)


def _question_above(page):
    """Whether the question is above the scene, and whether it begins at the same side."""
    asked, seen = page.get_by_test_id("asked").bounding_box(), page.locator("canvas").first.bounding_box()
    return asked["y"] < seen["y"] - 200, asked["x"] < seen["x"] + 50


def test_how_a_run_ended_is_said_once(browser, pages):
    for success, said in (
        (True, "The task is done."),
        (False, "The task is not done. Why the run ended: no time left."),
    ):
        pages_hear(RunStarted("run-1", "task", "open it", 0, {}))
        pages_hear(RunEnded("run-1", success, "no time left", 1.0, 1.0))
        with opened(browser, f"{pages.url}teach") as page:
            page.get_by_test_id("activity").filter(has_text="The task").wait_for()
            assert page.get_by_test_id("activity").inner_text() == said


def test_long_words_are_refused_and_stay_in_the_field(browser, pages):
    remarks: queue.Queue[dict] = queue.Queue()
    pages.on("remark", remarks.put)
    pages.send("stage", keep="stage", stage=stage())
    with opened(browser, f"{pages.url}teach") as page:
        field = page.get_by_test_id("words")
        field.evaluate("field => field.removeAttribute('maxlength')")  # as a script could
        field.fill("x" * 4001)
        page.get_by_test_id("send").click()
        page.get_by_text("That is too long: 4001 characters").wait_for()
        field.fill("this is short enough")
        page.get_by_test_id("send").click()
        assert remarks.get(timeout=WAIT_S)["words"] == "this is short enough"


def test_every_press_of_stop_arrives(browser, pages):
    presses: queue.Queue[str] = queue.Queue()
    pages.stop_pressed = presses.put
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_role("button", name="STOP").wait_for()
        page.evaluate("for (let n = 0; n < 200; n++) document.querySelector('.memo-stop').click()")
        came = {presses.get(timeout=WAIT_S) for _ in range(200)}
        assert len(came) == 200


def test_what_is_not_live_is_grey_and_says_so(browser, pages):
    pages.send("stage", keep="stage", stage=stage())
    with opened(browser, f"{pages.url}teach") as page:
        banner = page.get_by_text("Not live")
        banner.wait_for()  # no beat of a robot yet
        beating = queue.SimpleQueue()

        def beat():
            while beating.empty():
                pages.send("beat", droppable=True, current=True)
                time.sleep(0.05)

        threading.Thread(target=beat, daemon=True).start()
        banner.wait_for(state="hidden")
        process = pages._connection._process.pid
        os.kill(process, signal.SIGSTOP)  # the server hangs: nothing tells the page
        try:
            banner.wait_for()
            grey = page.evaluate("getComputedStyle(document.querySelector('.memo-live')).filter")
            assert "grayscale" in grey
            page.get_by_role("button", name="STOP").click()
        finally:
            os.kill(process, signal.SIGCONT)
        beating.put(None)


def test_a_stop_that_does_not_arrive_is_said(browser, pages):
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_role("button", name="STOP").wait_for()
        process = pages._connection._process.pid
        os.kill(process, signal.SIGSTOP)  # the server hangs
        try:
            page.get_by_role("button", name="STOP").click()
            page.get_by_test_id("stop-state").filter(has_text="did NOT reach the robot").wait_for()
        finally:
            os.kill(process, signal.SIGCONT)


def test_the_run_knows_whether_a_page_is_open(browser, pages):
    with opened(browser, f"{pages.url}teach"):
        _until(lambda: pages.watched)
    _until(lambda: not pages.watched)


def test_another_visitor_sees_nothing_of_a_session_that_has_an_owner(browser, pages):
    pages.send("stage", keep="stage", stage=stage())
    pages.send("picture", _jpeg(), keep="picture", camera="front")
    pages.send("own", keep="own", visitor="a" * 22)
    with opened(browser, f"{pages.url}teach") as page:
        page.get_by_text("Somebody else teaches the robot now.").wait_for()
        assert not page.get_by_test_id("words").count()
        assert page.request.get(f"{pages.url}picture/front").status == 404
        page.goto(f"{pages.url}replay")
        page.get_by_text("Somebody else teaches the robot now.").wait_for()
        page.context.add_cookies([{"name": "memo_visitor", "value": "a" * 22, "url": pages.url}])
        page.goto(f"{pages.url}teach")
        page.get_by_test_id("words").wait_for()


def _until(true):
    until = time.monotonic() + WAIT_S
    while not true():
        assert time.monotonic() < until
        time.sleep(0.02)


def _jpeg():
    data = io.BytesIO()
    Image.fromarray(np.zeros((24, 32, 3), np.uint8)).save(data, "JPEG")
    return data.getvalue()
