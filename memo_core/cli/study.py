"""``memo study``: participants teach the robot in sessions, and what they taught is exported."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import Json, Overrides
from memo_core.cli.output import note, print_json, print_table
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.cli.standard_input import answer_to
from memo_core.errors import InvalidArgument, Stopped
from memo_core.teachers.answers import NO, bare
from memo_core.text.counting import counted
from memo_core.text.reading_limits import LONGEST_WORDS

if TYPE_CHECKING:
    from memo_core.interfaces.reception import Demographics

app = typer.Typer(help="Participants teach the robot in sessions.")

File = Annotated[Path, typer.Argument(metavar="FILE", help="Experiment file with a section `study`.")]
Out = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="DIR", help="Folder of the experiment; default: experiments/FILE.")
]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the experiment.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Histories at once; only with simulated participants.")]
View = Annotated[bool, typer.Option("--view", help="Open the simulator's viewer for each task (needs a display).")]
Sessions = Annotated[int | None, typer.Option("--sessions", min=1, help="How many sessions may begin in each history.")]


def experiment_folder(file: Path, out: Path | None) -> Path:
    """Where an experiment's results go."""
    return out if out is not None else Path("experiments") / file.stem


@app.command()
def run(
    file: File,
    out: Out = None,
    overrides: Overrides = None,
    jobs: Jobs = 1,
    sessions: Sessions = None,
    view: View = False,
    json: Json = False,
) -> None:
    """Hold the study's sessions, from the beginning or from where they stopped.

    Each participant goes on where the one before stopped. Killed at any moment, the same command goes on. While people
    teach, the simulated robot moves in real time (run.pace).
    """
    from memo_core.cli.options import load_registry, tell_author
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.study.study import DECIDED, open_study

    registry, folder = load_registry(), experiment_folder(file, out) / "study"
    load = open_study(registry, file, ALL_SECTIONS, overrides or (), folder)
    tell_author((*load().notices, *load().unread("a study", DECIDED)))
    _teach(load, registry, folder, jobs, sessions, view, json)


@app.command()
def resume(folder: Folder, jobs: Jobs = 1, sessions: Sessions = None, view: View = False, json: Json = False) -> None:
    """Go on with a study that was interrupted, in its folder."""
    from memo_core.cli.options import load_registry
    from memo_core.study.study import loader, shared_settings, study_sections

    config, study = config_of(folder), folder / "study"
    registry = load_registry()
    load = loader(registry, config, study_sections(), shared_settings(study))
    _teach(load, registry, study, jobs, sessions, view, json)


@app.command()
def status(folder: Folder, json: Json = False) -> None:
    """Say where a study stands: sessions, hours, what comes next."""
    shown = _status(folder)
    if json:
        print_json(shown)
        return
    for history in shown["histories"]:
        columns = ("session", "participant", "tasks", "minutes", "book's revision")
        rows = [
            (
                s["number"],
                s["participant"],
                s["runs"],
                f"{s['active_s'] / 60:.1f}",
                s["revision"] if s["ended"] else "open",
            )
            for s in history["sessions"]
        ]
        print(
            f"history {history['history']}: {history['runs']} of {counted(history['planned'], 'task')}, "
            f"{history['hours']:.2f} h ({shown['clock']} clock), {history['successes']} done, "
            f"{counted(history['corrections'], 'correction')}; "
            + (history["over"] or f"next: {history['next'] or 'another task'}")
        )
        print_table(columns, rows)


@app.command()
def export(
    folder: Folder,
    out: Annotated[Path, typer.Option("--to", metavar="DIR", help="A new folder for the exported files.")],
    demographics: Annotated[
        bool, typer.Option("--demographics", help="With ids and what participants told of themselves.")
    ] = False,
    json: Json = False,
) -> None:
    """Write a study's data for others: without ids and demographics unless they are asked for.

    review.jsonl lists the free text that looks personal: read it before anything is published.
    """
    from memo_core.cli.options import load_registry
    from memo_core.study.export import export_study
    from memo_core.study.study import loader, study_sections

    study = folder / "study"
    experiment = loader(load_registry(), config_of(folder), study_sections())()
    counts = export_study(experiment, study, out, demographics)
    if json:
        print_json({"folder": str(out)} | counts)
        return
    print(f"{out}: {counts['runs']} runs, {counts['remarks']} remarks; {counts['review']} to be read in review.jsonl")


def config_of(folder: Path) -> Path:
    """The configuration of the study in an experiment's folder. Raises ``InvalidArgument``."""
    file = folder / "study" / "config.yaml"
    if not file.exists():
        raise InvalidArgument("DIR", f"{folder} holds no study ({file} is missing)", "the --out of memo study run")
    return file


def _teach(load: Any, registry: Any, folder: Path, jobs: int, sessions: int | None, view: bool, json: bool) -> None:
    from memo_core.cli.participant_lines import ParticipantLines
    from memo_core.study.lock import working_in
    from memo_core.study.running import run_study

    lines = ParticipantLines()
    registry.listen(lines, "console")
    try:
        with working_in(folder.parent), closing(lines):
            run_study(load, registry, folder, jobs, sessions, AtTerminal(), note, stopping, view)
    except (Stopped, KeyboardInterrupt) as stopped:
        note(f"memo: {str(stopped) or 'stopped'}; to continue: memo study resume {quote(str(folder.parent))}")
        raise typer.Exit(INTERRUPTED) from None
    shown = _status(folder.parent)
    if json:
        print_json(shown)
        return
    for history in shown["histories"]:
        state = history["over"] or "not over"
        print(f"history {history['history']}: {history['hours']:.2f} h, {counted(history['runs'], 'task')}, {state}")
    note(f"memo: to export it for others: memo study export {quote(str(folder.parent))} --to PUBLIC")


def _status(folder: Path) -> dict[str, Any]:
    from memo_core.cli.options import load_registry
    from memo_core.study.study import loader, status as status_of, study_sections

    experiment = loader(load_registry(), config_of(folder), study_sections())()
    return status_of(experiment, folder / "study")


class AtTerminal:
    """Meets participants at this terminal (``memo_core.interfaces.reception.Reception``)."""

    def agrees(self, participant: str, text: str) -> bool:
        note(text)
        while True:
            typed = bare(answer_to(f"{participant}, type 'I agree' to take part:"))
            if typed in ("i agree", *NO):
                return typed == "i agree"
            note(f"{typed!r} is no consent: 'I agree' takes part, 'no' does not")

    def about(self, participant: str, known: Demographics) -> Demographics:
        import attrs

        questions = {
            "age": "Your age in years",
            "gender": "Your gender",
            "robots": "Your experience with robots",
            "language_models": "Your experience with language models",
        }
        told = {name: getattr(known, name) for name in questions}
        for name, question in questions.items():
            if told[name] is None:
                ask = _age if name == "age" else _told
                told[name] = ask(question)
        return attrs.evolve(known, **told)


def _told(question: str) -> str | None:
    return answer_to(f"{question} (Enter: no answer):")[:LONGEST_WORDS] or None


def _age(question: str) -> int | None:
    """Ask until the answer is a whole number of years or empty."""
    from memo_core.interfaces.reception import Demographics

    while (typed := bare(_told(question) or "")) and not (
        typed.isdecimal() and 0 < int(typed[:4]) < Demographics.OLDEST
    ):
        note(f"{typed!r} is no age: a whole number of years, or Enter for no answer")
    return int(typed) if typed else None
