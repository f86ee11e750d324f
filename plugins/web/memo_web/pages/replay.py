"""The page ``/replay``: an attempt of the run, looked at again in 3-D, with the line of code that ran."""

from __future__ import annotations

import bisect
import time
from typing import Any

from nicegui import ui

from memo_web.pages.layout import LINKS, framed, visitor
from memo_web.pages.run_view import Recording, RunView
from memo_web.pages.scene3d import Scene3D

_SPEEDS = {0.1: "0.1×", 0.25: "0.25×", 0.5: "0.5×", 1.0: "1×", 2.0: "2×", 4.0: "4×", 8.0: "8×"}


def add_pages(view: RunView) -> None:
    """Declare the page.

    Args:
        view: the run.
    """
    LINKS.add("/replay", "Look again", view.may_answer)

    @ui.page("/replay")
    def replay() -> None:
        with framed(view, "Look again"):
            if not view.may_answer(visitor()):
                ui.label("Somebody else teaches the robot now.").classes("text-h6")
                return
            ReplayPage(view, visitor())


class ReplayPage:
    """The elements of one visitor's page."""

    def __init__(self, view: RunView, who: str) -> None:
        """Build the page.

        Args:
            view: the run.
            who: identity of the visitor.
        """
        self._view, self._who = view, who
        self._stage: dict[str, Any] | None = None
        self._recording: Recording | None = None
        self._attempts: list[Recording] = []
        self._lines: list[ui.label] = []
        self._line = 0
        self._playing = False
        self._last = 0.0
        with ui.element("div").classes("grid w-full gap-4 grid-cols-1 lg:grid-cols-2"):
            with ui.column().classes("w-full min-w-0"):
                self._choice = ui.select({}, label="Attempt", on_change=self._chosen).classes("w-full")
                self._choice.props("data-testid=attempts")
                self._scene = Scene3D()
                with ui.row().classes("w-full items-center no-wrap"):
                    self._play = ui.button("Play", on_click=self._toggle).props("data-testid=play")
                    self._speed = ui.select(_SPEEDS, value=1.0, label="Speed").classes("w-24 shrink-0")
                    self._at = ui.slider(min=0.0, max=1.0, step=0.01, value=0.0, on_change=self._scrubbed)
                    self._at.props('aria-label="Moment, in seconds" data-testid=moment').classes("flex-grow")
                    self._clock = ui.label().classes("w-32 shrink-0").props("data-testid=clock")
            with ui.column().classes("w-full min-w-0"):
                ui.label("The program").classes("text-h6")
                self._code = (
                    ui.element("div")
                    .classes("memo-code memo-code-tall w-full")
                    .props("tabindex=0 data-testid=replay-code")
                )
        ui.timer(1 / 15, self._tick)

    def _tick(self) -> None:
        view = self._view
        if not view.may_answer(self._who):  # the session became another visitor's
            ui.navigate.reload()
            return
        if view.drawn is not self._stage:
            self._stage = view.drawn
            self._scene.build(view.drawn)
            self._show()
        attempts = [one for one in view.attempts if one.times]  # one that has just begun shows nothing yet
        if attempts != self._attempts:
            self._list(attempts)
        if self._playing and self._recording is not None and self._recording.times:
            now = time.monotonic()
            at = self._at.value + (now - self._last) * self._speed.value
            self._last = now
            end = self._recording.times[-1] - self._recording.times[0]
            if at >= end:
                self._toggle()
            self._at.value = min(at, end)
        self._stretch()

    def _list(self, attempts: list[Recording]) -> None:
        self._attempts = attempts
        chosen = self._attempts.index(self._recording) if self._recording in self._attempts else len(self._attempts) - 1
        self._choice.set_options({n: one.title for n, one in enumerate(self._attempts)}, value=max(0, chosen))

    def _chosen(self, event: Any) -> None:
        if event.value is None or not event.value < len(self._attempts):
            return
        self._recording = self._attempts[event.value]
        self._playing = False
        self._play.text = "Play"
        self._show_code()
        self._stretch()
        self._at.value = 0.0
        self._show()

    def _stretch(self) -> None:
        """Let the slider reach to the recording's present end."""
        recording = self._recording
        if recording is None or not recording.times:
            return
        end = round(recording.times[-1] - recording.times[0], 2)
        if self._at.props.get("max") != max(end, 0.01):
            self._at.props["max"] = max(end, 0.01)
            self._at.update()
            self._show()
        if (recording.code or "") != getattr(self, "_code_shown", None):
            self._show_code()

    def _show_code(self) -> None:
        self._code.clear()
        self._lines, self._line = [], 0
        self._code_shown = self._recording.code if self._recording is not None else ""
        with self._code:
            for line in self._code_shown.splitlines():
                self._lines.append(ui.label(line or " ").style("min-height: 1.2em"))

    def _toggle(self) -> None:
        self._playing = not self._playing
        self._play.text = "Pause" if self._playing else "Play"
        self._last = time.monotonic()
        if self._playing and self._at.value >= self._at.props["max"] - 0.02:
            self._at.value = 0.0

    def _scrubbed(self) -> None:
        self._show()

    def _show(self) -> None:
        recording = self._recording
        if recording is None or not recording.times:
            return
        at = recording.times[0] + float(self._at.value)
        number = min(bisect.bisect_right(recording.times, at + 1e-6), len(recording.times)) - 1
        self._scene.show(recording.poses[max(number, 0)])
        line = recording.lines[max(number, 0)]
        self._clock.text = f"{self._at.value:.2f} s" + (f", line {line}" if line else "")
        if line != self._line:
            for which, add in ((self._line, False), (line, True)):
                if 0 < which <= len(self._lines):
                    label = self._lines[which - 1]
                    label.classes(add="now") if add else label.classes(remove="now")
                    if add:
                        label.run_method("scrollIntoView", {"block": "nearest"})
            self._line = line
