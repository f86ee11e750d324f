"""The page ``/operator`` of the person who runs a study: who is there, notes coming in, pausing, and the export."""

from __future__ import annotations

import functools
import io
import tempfile
import time
import zipfile
from html import escape
from pathlib import Path
from shlex import quote
from typing import Any

import attrs
from fastapi import Request, Response
from fastapi.responses import HTMLResponse
from nicegui import app, run, ui

from memo_core.plugin import MemoError
from memo_core.skillbook import Entry, Feedback, Skillbook, explain
from memo_core.study import export_study, load_study, status
from memo_web.pages.layout import LINKS, framed, visitor
from memo_web.pages.participant import time_left
from memo_web.pages.run_view import AskFailed, RunView
from memo_web.pages.study_state import OPERATOR, StudyState, study_of
from memo_web.pages.text import count, heading, section, words
from memo_web.pages.why_pages import entry_line

_WATCH_S = 0.5
_READ_S = 3.0  # between two looks into journals and books
_NEWEST = 30  # notes that are shown
PHASES = {
    "waiting": "not begun",
    "consent": "reading the consent text",
    "about": "answering the questions",
    "task": "teaching",
    "over": "between sessions",
    "ended": "the command has ended",
}
ENDED = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>The study · MEMO</title></head>
<body style="font-family: sans-serif; margin: 3rem"><h1>The command has ended, and its pages with it</h1>
<p>What was taught, for others, without ids:<br><code>memo study export {folder} --to PUBLIC</code></p>
<p>If sessions are still to come:<br><code>memo study resume {folder}</code></p></body></html>
"""  # without a connection that could be lost
_experiment = functools.lru_cache(maxsize=1)(load_study)


@attrs.frozen(eq=False)
class Standing:
    """State of a study by its journals and books.

    Attributes:
        histories: as ``memo study status --json`` prints them.
        notes: the newest entries, newest first, each with the feedback that it was made of.
        waiting: feedback of which nothing was made yet.
    """

    histories: list[dict[str, Any]]
    notes: list[tuple[Entry, tuple[Feedback, ...]]]
    waiting: list[Feedback]


def add_pages(view: RunView) -> None:
    """Add the operator's page.

    Args:
        view: the run.
    """
    study = study_of(view)
    LINKS.add("/operator", "Study", lambda who: study.role(who) == OPERATOR)

    @ui.page("/operator")
    def operator() -> None:
        with framed(view, "Study"):
            if study.role(visitor()) != OPERATOR:
                heading("This page is for the person who runs the study")
                words("Open the address that the command printed when it began.")
                return
            _show(view, study, visitor())

    @app.get("/ended")
    def ended(request: Request) -> Response:
        if study.role(request.state.visitor) != OPERATOR:
            return Response(status_code=404)
        return HTMLResponse(ENDED.format(folder=escape(_folder(study))))


def _show(view: RunView, study: StudyState, me: str) -> None:
    heading("The study")
    now = ui.label().classes("text-lg break-words").mark("now")
    _show_buttons(view, study, me)
    section("Participants")
    people = ui.column().classes("gap-1 w-full")
    section("Notes coming in")
    notes = ui.column().classes("gap-2 w-full").mark("notes")
    section("Sessions so far")
    sessions = ui.column().classes("gap-0 w-full")
    shown: dict[str, Any] = {}

    def refresh() -> None:
        if study.phase == "ended":
            ui.navigate.to("/ended")
            return
        now.set_text(_now(view, study))
        who = (study.participant, study.phase, tuple(study.shown["session_over"]), len(study.shown["roles"]))
        if shown.get("people") != who:
            shown["people"] = who
            people.clear()
            with people:
                _show_people(study)

    async def read() -> None:
        try:
            standing = await run.io_bound(standing_of, Path(study.shown["folder"]))
        except MemoError as error:
            now.set_text(f"This cannot be read: {error}")
            return
        if standing is None:  # the server ends
            return
        state = [[entry.id for entry, _ in standing.notes], [one.id for one in standing.waiting], standing.histories]
        if shown.get("standing") == state:
            return
        shown["standing"] = state
        notes.clear()
        with notes:
            _show_notes(standing)
        sessions.clear()
        with sessions:
            _show_sessions(standing)

    refresh()
    ui.timer(_WATCH_S, refresh)
    ui.timer(_READ_S, read)


def _folder(study: StudyState) -> str:
    """Folder of the experiment, as a command of the terminal takes it."""
    return quote(str(Path(study.shown["folder"]).parent))


def _now(view: RunView, study: StudyState) -> str:
    if view.lost:
        return "The study's process has ended; `memo study resume` goes on with it."
    if not study.participant:
        return "No session has begun."
    parts = [study.participant, PHASES[study.phase]]
    if study.phase == "task":
        parts += [f"task {study.shown['number']} of session {study.shown['session']}", time_left(study)]
        parts += [view.progress.get("instruction", ""), view.progress.get("activity", "")]
    return " · ".join(part for part in parts if part)


def _show_people(study: StudyState) -> None:
    words("Give each participant their own address. Whoever opens it is that participant from then on.")
    present = set(study.shown["roles"].values())
    token = f"?token={study.shown['token']}" if study.shown["token"] else ""
    for name, key in study.shown["keys"].items():
        if name == OPERATOR:
            continue
        state = "has opened it" if name in present else "has not opened it yet"
        if name in study.shown["session_over"]:
            state = "session over"
        elif name == study.participant and study.phase != "over":
            state = PHASES[study.phase]
        address = f"{study.shown['url']}enter/{key}{token}"
        with ui.row().classes("items-baseline gap-x-3 gap-y-0"):
            ui.label(name).classes("font-medium")
            ui.label(state)
            ui.link(address, address).classes("break-all").props(f'data-participant="{name}"')


def _show_notes(standing: Standing) -> None:
    if not standing.notes and not standing.waiting:
        words("Nothing yet.")
    for said in standing.waiting:
        with ui.row().classes("items-baseline gap-3"):
            ui.label(said.who).classes("font-medium")
            ui.label(said.words or "(said that it worked)").classes("memo-text")
            why = f"set aside: {said.reason}" if said.status == "parked" else "no note was made yet"
            ui.label(why).classes("italic text-gray-700")
    for entry, feedback in standing.notes:
        with ui.column().classes("gap-0 border-l-4 pl-3"):
            entry_line(entry)
            for one in feedback:
                ui.label(f"{one.who}: {one.words or '(said that it worked)'}").classes("memo-text text-gray-700")


def _show_sessions(standing: Standing) -> None:
    for history in standing.histories:
        words(
            f"{history['runs']} of {count(history['planned'], 'task')}, {60 * history['hours']:.0f} minutes, "
            f"{count(history['corrections'], 'correction')}. {history['over']}"
        )
        for one in history["sessions"]:
            state = "over" if one["ended"] else "open"
            words(
                f"Session {one['number']}, {one['participant']}: {count(one['runs'], 'task')}, "
                f"{one['active_s'] / 60:.1f} minutes, {state}"
            )


# -- pausing and exporting ---------------------------------------------------------------------------------------------
def _show_buttons(view: RunView, study: StudyState, me: str) -> None:
    with ui.row().classes("items-center"):
        ui.button("Pause the study …", on_click=lambda: _confirm_pause(view, me), color="negative")
        everything = ui.checkbox("with ids, and what people told of themselves")
        ui.button("Export", on_click=lambda: _export(study, bool(everything.value)))
    words(
        "STOP, above, stops the robot, and the participant is asked what was wrong. Pausing ends the command: the run "
        "is kept as it is, and `memo study resume` goes on with it. The last session ends the command and this page; "
        f"`memo study export {_folder(study)} --to PUBLIC` exports then. Read review.jsonl before others get an export."
    )


def _confirm_pause(view: RunView, me: str) -> None:
    async def pause() -> None:
        dialog.close()
        try:
            await view.ask("study.pause", visitor=me)
        except AskFailed as error:
            ui.notify(str(error), type="negative")

    with ui.dialog() as dialog, ui.card():
        ui.label("Pause the study now? The robot stops, and the participant's page waits.")
        with ui.row():
            ui.button("Pause now", on_click=pause, color="negative")
            ui.button("Go on", on_click=dialog.close).props("flat")
    dialog.open()


async def _export(study: StudyState, demographics: bool) -> None:
    try:
        data = await run.io_bound(exported, Path(study.shown["folder"]), demographics)
    except MemoError as error:
        ui.notify(str(error), type="negative")
        return
    if data is not None:
        ui.download.content(data, f"study-{time.strftime('%Y%m%d-%H%M')}.zip")


def exported(folder: Path, demographics: bool) -> bytes:
    """Export a study.

    Args:
        folder: the study's folder.
        demographics: whether ids and what participants told of themselves are exported too.

    Returns:
        A ZIP archive of the files that ``memo study export`` writes.

    Raises:
        MemoError: if the study cannot be read.
    """
    packed = io.BytesIO()
    with tempfile.TemporaryDirectory(prefix="memo-export-") as out:
        export_study(_experiment(folder), folder, Path(out), demographics)
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(Path(out).iterdir()):
                archive.write(file, file.name)
    return packed.getvalue()


def standing_of(folder: Path) -> Standing:
    """Read how a study stands, from its journals and books.

    Args:
        folder: the study's folder.

    Returns:
        Sessions, the newest notes, and feedback of which nothing was made yet.

    Raises:
        MemoError: if a file is damaged.
    """
    notes: list[tuple[Entry, tuple[Feedback, ...]]] = []
    waiting: list[Feedback] = []
    for file in sorted(folder.glob("history-*/skillbook.db")):
        with Skillbook(str(file), read_only=True) as book:
            newest = book.entries()[-_NEWEST:]
            notes += [(entry, explain(book, entry.id).said) for entry in newest]
            waiting += [one for one in book.pending_feedback(parked=True) if one.words]
    notes.sort(key=lambda note: note[0].created, reverse=True)
    return Standing(status(_experiment(folder), folder)["histories"], notes[:_NEWEST], waiting)
