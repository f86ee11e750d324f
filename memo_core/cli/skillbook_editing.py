"""``memo skillbook edit|remove``: edit or remove an entry by a revision that can be rolled back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from memo_core.cli.options import MOST_NUMBER, Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json
from memo_core.cli.standard_input import text_of_stdin
from memo_core.errors import InvalidArgument
from memo_core.text.parsing import read_at_most

if TYPE_CHECKING:
    from memo_core.skillbook.book import Skillbook

_MOST_BYTES = 1 << 20
Number = Annotated[
    int, typer.Argument(metavar="ENTRY", max=MOST_NUMBER, help="The entry's number (memo skillbook list).")
]
Who = Annotated[
    str | None, typer.Option("--who", help="Your name in the book, so that you can withdraw; default: your login name.")
]


def register(app: typer.Typer) -> None:
    """Add the commands of this file to ``memo skillbook``."""
    app.command()(edit)
    app.command()(remove)


def edit(
    entry: Number,
    text: Annotated[str | None, typer.Argument(metavar="[TEXT]", help="The new text; - reads it from stdin.")] = None,
    file: Annotated[Path | None, typer.Option("--file", help="Read the new text from a file (a template).")] = None,
    who: Who = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Replace an entry's text. The previous text stays in the history."""
    wanted = _text(text, file)
    with opened_book(book, config, overrides) as opened:
        new = opened.edit(entry, wanted, _name(who))
    if json:
        print_json({"entry": new.id, "replaces": entry, "revision": new.revision, "text": new.text})
    elif new.id == entry:
        print(f"entry {entry} already has this text")
    else:
        print(f"entry {new.id} replaces {entry}; `memo skillbook rollback {new.revision}` undoes this")


def remove(
    entry: Number,
    who: Who = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Stop retrieving an entry. It stays in the history; only `forget` deletes words permanently."""
    with opened_book(book, config, overrides) as opened:
        revision = opened.remove(entry, _name(who))
    if json:
        print_json({"entry": entry, "revision": revision})
    else:
        print(f"entry {entry} is no longer retrieved; `memo skillbook rollback {revision}` undoes this")


def _name(who: str | None) -> str:
    from memo_core.teachers.terminal import login_name

    return who or login_name()


def _text(text: str | None, file: Path | None) -> str:
    if (text is None) == (file is None):
        raise InvalidArgument("TEXT", "the new text is needed once", "TEXT, - for stdin, or --file FILE")
    if file is not None:
        try:
            return read_at_most(file, _MOST_BYTES).decode("utf-8")
        except (OSError, ValueError) as error:
            problem = f"{file}: {getattr(error, 'strerror', None) or error}"
            raise InvalidArgument("--file", problem, "a text file that can be read") from None
    assert text is not None
    return text_of_stdin(_MOST_BYTES) if text == "-" else text


def opened_book(book: str | None, config: Path | None, overrides: list[str] | None) -> Skillbook:
    """Without embedder and store: neither is needed. A mistyped path is an error, not a new empty book."""
    from memo_core.skillbook.book import Skillbook

    url = book or load(config, overrides)[1].section("skillbook").url
    with Skillbook(url, read_only=True):
        pass
    return Skillbook(url)
