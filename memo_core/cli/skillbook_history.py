"""``memo skillbook history|diff|rollback|why|retry``: the revisions of a book, undoing them, and explaining what is
retrieved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.options import MOST_NUMBER, Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import local_time, note, note_unknown, print_json, print_table
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import Stopped

if TYPE_CHECKING:
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.history import Revision, Version
    from memo_core.skillbook.model.entries import Entry
    from memo_core.skillbook.retrieval.retriever import Retrieval


def register(app: typer.Typer) -> None:
    """Add the commands to the group ``memo skillbook``."""
    for command in (history, diff, rollback, why, retry):
        app.command()(command)


def history(
    key: Annotated[
        str | None, typer.Argument(metavar="[KEY]", help="Only this key, e.g. 'OPEN(oven)'; * for general statements.")
    ] = None,
    last: Annotated[
        int | None, typer.Option("--last", min=1, max=MOST_NUMBER, help="Only this many of the latest revisions.")
    ] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """List the changes, revision by revision; for a key also its entries and the versions of its template."""
    from memo_core.skillbook import history as book_history

    with _opened(book, config, overrides, read_only=True) as opened:
        revisions = book_history.revisions(opened, key, last)
        versions = book_history.versions(opened, key) if key is not None else []
        if not revisions:
            note_unknown("key", key, {_key(one) for one in book_history.revisions(opened)})
        if json:
            print_json(
                {"revisions": [_revision(one) for one in revisions], "templates": [_version(v) for v in versions]}
            )
            return
        rows = [
            (one.id, _when(one.time), _key(one), one.reason, *(one.count(c) or "" for c in ("added", "superseded")))
            + (one.count("restored") or "",)
            for one in revisions
        ]
        print_table(("revision", "when", "key", "reason", "added", "gone", "back"), rows)
        if key is None:
            return
        print()
        for one in revisions:
            for change in one.changes:
                sign = {"added": "+", "superseded": "-", "restored": "+", "joined": "="}[change.change]
                said = f" [{change.why}]" if change.why and change.change != "joined" else ""
                said = f" [was under {change.why}]" if change.change == "joined" else said
                print(f"{one.id:>5} {sign} {change.entry.id}: {_line(change.entry)}{said}")
        if versions:
            print()
            record = [(v.entry.id, v.state, f"{v.confirmed_uses}/{v.uses}", _line(v.entry)) for v in versions]
            print_table(("template", "", "approved/served here", ""), record)


def diff(
    revision: Annotated[int, typer.Argument(metavar="REV", max=MOST_NUMBER, help="What this revision changed.")],
    other: Annotated[
        int | None,
        typer.Argument(metavar="[REV]", max=MOST_NUMBER, help="From the book after REV to the book after this one."),
    ] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Show which entries a revision removed and added, or the difference between two states of the book."""
    from memo_core.skillbook import history as book_history

    with _opened(book, config, overrides, read_only=True) as opened:
        found = book_history.difference(opened, revision, other)
        if json:
            print_json(
                {"removed": [_entry(one) for one in found.removed], "added": [_entry(one) for one in found.added]}
            )
            return
        for sign, entries in (("-", found.removed), ("+", found.added)):
            for one in entries:
                print(f"{sign} {one.id} [{_label(one)}] {one.text.rstrip()}")
        if not found.removed and not found.added:
            note("no difference")


def rollback(
    revision: Annotated[
        int, typer.Argument(metavar="REV", max=MOST_NUMBER, help="The revision to take back (memo skillbook history).")
    ],
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Undo one revision: the entries it added are removed, those it removed are restored. Can be rolled back itself."""
    from memo_core.skillbook import history as book_history

    with _opened(book, config, overrides, read_only=True):
        pass  # a mistyped path is an error, not a new empty book
    with _opened(book, config, overrides, read_only=False) as opened:
        made = book_history.roll_back(opened, revision)
    if json:
        print_json(_revision(made))
        return
    gone, back = made.count("superseded"), made.count("restored")
    print(f"revision {made.id} is the rollback of {revision}: {gone} entries gone, {back} there again")


def why(
    subtask: Annotated[str, typer.Argument(metavar="SUBTASK", help="E.g. 'OPEN(oven)'.")],
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Explain what is retrieved for a subtask: each term of each score, the order, and what was cut by which rule."""
    from memo_core.runs.factories import book_of

    with book_of(load(config, overrides)[1], book, read_only=True) as opened:
        found = opened.retrieve(subtask)
        settings = opened.settings
        retired = {
            key: [e for e in opened.entries(key=key, superseded=True) if e.superseded_by is not None]
            for key in dict.fromkeys(s.entry.key for s in found.served if s.entry.key.objects)
        }
        first, second = settings.weights
        if json:
            weights = {"lambda_action": first, "lambda_objects": second, "threshold": settings.cut}
            print_json({"subtask": str(found.query), **weights, **_retrieval(found), "superseded": _count(retired)})
            return
        print(
            f"{found.query}: r = ({first:g} action + {second:g} objects) / {first + second:g}, cut at {settings.cut:g}"
        )
        if settings.ranking == "key-and-text":
            print(
                f"s also counts the text ({settings.text_weight:g}), terms in common ({settings.overlap_weight:g}) "
                f"and, where a scene is seen, how alike the things are built ({settings.built_weight:g}); "
                "text and terms count less where the objects' roles are exchanged"
            )
        print("of equal s: likeness of the text to the subtask, then approved uses, then the newest")
        columns = ("rank", "s", "r", "action", "objects", "text", "terms", "approved", "when", "id", "key", "entry")
        calls = tuple(call for function in found.functions for call in function.calls)
        for name, served in (
            ("corrections", found.corrections),
            ("templates", found.templates),
            ("calls of functions", calls),
        ):
            print(f"\n{name}: {len(served)}")
            if served:
                print_table(columns, [_served_row(s) for s in served])
        print(f"\ngeneral statements, by likeness of the text: {len(found.general)}")
        if found.general:
            rows = [_served_row(s) for s in found.general]
            print_table((*columns[:2], *columns[7:]), [r[:2] + r[7:] for r in rows])
        print(f"\nnot served: {len(found.cut)} keys that are near")
        if found.cut:
            near = [
                (f"{c.score:.3f}", f"{c.action_cosine:.3f}", f"{c.objects_cosine:.3f}", c.key, c.entries, c.rule)
                for c in found.cut
            ]
            print_table(("r", "action", "objects", "key", "entries", "rule"), near)
        for key, entries in retired.items():
            if entries:
                print(f"{key}: {len(entries)} entries are superseded (memo skillbook history '{key}')")


def retry(
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Ask the model again about feedback that was set aside or is still pending. Exit code 1 when the model could not
    be asked.
    """
    from memo_core.policy.feedback_processing import (
        FeedbackProcessor,
        ProcessedFeedback,
        asking_without_a_run,
        retry as ask_again,
    )
    from memo_core.runs.consolidation import calls_without_a_run
    from memo_core.runs.factories import book_of, prompts_of

    _, experiment = load(config, overrides)
    with book_of(experiment, book, read_only=True):
        pass  # a mistyped path is an error, not a new empty book
    results: list[ProcessedFeedback] = []
    stopped = False

    def done(noted: ProcessedFeedback) -> None:
        results.append(noted)
        if not json:
            said = "; ".join(entry.text for entry in noted.entries) or noted.reason
            print(f"feedback {noted.feedback}: {noted.outcome}: {said}")

    def ignore(event: Any) -> None:
        """What became of each is said when it is done."""

    llm = experiment.create("llm")
    with (
        stopping() as stop,
        book_of(experiment, book, read_only=False) as opened,
        calls_without_a_run(experiment, llm, ignore, stop, "retry") as calls,
    ):
        robot, reasks = experiment.create("robot"), experiment.section("run").reasks
        ask = asking_without_a_run(calls, prompts_of(experiment), robot, reasks, experiment.seed)
        try:
            ask_again(FeedbackProcessor(ask, opened, ignore), opened, done)
        except Stopped:
            stopped = True
    if json:
        print_json({"feedback": [_noted(one) for one in results]})
    elif not results and not stopped:
        note("nothing is set aside or pending")
    if stopped:
        note("memo: stopped; the next memo skillbook retry goes on with the rest")
        raise typer.Exit(INTERRUPTED)
    if any(one.outcome == "pending" for one in results):
        raise typer.Exit(1)


def _noted(noted: Any) -> dict[str, Any]:
    entries = [_entry(entry) for entry in noted.entries]
    return {"feedback": noted.feedback, "outcome": noted.outcome, "reason": noted.reason or None, "entries": entries}


def _opened(book: str | None, config: Path | None, overrides: list[str] | None, read_only: bool) -> Skillbook:
    """Without embedder and store: none of this needs them."""
    from memo_core.skillbook.book import Skillbook as Book_

    return Book_(book or load(config, overrides)[1].section("skillbook").url, read_only=read_only)


def _when(time: float) -> str:
    return local_time(time, "%Y-%m-%d %H:%M:%S")


def _key(revision: Revision) -> str:
    from memo_core.skillbook.model.entries import key_label

    return "" if revision.key is None else key_label(revision.key)


def _label(entry: Entry) -> str:
    from memo_core.skillbook.model.entries import key_label

    return key_label(entry.key)


def _line(entry: Entry) -> str:
    from memo_core.skillbook.model.entries import headline

    return headline(entry.kind, entry.text)


def _served_row(served: Any) -> tuple[Any, ...]:
    entry = served.entry
    keys = (served.key_score, served.action_cosine, served.objects_cosine)
    terms = (served.score, *keys, served.text_similarity, served.overlap)
    used = f"{entry.confirmed_uses}/{entry.uses}"
    return (served.rank, *(f"{t:.3f}" for t in terms), used, _when(entry.created), entry.id, served.key, _line(entry))


def _entry(entry: Entry) -> dict[str, Any]:
    return attrs.asdict(entry, filter=lambda field, _: field.name != "key") | {"key": _label(entry)}


def _revision(one: Revision) -> dict[str, Any]:
    changes = [
        {"change": c.change, "entry": c.entry.id, "kind": c.entry.kind, "text": c.entry.text}
        | {"why": c.why, "because": c.because}
        for c in one.changes
    ]
    return {"revision": one.id, "time": one.time, "key": _key(one), "reason": one.reason, "changes": changes}


def _version(version: Version) -> dict[str, Any]:
    record = {"state": version.state, "uses": version.uses, "confirmed_uses": version.confirmed_uses}
    return {"entry": version.entry.id, **record, "created": version.entry.created, "text": version.entry.text}


def _retrieval(found: Retrieval) -> dict[str, Any]:
    served: dict[str, Any] = {
        name: [
            {"rank": s.rank, "entry": s.entry.id, "key": s.key, "text": s.text, "score": s.score}
            | {"key_score": s.key_score, "action_cosine": s.action_cosine, "objects_cosine": s.objects_cosine}
            | {"text_similarity": s.text_similarity, "overlap": s.overlap, "passes": s.passes, "built": s.built}
            | {"exchanged": s.exchanged}
            | {"uses": s.entry.uses, "confirmed_uses": s.entry.confirmed_uses}
            | {"created": s.entry.created}
            for s in getattr(found, name)
        ]
        for name in ("corrections", "general", "templates")
    }
    functions = [
        {"entry": one.entry.id, "signature": one.signature, "tested": one.standing.tested}
        | {
            "calls": [
                {"entry": call.entry.id, "key": call.key, "call": call.text, "score": call.score} for call in one.calls
            ]
        }
        for one in found.functions
    ]
    return served | {
        "functions": functions,
        "cut": [attrs.asdict(one) for one in found.cut],
        "generation": found.generation,
    }


def _count(retired: dict[Any, list[Entry]]) -> dict[str, int]:
    return {str(key): len(entries) for key, entries in retired.items() if entries}
