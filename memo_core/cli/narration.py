"""The console output of a run: retrieved entries and why, code, errors, and what was learnt."""

from __future__ import annotations

import textwrap
import threading
from collections import Counter
from collections.abc import Callable

from rich.console import Console
from rich.markup import escape
from rich.syntax import Syntax
from rich.table import Table

from memo_core.events import (
    CodeEnded,
    CodeWritten,
    EntryStored,
    EntryStruck,
    Event,
    FeedbackGiven,
    ModelCalled,
    NameCorrected,
    Problem,
    Retrieved,
    RunEnded,
    RunResumed,
    RunStarted,
    SkillCalled,
    SkillStarted,
    SubtaskEnded,
    SubtaskStarted,
    WorldPutBack,
)
from memo_core.llm.spending import prompt_words
from memo_core.skillbook.model.entries import headline
from memo_core.text import terminal

STATUS_COLOURS = {"approved": "green", "corrected": "yellow", "unobserved": "dim"}
NEAR_MISSES = 3
_REASON = 160  # characters of why an answer cannot be used


class Narrator:
    """Prints events as they happen to stderr, which leaves stdout to results. Safe from any thread."""

    def __init__(
        self, console: Console | None = None, code: bool = True, skills: bool = False, replay: bool = False
    ) -> None:
        """Prepare the narrator; nothing is printed.

        Args:
            console: where it prints; None: stderr.
            code: print what models write while they do, and generated code rather than only its length.
            skills: print every skill call.
            replay: the models' answers were recorded, so their times are past; ``tell_matches`` sums up how they fit.
        """
        self.console = console or terminal.console(stderr=True, highlight=False)
        self._code = code
        self._skills = skills
        self._replay = replay
        self._matches: Counter[str] = Counter()  # notes about answers of a replay, and how often
        self._lock = threading.Lock()
        self._writing = ""  # the phase whose answer is on the screen, unfinished
        self._shown_while_written = ""  # the last that was
        self._problem = ""  # why the last call of a model had no answer
        self._live = False  # whether a person follows the motion, and may want to know what the robot is at

    def __call__(self, event: Event) -> None:
        tell = getattr(self, f"_on_{type(event).__name__}", None)
        if tell is not None:
            with self._lock:
                self._end_of_piece()
                tell(event)

    @property
    def on_text(self) -> Callable[[str, str], None] | None:
        """Prints a model's output as it arrives (phase, piece), or with ``code=False`` that it does; None without a
        terminal."""
        return self._piece if self.console.is_terminal else None

    def _piece(self, phase: str, text: str) -> None:
        with self._lock:
            if self._writing != phase:
                self._end_of_piece()
                activity = "" if self._code else "being written …"
                self.console.print(f"  [dim]{escape(phase)}:[/] [dim]{activity}[/]", end="")
                self._writing = phase
            if self._code:
                self._shown_while_written = phase
                self.console.print(escape(text), style="dim", end="", soft_wrap=True)

    def _end_of_piece(self) -> None:
        if self._writing:
            self._writing = ""
            self.console.print()

    def heading(self, words: str) -> None:
        """A heading between several runs."""
        self.console.rule(f"[bold]{escape(words)}", align="left")

    def tell_matches(self) -> None:
        """Print how the recorded answers of a replay fit its questions, where that needs saying."""
        for match, times in self._matches.items():
            self.say(f"{times} answer{'s' * (times != 1)}: {match} (each is in the run folder's events)", "dim")

    def say(self, words: str, style: str = "") -> None:
        self.console.print(f"[{style}]{escape(words)}[/]" if style else escape(words))

    # -- events --------------------------------------------------------------------------------------------------------
    def _on_RunStarted(self, event: RunStarted) -> None:
        self.say(f'task "{event.instruction}" ({event.task}, seed {event.seed})', "bold")
        self._follow(event.live)

    def _follow(self, live: bool) -> None:
        self._live = live
        if live:
            self.say("Ctrl-C stops the robot at any moment, and it asks what was wrong; twice ends the run", "dim")

    def _on_RunResumed(self, event: RunResumed) -> None:
        where = f"{event.subtask}, attempt {event.attempt}" if event.subtask else "the plan"
        kept = f"; {event.kept_calls} answers of models need not be asked for again" if event.kept_calls else ""
        self.say(f"going on with {event.run} (part {event.part}) at {where}{kept}", "bold")
        if event.instruction:
            self.say(f'task "{event.instruction}"', "bold")
        self._follow(event.live)

    def _on_SubtaskStarted(self, event: SubtaskStarted) -> None:
        take = f", take {event.take}" if event.take > 1 else ""
        self.console.print(f"\n[bold cyan]{escape(event.subtask)}[/] [dim]attempt {event.attempt}{take}[/]")

    def _on_ModelCalled(self, event: ModelCalled) -> None:
        words = f"  {event.phase}: {event.model}, {'recorded: ' * self._replay}{event.latency_s:.2f} s"
        if event.prompt_tokens:
            asked = prompt_words(event.prompt_tokens, event.cached_tokens)
            words += f", {asked} + {event.completion_tokens} tokens"
        if event.cost:
            words += f", ${event.cost:.4f}"
        if event.problem:
            words += ", no answer" + (f": {event.problem}" if event.problem != self._problem else "")
        self._problem = event.problem
        self.say(words + (", abandoned" if event.abandoned else ""), "dim")
        if event.note and self._replay:
            self._matches[event.note] += 1
        elif event.note:
            self.say(f"  {event.note}", "dim")
        if event.unusable:
            self.say(f"  cannot be used: {textwrap.shorten(event.unusable, _REASON, placeholder=' …')}", "yellow")
        if event.not_understood:
            self.say(f"  not understood: {', '.join(event.not_understood)}", "yellow")

    def _on_WorldPutBack(self, event: WorldPutBack) -> None:
        how = "a person put the objects back" if event.by == "person" else "the world is put back"
        self.say(f"  {how}: as at the start of {event.subtask}", "dim")

    def _on_Retrieved(self, event: Retrieved) -> None:
        if not event.served:
            self.say("  nothing relevant in the skillbook", "dim")
        else:
            table = Table(box=None, padding=(0, 1), show_header=True, header_style="dim")
            for column in ("  served", "s", "r", "action", "objects", "key", "text"):
                table.add_column(column, overflow="fold", no_wrap=column not in ("key", "text"))
            for one in event.served:
                text = headline(one.kind, one.text)
                of_key = (one.key_score, one.action_cosine, one.objects_cosine)
                numbers = [f"{one.score:.2f}"] + ["" if one.key_score is None else f"{v:.2f}" for v in of_key]
                hint = ", hint" if one.hint else ""
                table.add_row(f"  {one.kind}{hint}", *numbers, escape(one.key), escape(text))
            self.console.print(table)
        for key, score, rule in event.cut[:NEAR_MISSES]:
            self.say(f"  not served: {key} (r {score:.2f}, {rule})", "dim")

    def _on_CodeWritten(self, event: CodeWritten) -> None:
        if not self._code:
            lines = len(event.code.splitlines())
            self.say(f"  code: {lines} line{'s' * (lines != 1)}, in the run folder (--verbose shows it)", "dim")
        elif self._shown_while_written != "code":
            colours = Syntax("", "python", theme="ansi_dark", background_color="default")
            # Long lines are left to the terminal: a Syntax would cut them off at its edge.
            self.console.print(colours.highlight(event.code.rstrip("\n")), soft_wrap=True)

    def _on_SkillStarted(self, event: SkillStarted) -> None:
        if self._live and not self._skills:
            self.say(f"  line {event.line}: {event.call}", "dim")

    def _on_SkillCalled(self, event: SkillCalled) -> None:
        if self._skills:
            given = ", ".join(f"{name}={_short(value)}" for name, value in event.arguments.items() if value is not None)
            self.say(
                f"    {event.sim_time:7.2f} s  {event.skill}({given})" + (f"  {event.error}" if event.error else ""),
                "dim",
            )

    def _on_CodeEnded(self, event: CodeEnded) -> None:
        for line in event.printed.splitlines()[:20]:
            self.say(f"  | {line}", "dim")
        if event.stopped:
            self.say("  stopped", "bold red")
        elif event.error:
            self.say(f"  error: {event.error}", "red")
        else:
            self.say(f"  ran to its end, {event.sim_seconds:.1f} s of the robot's time", "dim")

    def _on_FeedbackGiven(self, event: FeedbackGiven) -> None:
        self.console.print(f"  [bold magenta]{escape(event.who)}:[/] {escape(event.words)}")

    def _on_NameCorrected(self, event: NameCorrected) -> None:
        self.console.print(f'  [green]noted[/] "{escape(event.label)}" is now called "{escape(event.instead)}"')

    def _on_EntryStored(self, event: EntryStored) -> None:
        text = headline(event.kind, event.text)
        self.console.print(f"  [green]learnt[/] {event.kind} [dim]{escape(event.key)}[/] {escape(text)}")

    def _on_EntryStruck(self, event: EntryStruck) -> None:
        text = headline(event.kind, event.text)
        self.console.print(f"  [yellow]struck[/] {event.kind} [dim]{escape(event.key)}[/] {escape(text)}")

    def _on_SubtaskEnded(self, event: SubtaskEnded) -> None:
        colour = STATUS_COLOURS.get(event.status, "")
        self.console.print(f"  [{colour}]{event.status}[/] after {event.attempts} attempt{'s' * (event.attempts != 1)}")

    def _on_Problem(self, event: Problem) -> None:
        known = f"{self._problem}; " if self._problem else ""  # said of the call that failed
        self.say(f"  {event.where}: {event.message.removeprefix(known)}", "yellow")

    def _on_RunEnded(self, event: RunEnded) -> None:
        verdict = {
            True: "[bold green]success[/] by the task's own check",
            False: "[bold red]no success[/] by the task's own check",
            None: "[bold]not judged[/]",
        }[event.success]
        self.console.print(f"\n{verdict} ({event.wall_s:.1f} s). Why the run ended: {escape(event.reason)}")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
