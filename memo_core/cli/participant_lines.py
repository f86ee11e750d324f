"""Lines for a participant of a study between the questions: the task, the plan so far, what the robot is doing, and
the time left."""

from __future__ import annotations

import threading

from rich.console import Console
from rich.control import Control, ControlType
from rich.text import Text

from memo_core.events import (
    CodeEnded,
    Event,
    Problem,
    QuestionAsked,
    RunResumed,
    RunStarted,
    SessionEnded,
    SessionTask,
    SubtaskEnded,
    SubtaskStarted,
    TimeLeft,
)
from memo_core.runs.progress import RunProgress
from memo_core.text import terminal

WELCOME = """\
You teach a robot arm. It gets one task after the other, decides on a step, writes a program for it and moves. After \
each step it asks you whether that worked; when something was wrong, say so in your own words, and it tries again.
Ctrl-C stops the robot at any moment, and it asks you what was wrong. Ctrl-C twice ends for now."""
MARKS = {"approved": "✓", "corrected": "✗", "unobserved": "?"}
_REWRITE_S = 1.0  # between two pictures of the status line
_REWIND = Control((ControlType.CURSOR_MOVE_TO_COLUMN, 0), (ControlType.ERASE_IN_LINE, 2))


class ParticipantLines:
    """Prints to stderr for participants who are people; nothing for simulated ones. At a terminal the last line says
    what goes on and is rewritten; elsewhere each activity is a line. Safe from any thread."""

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or terminal.console(stderr=True, highlight=False)
        self._progress = RunProgress()
        self._lock = threading.Lock()
        self._for_people = False
        self._asking = False  # the terminal is the question's
        self._shown = ""  # on the status line; elsewhere the last activity
        self._over = threading.Event()
        if self.console.is_terminal:
            threading.Thread(target=self._rewrite, name="memo-status", daemon=True).start()

    def __call__(self, event: Event) -> None:
        with self._lock:
            self._progress(event)
            if isinstance(event, SessionTask):
                self._for_people = not event.simulated
            if not self._for_people:
                return
            say = getattr(self, f"_on_{type(event).__name__}", None)
            if say is not None:
                self._clear()
                say(event)
            self._show_activity()

    def close(self) -> None:
        """Remove the status line and print nothing more."""
        self._over.set()
        with self._lock:
            self._clear()
            self._for_people = False

    # -- the status line -----------------------------------------------------------------------------------------------
    def _rewrite(self) -> None:
        while not self._over.wait(_REWRITE_S):
            with self._lock:
                if self._for_people and self._shown:
                    self._show_activity()

    def _show_activity(self) -> None:
        activity = self._progress.activity
        if not self.console.is_terminal:
            if activity and activity != self._shown:
                self._say(f"  {activity}", "dim")
            self._shown = activity or self._shown
            return
        self._clear()
        if activity:
            self._shown = self._status(activity)
            room = max(1, self.console.width - 1)
            self.console.print(Text(self._shown[:room], style="dim"), end="", no_wrap=True, crop=True)

    def _status(self, activity: str) -> str:
        """The time first, so that a narrow terminal cuts off the program and not the clock."""
        took = round(self._progress.clock() - self._progress.since)
        seconds = f" ({took} s)" if took >= 2 else ""
        return f"  {self._left()}{activity}{seconds}"

    def _left(self) -> str:
        left = self._progress.time_left
        return "" if left is None else f"[{round(left) // 60}:{round(left) % 60:02d} left] "

    def _clear(self) -> None:
        if self._shown and self.console.is_terminal:
            self.console.control(_REWIND)
            self._shown = ""

    def _say(self, words: str, style: str = "") -> None:
        self.console.print(Text(words, style=style))

    # -- events --------------------------------------------------------------------------------------------------------
    def _on_SessionTask(self, event: SessionTask) -> None:
        if event.number == 1 and not event.resumed:
            self._say(f"\nSession {event.session} of {event.participant}, {event.session_s / 60:g} minutes", "bold")
            self._say(WELCOME)
        again = ", continued" if event.resumed else ""
        self._say(f"\nTask {event.number} of this session{again}", "bold")

    def _on_RunStarted(self, event: RunStarted) -> None:
        self._say(f'"{event.instruction}"', "bold cyan")

    def _on_RunResumed(self, event: RunResumed) -> None:
        self._say(f'"{event.instruction}"', "bold cyan")
        self._say_plan()

    def _on_SubtaskStarted(self, event: SubtaskStarted) -> None:
        self._say_plan()

    def _say_plan(self) -> None:
        progress = self._progress
        plan = [f"{subtask} {MARKS.get(status, '')}" for subtask, status in progress.done]
        if progress.subtask:
            attempt = f", attempt {progress.attempt}" if progress.attempt > 1 else ""
            plan.append(f"now {progress.subtask}{attempt}")
        self._say(f"Plan: {' → '.join(plan) or 'not made yet'}")

    def _on_CodeEnded(self, event: CodeEnded) -> None:
        if event.error and not event.stopped:
            self._say("  The program broke off.", "dim")

    def _on_QuestionAsked(self, event: QuestionAsked) -> None:
        if event.about in ("attempt", "stop", "task") and self._progress.time_left is not None:
            self._say(self._left().strip(), "dim")

    def _on_SubtaskEnded(self, event: SubtaskEnded) -> None:
        self._say(f"{MARKS.get(event.status, '')} {event.subtask}", "dim")

    def _on_TimeLeft(self, event: TimeLeft) -> None:
        if event.left_s <= 0:
            self._say("The time of this session is over.", "bold")

    def _on_SessionEnded(self, event: SessionEnded) -> None:
        self._say(f"\nThat was your session, {event.participant}. Thank you!", "bold")

    def _on_Problem(self, event: Problem) -> None:
        if not event.asked:
            self._say(f"  {event.where}: {event.message}", "yellow")
