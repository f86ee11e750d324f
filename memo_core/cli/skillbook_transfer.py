"""``memo skillbook import``, ``books``, ``check``: merging books, listing merged books, and checking a book for
damage."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.options import Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import local_time, note, print_json, print_table
from memo_core.errors import InvalidArgument, close_match
from memo_core.text.parsing import parse_json, read_at_most

if TYPE_CHECKING:
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.sharing.authors_books import Lorebook
    from memo_core.skillbook.sharing.importing import Imported
    from memo_core.skillbook.store.recovery import Rescued

_START_BYTES = 1 << 16  # by which a format is recognised
_LONGEST_LINE = 64 << 20  # bytes of one record
_MOST_BYTES = 1 << 28  # of a lorebook, which is read as a whole
_SQLITE = b"SQLite format 3\0"
FORMATS = ("memo", "lorebook")


def register(app: typer.Typer) -> None:
    """Add the commands of this file to ``memo skillbook``."""
    app.command("import")(import_book)
    app.command()(books)
    app.command()(check)


def import_book(
    file: Annotated[Path, typer.Argument(help="What `memo skillbook export` wrote, or a lorebook.")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="FORMAT", help="memo (JSONL) or lorebook; default: recognised."),
    ] = None,
    whose: Annotated[str | None, typer.Option("--whose", help="Whose book it is; without it, the file's name.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Report what would be imported, and change nothing.")
    ] = False,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Merge another book into this one. Importing twice changes nothing; a book that is not there is made."""
    from memo_core.skillbook import exchange

    if source is not None and source not in FORMATS:
        problem = f"{source!r} is no format{close_match(source, FORMATS)}"
        raise InvalidArgument("--from", problem, " or ".join(FORMATS))
    from memo_core.skillbook.sharing.authors_books import format_of, read_lorebook
    from memo_core.skillbook.sharing.import_records import ImportRecords

    name = whose or file.stem
    lorebook = None
    try:
        with file.open("rb") as stream:
            start = stream.read(_START_BYTES)
        source = source or format_of(start)
        if source is None:
            exported = f" --book {file}" if start.startswith(_SQLITE) else ""
            expected = f"what `memo skillbook export{exported}` writes, or a lorebook (a pickle, or the same as JSON)"
            raise InvalidArgument("FILE", f"{file} is no export of a book", expected)
        if source == "lorebook":
            lorebook = read_lorebook(read_at_most(file, _MOST_BYTES), name, file.stat().st_mtime)
    except OSError as error:
        raise InvalidArgument("FILE", f"{file}: {error.strerror}", "a file that can be read") from None
    except ValueError as error:
        raise InvalidArgument("FILE", f"{file} {error}", "a lorebook") from None
    records = ImportRecords(lorebook.records if lorebook is not None else _lines(file))
    with _opened(book, config, overrides) as opened:
        imported = exchange.merge(opened, records, name, dry_run)
        url = opened.url
    if json:
        read = None if lorebook is None else attrs.asdict(lorebook, filter=lambda field, _: field.name != "records")
        print_json({"url": url, "dry_run": dry_run} | attrs.asdict(imported) | {"read": read})
        return
    if lorebook is not None:
        _say_what_was_read(lorebook)
    _say(imported, url, dry_run)


def books(book: Book = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Say whose books were merged into this one, and when."""
    from memo_core.skillbook import exchange

    with _opened(book, config, overrides, read_only=True) as opened:
        merged = exchange.imported_books(opened)
        if json:
            print_json({"books": [attrs.asdict(one) for one in merged]})
            return
        print_table(
            ("whose", "book", "first", "last"),
            [(o.name, o.book, local_time(o.first), local_time(o.last)) for o in merged],
        )


def check(
    rescue: Annotated[
        Path | None, typer.Option("--rescue", metavar="FILE", help="Write what can be read to a new book in this file.")
    ] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Look for damage: the database's own check, and whether everything that is referred to is there."""
    from memo_core.skillbook.store.database import DamagedBook, Database

    url = book or load(config, overrides)[1].section("skillbook").url
    try:
        with _opened(url, None, None, read_only=True) as opened:
            problems = opened.problems()
    except DamagedBook as error:
        problems = [error.problem]
    rescued = None
    if rescue is not None:
        path = Database(url).path
        if path is None:
            raise InvalidArgument("--rescue", f"{url} is no file", "a book in a SQLite file")
        rescued = _rescue(path, rescue)
    if json:
        print_json({"url": url, "problems": problems, "rescued": None if rescued is None else attrs.asdict(rescued)})
    else:
        print("\n".join(problems) or f"{url}: nothing is wrong")
        if rescued is not None:
            counts = ", ".join(f"{count} {name}" for name, count in rescued.read.items())
            print(f"{rescue}: {counts or 'nothing'}; {rescued.dangling} rows left out that refer to something lost")
        elif problems:
            note("memo: `memo skillbook check --rescue FILE` gets out what can be read")
    if problems:
        raise typer.Exit(1)


def _rescue(path: Path, out: Path) -> Rescued:
    from memo_core.skillbook.store.recovery import rescue

    return rescue(path, out)


def _opened(book: str | None, config: Path | None, overrides: list[str] | None, read_only: bool = False) -> Skillbook:
    from memo_core.skillbook.book import Skillbook

    return Skillbook(book or load(config, overrides)[1].section("skillbook").url, read_only=read_only)


def _lines(file: Path) -> Iterator[dict[str, Any]]:
    """The records of a file, a line at a time."""
    from memo_core.skillbook.sharing.import_records import BadImport

    with file.open("rb") as stream:
        for number in itertools.count(1):
            line = stream.readline(_LONGEST_LINE + 1)
            if not line:
                return
            if len(line) > _LONGEST_LINE:
                raise BadImport(number, f"{file} has a line of more than {_LONGEST_LINE >> 20} MiB")
            try:
                yield parse_json(line)
            except ValueError as error:
                hint = "; a lorebook's pickle is read with --from lorebook" if number == 1 else ""
                raise BadImport(number, f"{file} is no JSON there ({str(error)[:80]}){hint}") from None


def _say_what_was_read(read: Lorebook) -> None:
    print(
        f"read {read.items} items: {read.corrections} corrections, {read.general} general statements, "
        f"{read.templates} templates under {read.keys} keys ({read.spellings} spellings)"
    )
    passed = {"without a text": read.empty, "repeated": read.repeated, "with a key that is none": read.unread_count}
    if any(passed.values()):
        print("passed over: " + ", ".join(f"{count} {what}" for what, count in passed.items() if count))
    for key in read.unread:
        note(f"no key: {key[:100]!r}")
    if read.vectors:
        note(f"its {read.vectors} vectors are not used: texts are embedded by the book's own embedder")


def _say(imported: Imported, url: str, dry_run: bool) -> None:
    verb = "would bring" if dry_run else "brought"
    if not imported.changed:
        print(f"{imported.name} {verb} nothing new to {url} ({imported.known} rows known)")
        return
    print(
        f"{imported.name} {verb} {url} {imported.feedback} pieces of feedback, {imported.entries} entries, "
        f"{imported.changes} changes of entries, {imported.aliases} aliases"
    )
    if imported.withdrawn:
        print(
            f"{imported.withdrawn} pieces of feedback that were withdrawn there {'would be' if dry_run else 'are'} gone"
        )
    if imported.left_out:
        print(f"{imported.left_out} rows stay away: withdrawn here")
