"""``memo skillbook``: list, search, export and forget what people taught."""

from __future__ import annotations

import json as json_text
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli import (
    skillbook_editing,
    skillbook_history,
    skillbook_rebuild,
    skillbook_retest,
    skillbook_transfer,
)
from memo_core.cli.options import MOST_NUMBER, Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import local_time, note, note_unknown, print_json, print_table
from memo_core.cli.standard_input import agreed
from memo_core.errors import InvalidArgument, MemoError, close_match
from memo_core.runlog.whole_files import CannotWrite, whole_file
from memo_core.text.parsing import encodable, resolved
from memo_core.text.reading_limits import excerpt

if TYPE_CHECKING:
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.model.entries import Entry

app = typer.Typer(help="Skillbooks.")
skillbook_history.register(app)
skillbook_transfer.register(app)
skillbook_editing.register(app)
skillbook_rebuild.register(app)
skillbook_retest.register(app)

WAITING = ("id", "who", "time", "task", "subtask", "words", "status", "reason")  # of feedback without entries
Kind = Annotated[str | None, typer.Option("--kind", help="Only correction, general, template, function or call.")]


@app.command("list")
def list_entries(
    book: Book = None,
    kind: Kind = None,
    key: Annotated[str | None, typer.Option("--key", help="Only this key, e.g. 'OPEN(microwave)'.")] = None,
    who: Annotated[str | None, typer.Option("--who", help="Only what this person taught.")] = None,
    superseded: Annotated[bool, typer.Option("--superseded", help="Superseded entries too.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """List entries in the order in which they were stored, and feedback from which no entry was made yet."""
    from memo_core.skillbook.model.entries import KINDS
    from memo_core.skillbook.model.keys import Key

    if kind is not None and kind not in KINDS:
        raise InvalidArgument("--kind", f"{kind!r} is no kind of entry{close_match(kind, KINDS)}", " or ".join(KINDS))
    with _reading(book, config, overrides) as opened:
        entries = opened.entries(kind, key, who, superseded)
        note_unknown("person", who, opened.people())
        if not entries:
            wanted = None if key is None else str(Key.parse(key))
            note_unknown("key", wanted, {_label(entry) for entry in opened.entries(superseded=True)})
        waiting = [said for said in opened.pending_feedback(parked=True) if said.words and who in (None, said.who)]
        if json:
            waiting_shown = [{name: getattr(said, name) for name in WAITING} for said in waiting]
            print_json({"entries": [_as_json(entry) for entry in entries], "waiting": waiting_shown})
            return
        print_table(("id", "kind", "key", "uses", "text"), [_row(entry) for entry in entries])
        if entries:
            note("uses a/b: retrieved b times for code that ran, a times approved")
        for said in waiting:
            state = "pending: the next run begins with it"
            if said.status == "parked":
                state = f"set aside ({said.reason}); `memo skillbook retry` takes it up again"
            note(f"feedback {said.id}, {said.who} about {said.subtask}: {excerpt(said.words)!r}: {state}")


@app.command()
def show(
    entry: Annotated[int, typer.Argument(metavar="ID", max=MOST_NUMBER, help="The entry's number.")],
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Show one entry and the feedback it was made from."""
    with _reading(book, config, overrides) as opened:
        found = opened.entry(entry)
        origins = [opened.feedback(source) for source in opened.sources([entry])]
        if json:
            all_of_them = [attrs.asdict(origin) for origin in origins]
            first = next((one for one in all_of_them if one["id"] == found.feedback), None)
            print_json(_as_json(found) | {"from": first, "sources": all_of_them})
            return
        state = f"superseded by revision {found.superseded_by}" if found.superseded_by else "valid"
        print(f"entry {found.id}: {found.kind}, key {_label(found)}, {state}")
        print(f"served {found.uses} times to code that ran, {found.confirmed_uses} times approved\n\n{found.text}")
        if found.kind in ("function", "call"):
            _show_function(opened, found)
        for origin in origins:
            about = f"{origin.subtask} ({origin.task})"
            print(f"\nfrom {origin.who}, {local_time(origin.time)}, about {about}:\n  {origin.words or '(approved)'}")


def _show_function(book: Skillbook, entry: Entry) -> None:
    """The calls of a function, the programs they replaced and how they did when they were run; for a call its
    function."""
    from memo_core.skillbook.functions import functions_of, record_of

    for learnt in functions_of(book):
        if entry.id == learnt.entry.id or entry.id in {call.id for call in learnt.calls}:
            record = record_of(book, learnt)
            print(f"\nfunction {learnt.entry.id}: {learnt.function.signature}; tested: {record.tested}")
            for call, program in zip(learnt.calls, record.replaced, strict=True):
                print(f"  call {call.id} [{call.key}] {call.text}  (in place of {program.kind} {program.id})")
                for trial in record.trials.get(call.id, []):
                    ended = "succeeded" if trial.success else f"failed ({trial.reason})"
                    print(f"    {ended} from {trial.start}")


@app.command()
def search(
    words: Annotated[str, typer.Argument(help="What to look for; a subtask such as 'OPEN(oven)' is retrieved for.")],
    count: Annotated[
        int, typer.Option("--count", "-n", min=1, max=MOST_NUMBER, help="Largest number of results.")
    ] = 10,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Find entries: those that would be retrieved for a subtask and why, or those with the most similar text."""
    from memo_core.runs.factories import book_of

    if not encodable(words):
        raise InvalidArgument("WORDS", f"{words!r} is not UTF-8 text", "what to look for")
    with book_of(load(config, overrides)[1], book, read_only=True) as opened:
        if "(" in words:
            found = opened.retrieve(words)
            results = [
                {
                    "id": s.entry.id,
                    "kind": s.entry.kind,
                    "key": s.key,
                    "text": s.text,
                    "score": s.score,
                    "key_score": s.key_score,
                    "hint": not s.passes,
                    "action_cosine": s.action_cosine,
                    "objects_cosine": s.objects_cosine,
                }
                for s in found.served
            ]
            cut = [{"key": c.key, "score": c.score, "rule": c.rule} for c in found.cut]
        else:
            similar = opened.search(words, count)
            results = [_as_json(entry) | {"score": score} for entry, score in similar]
            cut = []
        if json:
            print_json({"query": words, "results": results, "cut": cut})
            return
        scores = ("s", "r") if "(" in words else ("score",)
        print_table((*scores, "id", "kind", "key", "text"), [_found_row(result) for result in results])
        for near in cut[:count]:
            note(f"not served: {near['key']} (r {near['score']:.2f}): {near['rule']}")


@app.command()
def stats(book: Book = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Count what is in the book."""
    from memo_core.skillbook import stats as book_stats

    with _reading(book, config, overrides) as opened:
        url, counts = opened.url, attrs.asdict(book_stats.stats_of(opened))
        if json:
            print_json({"url": url} | counts)
        else:
            print_table(("", url), list(counts.items()))


@app.command()
def growth(
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it, as .png or .svg.")] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Show how the book grew: entries, characters, functions, and the share of subtasks done by calling one."""
    from memo_core.skillbook import stats as book_stats

    with _reading(book, config, overrides) as opened:
        found = book_stats.growth_of(opened)
    if plot is not None:
        from memo_core.report.figures import draw_growth

        draw_growth(found, resolved(plot))
        note(f"drawn: {plot}")
    if json:
        print_json({"revisions": [attrs.asdict(one) for one in found]})
    elif plot is None:
        columns = ("revision", "when", "entries", "characters", "functions", "done by a call")
        shown = [(*attrs.astuple(one)[2:5], _percent(one.by_call)) for one in found]
        when = [(one.revision, local_time(one.time)) for one in found]
        print_table(columns, [(*at, *counts) for at, counts in zip(when, shown, strict=True)])


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f} %"


@app.command()
def export(
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; without it, stdout.")] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Write everything in the book except its vectors: one JSON object per line, first the book, then its contents."""
    from memo_core.skillbook import exchange

    with _reading(book, config, overrides) as opened:
        lines = (json_text.dumps(record, ensure_ascii=False) + "\n" for record in exchange.export(opened))
        if out is None:
            for line in lines:
                print(line, end="")
            return
        count = 0
        try:
            with whole_file(resolved(out)) if out.is_file() or not out.exists() else out.open("wb") as file:
                for line in lines:
                    file.write(line.encode("utf-8", "surrogatepass"))
                    count += 1
        except (CannotWrite, OSError) as error:
            problem = error.problem if isinstance(error, CannotWrite) else error.strerror
            raise InvalidArgument("--out", f"{out}: {problem}", "a file that can be written") from None
    note(f"{count} records -> {out}")
    _note_export(out, book, config, overrides)


def _note_export(out: Path, book: str | None, config: Path | None, overrides: list[str] | None) -> None:
    """Register the file with the book, so that ``forget`` covers it; a read-only book cannot forget."""
    try:
        with _opened(book, config, overrides, read_only=False) as opened:
            opened.note_place("export", out)
    except MemoError as error:
        note(f"memo: warning: forget will not know of {out}: {error}")


@app.command()
def forget(
    person: Annotated[str, typer.Argument(help="Whose words to remove.")],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    also: Annotated[
        list[Path] | None, typer.Option("--in", metavar="PATH", help="A further folder or file to go through.")
    ] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Remove a person's words and what derives only from them, also from run folders, recordings, exports and backups
    that the book knows of. Cannot be undone. Refused while a run is going on in one of these folders."""
    from memo_core.runlog.event_log import check_quiet

    for path in also or ():
        if not path.exists():
            raise InvalidArgument("--in", f"{path} is not there", "a folder or file")
    with _writing(book, config, overrides) as opened:
        if person in opened.people() and not yes:
            if sys.stdin is None or not sys.stdin.isatty():
                raise InvalidArgument(
                    "--yes", "there is no terminal to ask for confirmation", "memo skillbook forget … --yes"
                )
            if not agreed(f"Remove everything {person!r} said from {opened.url}? [y/n]"):
                raise InvalidArgument("the answer", "not yes: nothing was removed", "y, or --yes")
        runs = [place.path for place in opened.places() if place.kind == "run"]
        check_quiet([*runs, *(also or ())], "PERSON")
        forgotten = opened.forget(person, also or ())
    if json:
        print_json(attrs.asdict(forgotten))
    else:
        print(f"removed {forgotten.feedback} pieces of feedback, {forgotten.entries} entries, {forgotten.keys} keys")
        for verb, files in (("rewritten", forgotten.rewritten), ("deleted", forgotten.deleted)):
            for file in files:
                print(f"{verb}: {file}")
        print("not reached, see to it yourself:")
        for where in forgotten.unreached:
            print(f"- {where}")


@app.command()
def reembed(book: Book = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Switch the book to the experiment's embedder: all vectors are computed again."""
    from memo_core.skillbook.vectors.reembedding import reembed as embed_anew

    _, experiment = load(config, overrides)
    url = book or experiment.section("skillbook").url
    with _writing(book, config, overrides):
        pass  # says clearly when there is no such book
    embedder = experiment.create("embedder")
    try:
        texts = embed_anew(url, embedder)
        name = embedder.name
    finally:
        embedder.close()
    if json:
        print_json({"texts": texts, "embedder": name})
    else:
        print(f"{texts} texts embedded with {name}")


def _reading(book: str | None, config: Path | None, overrides: list[str] | None) -> Skillbook:
    return _opened(book, config, overrides, read_only=True)


def _writing(book: str | None, config: Path | None, overrides: list[str] | None) -> Skillbook:
    with _reading(book, config, overrides):
        pass  # a mistyped path is an error, not a new empty book
    return _opened(book, config, overrides, read_only=False)


def _opened(book: str | None, config: Path | None, overrides: list[str] | None, read_only: bool) -> Skillbook:
    """Without embedder and store: listing needs neither, and no backend has to work for it."""
    from memo_core.skillbook.book import Skillbook

    url = book or load(config, overrides)[1].section("skillbook").url
    return Skillbook(url, read_only=read_only)


def _label(entry: Entry) -> str:
    from memo_core.skillbook.model.entries import key_label

    return key_label(entry.key)


def _row(entry: Entry) -> tuple[Any, ...]:
    from memo_core.skillbook.model.entries import headline

    used = f"{entry.confirmed_uses}/{entry.uses}"
    return entry.id, entry.kind, _label(entry), used, headline(entry.kind, entry.text)


def _found_row(result: dict[str, Any]) -> tuple[Any, ...]:
    from memo_core.skillbook.model.entries import headline

    line = headline(result["kind"], result["text"])
    scores = [f"{result[name]:.3f}" for name in ("score", "key_score") if name in result]
    hint = ", hint" if result.get("hint") else ""
    return *scores, result["id"], f"{result['kind']}{hint}", result["key"], line


def _as_json(entry: Entry) -> dict[str, Any]:
    return attrs.asdict(entry, filter=lambda field, _: field.name != "key") | {"key": _label(entry)}
