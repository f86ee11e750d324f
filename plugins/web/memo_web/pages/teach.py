"""The page ``/teach``: the robot live, what it does and why, and what a person says about it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

from fastapi.responses import RedirectResponse
from nicegui import ui

from memo_core.plugin import LONGEST_WORDS
from memo_web.pages.layout import LINKS, framed, visitor
from memo_web.pages.limits import LIMITS
from memo_web.pages.run_view import FRESH_S, RunView
from memo_web.pages.scene3d import Scene3D
from memo_web.pages.study_state import study_of

_STATUS = {"approved": "✔ worked", "corrected": "✎ corrected, never approved", "unobserved": "– nobody said"}
_NEAR_MISSES = 5
_REMARK = "Say what is wrong at any time; this stops the robot"
_NOTES = ("correction", "general")  # kinds of entries that words became; others hold programs
_NO_RUN = "No run goes on"
_COMMAND = re.compile(r",? \(?(?:or|see) `memo [^`]*`(?:\)|,)?")  # a hint for people at a terminal


def add_pages(view: RunView) -> None:
    """Declare the page.

    Args:
        view: the run.
    """
    study = study_of(view)
    LINKS.add("/teach", "Teach", lambda who: not study.held)

    @ui.page("/")
    def start() -> RedirectResponse:
        return RedirectResponse(study.start_page(visitor()))

    @ui.page("/teach")
    def teach() -> None:
        with framed(view, "Teach"):
            if not view.may_answer(visitor()):
                ui.label("Somebody else teaches the robot now.").classes("text-h6")
                return
            TeachingPage(view, visitor())


class TeachingPage:
    """The elements of one visitor's page, and how they follow the run."""

    def __init__(self, view: RunView, who: str) -> None:
        """Build the page.

        Args:
            view: the run.
            who: identity of the visitor.
        """
        self._view, self._who = view, who
        self._shown: dict[str, Any] = {}
        self._marks: list[ui.checkbox] = []
        self._lines: list[ui.label] = []
        self._plan: ui.checkbox | None = None
        self._page = ui.element("div").classes("memo-teach w-full")
        with self._page:
            with ui.column().classes("memo-talk w-full"):  # first, so that a phone shows it above the pictures
                self._task = ui.label().classes("text-h6 memo-text").props("data-testid=task")
                self._activity = ui.label().classes("memo-text").props("role=status data-testid=activity")
                self._notice = ui.label().classes("text-bold memo-text")
                self._offers = ui.column().classes("w-full gap-1")
                self._question = ui.column().classes("w-full gap-1").props("data-testid=question aria-live=polite")
                self._field()
            with ui.column().classes("memo-seen w-full"):
                self._scene = Scene3D()
                self._cameras = ui.row().classes("w-full")
            with ui.column().classes("w-full"):
                self._done = ui.column().classes("w-full gap-0").props("data-testid=done")
                with ui.expansion("The program", icon="code").classes("w-full").props("data-testid=program"):
                    self._code = ui.element("div").classes("memo-code w-full").props("tabindex=0")
                with ui.expansion("What it remembered, and why", icon="history").classes("w-full") as box:
                    box.props("data-testid=retrieved")
                    self._retrieved = ui.column().classes("w-full")
                with ui.expansion("What was said and noted", icon="chat").classes("w-full") as box:
                    box.props("data-testid=said")
                    self._said = ui.column().classes("w-full gap-1")
        ui.timer(1 / 15, self._move)
        ui.timer(0.1, self._follow)

    # -- the field -----------------------------------------------------------------------------------------------------
    def _field(self) -> None:
        self._words = (
            ui.textarea(_REMARK)
            .classes("w-full")
            .props(
                f'outlined autogrow counter maxlength={LONGEST_WORDS} data-testid=words input-style="min-height: 4rem"'
            )
        )
        self._words.on("keydown.ctrl.enter", lambda: self._send())
        with ui.row().classes("items-center"):
            self._send_button = ui.button("Send", on_click=lambda: self._send()).props("data-testid=send")
            ui.label("or Ctrl+Enter").classes("text-caption")
            ui.space()
            self._end = ui.button("End the run", on_click=self._ask_to_end).props("flat dense")

    def _send(self, choice: str = "") -> None:
        """Send the field's words, with a button's ``choice`` if one was pressed."""
        if not self._view.may_answer(self._who):
            return
        words = (self._words.value or "").strip()
        question = self._view.question
        if question is None and self._view.stage is None:
            ui.notify(f"{_NO_RUN}.")
            return
        if not choice and not words:
            ui.notify("Write what was wrong first.")
            return
        if problem := LIMITS.problem(self._who, words):
            ui.notify(problem, type="warning")
            return
        if question is None:
            if choice:
                return
            self._view.tell("remark", words=words, visitor=self._who)
        else:
            struck = [number for number, mark in enumerate(self._marks) if mark.value]
            if choice == "strike" and not struck:
                ui.notify("Mark the notes to be struck first.")
                return
            about_plan = self._plan is not None and bool(self._plan.value)
            self._view.tell(
                "answer",
                id=question["id"],
                choice=choice,
                words=words,
                struck=struck,
                about_plan=about_plan,
                visitor=self._who,
            )
        self._words.value = ""

    def _ask_to_end(self) -> None:
        def end() -> None:
            self._view.tell("end")
            dialog.close()

        with ui.dialog(value=True) as dialog, ui.card():
            ui.label("Stop the robot and end this run? Everything is kept, and it can be resumed.")
            with ui.row():
                ui.button("End it", on_click=end)
                ui.button("Go on", on_click=dialog.close).props("flat")

    # -- following the run ---------------------------------------------------------------------------------------------
    def _changed(self, name: str, value: Any) -> bool:
        if name in self._shown and self._shown[name] == value:
            return False
        self._shown[name] = value
        return True

    def _move(self) -> None:
        view = self._view
        if not view.may_answer(self._who):
            return
        if self._changed("stage", view.stage_number):
            self._page.classes(**{"remove" if view.stage is None else "add": "memo-beside"})
            if view.stage is not None:  # a canvas that was hidden has no size yet
                ui.run_javascript("setTimeout(() => window.dispatchEvent(new Event('resize')), 100)")
            self._scene.build(view.stage)
            self._build_cameras()
        if self._changed("poses", (view.stage_number, view.poses_number)):
            self._scene.show(view.poses)
        self._show_pictures()

    def _follow(self) -> None:
        view = self._view
        if not view.may_answer(self._who):  # the session became another visitor's
            ui.navigate.reload()
            return
        self._show_activity()
        if not self._changed("version", view.version):
            return
        self._show_task()
        if self._changed("question", (view.question or {}).get("id", 0)):
            self._show_question()
        if self._changed("field", ((view.question or {}).get("words"), view.question or view.stage)):
            self._show_field()
        if self._changed("done", view.progress.get("done")):
            self._show_done()
        if self._changed("code", (view.code, view.writing)):
            self._show_code()
        if self._changed("retrieved", view.retrieved):
            self._show_retrieved()
        if self._changed("said", len(view.events) and view.events[-1]):
            self._show_said()

    def _show_task(self) -> None:
        view = self._view
        said = view.progress.get("instruction", "")
        self._task.text = f"Task: {said}" if said else "No task yet"
        self._notice.text = view.notice or (f"No pictures: {view.no_pictures}" if view.no_pictures else "")
        self._end.set_visibility(view.stage is not None)
        if self._changed("offers", (view.offers, view.stage is None)):
            self._show_offers()

    def _show_activity(self) -> None:
        view = self._view
        progress, words = view.progress, ""
        if view.lost:
            words = "The run's process has ended."
        elif view.stage is None:
            words = _ending(view)
        elif view.question is not None:
            words = "The robot waits for your answer."
        elif progress:
            attempt = f", attempt {progress['attempt']}" if progress["subtask"] else ""
            now = progress["activity"] or "…"
            words = f"{progress['subtask']}{attempt}: {now}" if progress["subtask"] else now
        self._activity.text = words
        if self._changed("line", view.line):
            for number, label in enumerate(self._lines, 1):
                label.classes(add="now") if number == view.line else label.classes(remove="now")

    # -- questions -----------------------------------------------------------------------------------------------------
    def _show_question(self) -> None:
        question = self._view.question
        self._question.clear()
        self._marks, self._plan = [], None
        self._question.props["data-asked"] = question["id"] if question else 0
        if question is None:
            return
        with self._question:
            ui.label(question["title"]).classes("text-h6 memo-text").props("data-testid=asked")
            for line in question["lines"]:
                ui.label(line).classes("memo-text")
            if question.get("code"):
                ui.label(question["code"]).classes("memo-code w-full").props("tabindex=0")
            for number, note in enumerate(question.get("notes", ()), 1):
                with ui.row().classes("items-start no-wrap w-full"):
                    self._marks.append(ui.checkbox().props(f'dense aria-label="Mark note {number}"'))
                    ui.label(f"{note['key']}: {note['text']}").classes("memo-text")
            if question.get("plan_choice"):
                self._plan = ui.checkbox("My words are about what is done next, not about how").props("dense")
            with ui.row():
                for key, label in question["choices"]:
                    button = ui.button(label, on_click=_sender(self._send, key)).props("outline")
                    button.props["data-choice"] = key

    def _show_field(self) -> None:
        """Say what the field is for, and switch it off while nothing could be done with words."""
        question, stage = self._view.question, self._view.stage
        on = question is not None or stage is not None
        self._words.props["label"] = (question or {}).get("words") or (_REMARK if on else _NO_RUN)
        self._words.set_enabled(on)
        self._send_button.set_enabled(on)

    def _show_offers(self) -> None:
        """Show the tasks that can be begun, while no run goes on."""
        offers = self._view.offers
        self._offers.clear()
        if not offers or self._view.stage is not None:
            return
        with self._offers:
            if offers.get("why_not"):
                ui.label(offers["why_not"]).classes("memo-text")
                return
            ui.label("Begin a task").classes("text-h6")
            names = {one["name"]: f"{one['name']}: {one['instruction']}" for one in offers["tasks"]}
            task = ui.select(names, value=offers["task"], label="Task", with_input=True).classes("w-full")
            seed = ui.number("Seed of the scene", value=offers["seed"], min=0, precision=0)

            def begin() -> None:
                if problem := LIMITS.problem(self._who):
                    ui.notify(problem, type="warning")
                elif task.value in names and seed.value is not None:
                    self._view.tell("begin", task=task.value, seed=int(seed.value), visitor=self._who)

            ui.button("Begin", on_click=begin).props("data-testid=begin")

    # -- what was done, and why ----------------------------------------------------------------------------------------
    def _show_done(self) -> None:
        self._done.clear()
        with self._done:
            done = self._view.progress.get("done") or []
            if done:
                ui.label("So far").classes("text-subtitle2")
            for number, (subtask, status) in enumerate(done, 1):
                ui.label(f"{number}. {subtask}   {_STATUS.get(status, status)}").classes("memo-text")

    def _show_code(self) -> None:
        view = self._view
        self._code.clear()
        self._lines = []
        with self._code:
            if view.writing:
                ui.label("being written …").classes("text-caption")
            for line in (view.writing or view.code).splitlines():
                self._lines.append(ui.label(line or " ").style("white-space: pre; min-height: 1.2em"))

    def _show_retrieved(self) -> None:
        self._retrieved.clear()
        found = self._view.retrieved
        if found is None:
            return
        with self._retrieved:
            ui.label(f"For {found['subtask']}:").classes("text-subtitle2 memo-text")
            if not found["served"]:
                ui.label("Nothing in its skillbook is about this.")
            for one in found["served"]:
                hint = ", a hint" if one.get("hint") else ""
                with ui.column().classes("gap-0 w-full"):
                    ui.label(f"{one['kind']}, {one['key']}{hint}").classes("text-bold memo-text")
                    ui.label(one["text"]).classes("memo-text")
                    ui.label(_why(one)).classes("text-caption")
            for key, score, rule in found["cut"][:_NEAR_MISSES]:
                ui.label(f"not used: {key} (likeness {score:.2f}, {rule})").classes("text-caption memo-text")

    def _show_said(self) -> None:
        self._said.clear()
        struck = {event["data"]["entry"] for event in self._view.events if event["event"] == "EntryStruck"}
        with self._said:
            for event in self._view.events:
                data = event["data"]
                if event["event"] == "FeedbackGiven":
                    ui.label(f"{data['who']}, about {data['subtask']}: {data['words']}").classes("memo-text")
                elif event["event"] == "Reworded":
                    ui.label(f"{data['who']}, in other words: {data['words']}").classes("memo-text")
                elif event["event"] == "EntryStored" and data["kind"] not in _NOTES:
                    ui.label(f"kept ({data['key']}): the program that worked").classes("memo-text q-pl-md")
                elif event["event"] == "EntryStored":
                    gone = data["entry"] in struck
                    note = ui.label(f"{'struck' if gone else 'noted'} ({_place(data)}): {data['text']}")
                    note.classes("memo-text q-pl-md" + " text-strike" * gone)
                elif event["event"] == "Problem" and not data["asked"]:
                    ui.label(_problem(data)).classes("memo-text text-negative")

    # -- pictures ------------------------------------------------------------------------------------------------------
    def _build_cameras(self) -> None:
        self._cameras.clear()
        self._images: dict[str, tuple[ui.image, ui.label]] = {}

    def _show_pictures(self) -> None:
        view = self._view
        for camera, picture in view.pictures.items():
            if camera not in self._images:
                with self._cameras, ui.column().classes("gap-0"):
                    image = ui.image().props("no-spinner no-transition fit=contain").classes("memo-live w-72 h-54")
                    self._images[camera] = image, ui.label().classes("text-caption")
                caption = self._images[camera][1]
                caption.set_visibility(False)  # until there is something above it
                image.on("load.once", _shower(caption))
            image, label = self._images[camera]
            if self._changed(f"picture {camera}", (view.stage_number, picture.number)):
                image.set_source(f"/picture/{quote(camera, safe='')}?n={view.stage_number}.{picture.number}")
                label.text = f"{camera} {picture.note}".strip()
            old = not picture.note and view.behind(picture) > FRESH_S
            if self._changed(f"old {camera}", old):
                image.classes(add="memo-old") if old else image.classes(remove="memo-old")


def _why(one: dict[str, Any]) -> str:
    score = f"score {one['score']:.2f}"
    if one["key_score"] is None:  # a general statement: it has no key
        return score
    parts = f"of the action {one['action_cosine']:.2f}, of the objects {one['objects_cosine']:.2f}"
    return f"{score}; likeness {one['key_score']:.2f}: {parts}"


def _ending(view: RunView) -> str:
    last = view.events[-1] if view.events else None
    if last is None or last["event"] != "RunEnded":
        return "No run goes on." if not view.progress.get("activity") else f"{view.progress['activity']} …"
    if view.for_study:  # a participant is not to learn what the task's hidden check says
        return "This task is over."
    data = last["data"]
    if data["success"]:
        return "The task is done."
    how = "The run is over" if data["success"] is None else "The task is not done"
    return f"{how}. Why the run ended: {data['reason']}."


def _place(note: dict[str, Any]) -> str:
    """The key of a note in the words of the form in which it is accepted."""
    return "everywhere" if note["key"] == "*" else str(note["key"])


def _problem(problem: dict[str, Any]) -> str:
    """A problem without ids of the skillbook and commands of the terminal."""
    message = _COMMAND.sub("", problem["message"])
    if re.match(r"feedback \d+ ", problem["where"]):
        return f"not noted: {message}"
    return f"{_COMMAND.sub('', problem['where'])}: {message}"


def _shower(element: ui.label) -> Callable[[], object]:
    return lambda: element.set_visibility(True)


def _sender(send: Callable[[str], None], key: str) -> Callable[[], None]:
    return lambda: send(key)
