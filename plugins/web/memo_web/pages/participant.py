"""The page ``/study`` of a participant: consent, questions, tasks; and ``/enter/KEY``, which says who a visitor is."""

from __future__ import annotations

from typing import Any

from fastapi.responses import HTMLResponse
from nicegui import app, ui

from memo_core.plugin import LONGEST_WORDS
from memo_web.pages.layout import LINKS, framed, visitor
from memo_web.pages.run_view import AskFailed, RunView
from memo_web.pages.study_state import OPERATOR, StudyState, study_of
from memo_web.pages.teach import TeachingPage
from memo_web.pages.text import heading, words

_WATCH_S = 0.2
QUESTIONS = {
    "age": "Your age in years",
    "gender": "Your gender",
    "robots": "Your experience with robots",
    "language_models": "Your experience with language models",
}


THANKS = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>Thank you · MEMO</title></head>
<body style="font-family: sans-serif; margin: 3rem"><h1>That was your session</h1>
<p>Thank you for taking part. You may close this page.</p>
<p>If you come again later, open your own address again.</p></body></html>
"""  # without a connection that could be lost when the study ends


def add_pages(view: RunView) -> None:
    """Add the pages of participants.

    Args:
        view: the run.
    """
    study = study_of(view)
    LINKS.add("/study", "Your session", lambda who: study.role(who) not in ("", OPERATOR))

    @ui.page("/enter/{key}")
    def enter(key: str) -> None:
        with framed(view, "Welcome"):
            _enter(view, study, key)

    @app.get("/thanks")
    def thanks() -> HTMLResponse:
        return HTMLResponse(THANKS)

    @ui.page("/study")
    def session() -> None:
        with framed(view, "Your session"):
            show_session(view, study, visitor())


def _enter(view: RunView, study: StudyState, key: str) -> None:
    """Ask the visitor to confirm: an address may be opened by anything that follows links."""
    me = visitor()
    name = next((one for one, kept in study.shown.get("keys", {}).items() if kept == key), None)
    if name is None:
        heading("This address is nobody's in this study")
        words("Open the address as it was given to you.")
        return
    heading("Welcome")
    words("You run this study." if name == OPERATOR else f"You take part in a study, as {name}.")

    taken = name in study.shown["roles"].values() and study.role(me) != name
    if taken and name != OPERATOR:
        words("This address was opened in another browser before. If that was not you, tell the experimenter first.")
        words("Going on here takes the session over from that browser.")

    async def go_on() -> None:
        try:
            await view.ask("study.enter", key=key, visitor=me)
        except AskFailed as error:
            ui.notify(str(error), type="negative")
            return
        ui.navigate.to("/operator" if name == OPERATOR else "/study")

    ui.button("Go on", on_click=go_on).props("autofocus")


# -- a participant's session -------------------------------------------------------------------------------------------
def show_session(view: RunView, study: StudyState, me: str) -> None:
    """Show what a participant is to do now, and follow the study.

    Args:
        view: the run.
        study: the study.
        me: identity of the visitor.
    """
    content = ui.column().classes("w-full")
    shown: list[Any] = []

    def refresh() -> None:
        now = _state(study, me)
        if shown == [now]:
            return
        shown[:] = [now]
        content.clear()
        with content:
            _show(view, study, me, now)

    ui.timer(_WATCH_S, refresh)


def _state(study: StudyState, me: str) -> tuple[Any, ...]:
    """Values that decide on the content of a participant's page."""
    name = study.role(me)
    if not study.held or not name or name == OPERATOR:
        return ("nobody", study.held, name)
    if study.participant == name and study.shown.get("owner") == me and study.phase in ("consent", "about"):
        return (study.phase, study.shown["asked"])
    if study.participant == name and study.shown.get("owner") != me:
        return ("elsewhere",)
    if study.participant == name and study.phase == "task":
        return ("task", study.shown.get("session"))
    return ("over",) if name in study.shown["session_over"] else ("waiting",)


def _show(view: RunView, study: StudyState, me: str, state: tuple[Any, ...]) -> None:
    if state[0] == "consent":
        _show_consent(view, study, me)
    elif state[0] == "about":
        _show_questions(view, study, me)
    elif state[0] == "task":
        _show_task(view, study, me)
    elif state[0] == "over":
        ui.navigate.to("/thanks")
    elif state[0] == "waiting":
        heading(f"Welcome, {study.role(me)}")
        words("Your session has not begun. This page goes on by itself when it is your turn.")
    elif state[0] == "elsewhere":
        heading("Your session is open in another browser")
        words("To go on here, open your own address again in this browser.")
    else:
        heading("Nobody's session")
        words("Open the address that the experimenter gave you." if state[1] else "No study is held at the moment.")


async def _answer(view: RunView, me: str, number: int, answer: dict[str, Any]) -> None:
    try:
        await view.ask("study.answer", number=number, visitor=me, answer=answer)
    except AskFailed as error:
        ui.notify(str(error), type="negative")


def _show_consent(view: RunView, study: StudyState, me: str) -> None:
    number = study.shown["asked"]
    heading("Do you want to take part?")
    ui.label(study.shown["consent"]).classes("memo-text max-w-3xl border-l-4 pl-3").mark("consent")
    with ui.row():
        ui.button("I agree", on_click=lambda: _answer(view, me, number, {"agrees": True}))
        ui.button("I do not take part", on_click=lambda: _answer(view, me, number, {"agrees": False})).props("flat")


def _show_questions(view: RunView, study: StudyState, me: str) -> None:
    number = study.shown["asked"]
    heading("A few questions about you")
    words("Each answer is optional.")
    fields: dict[str, ui.input] = {}
    for name in study.shown["missing"]:
        kind = "type=number inputmode=numeric min=1 max=129" if name == "age" else f"maxlength={LONGEST_WORDS}"
        fields[name] = ui.input(QUESTIONS[name]).props(kind).classes("w-96").mark(name)

    async def go_on() -> None:
        given = {name: (str(field.value) if field.value is not None else "") for name, field in fields.items()}
        await _answer(view, me, number, {name: text[:LONGEST_WORDS] for name, text in given.items()})

    ui.button("Go on", on_click=go_on)


def _show_task(view: RunView, study: StudyState, me: str) -> None:
    with ui.row().classes("items-baseline w-full justify-between"):
        title = ui.label().classes("text-xl break-words").props('role="heading" aria-level="1"').mark("task")
        left = ui.label().classes("text-xl font-mono").props('role="timer"').mark("time-left")

    def refresh() -> None:
        title.set_text(f"Task {study.shown.get('number', 1)} of this session")
        left.set_text(time_left(study))

    refresh()
    ui.timer(1.0, refresh)
    TeachingPage(view, me)


def time_left(study: StudyState) -> str:
    """The time that is left of the session, for people.

    Args:
        study: the study.

    Returns:
        Such as "12:05 left"; empty while it is not known.
    """
    seconds = study.left_s
    if seconds is None:
        return ""
    if seconds <= 0:
        return "the time is over: this attempt is the last"
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d} left"
