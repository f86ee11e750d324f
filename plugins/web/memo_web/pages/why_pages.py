"""Why pages: what the robot was taught, by whom, in which words, where it was tested, and what came of it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import TypeVar

import attrs
from nicegui import run, ui

from memo_core.plugin import MemoError, check_quiet
from memo_core.skillbook import Entry, Explanation, Forgotten, Skillbook, explain
from memo_web.pages.layout import LINKS, framed, visitor
from memo_web.pages.run_view import RunView
from memo_web.pages.study_state import study_of
from memo_web.pages.text import heading, local_time, program, section, words
from memo_web.why import LONGEST_SEARCH, RunRecords, Use, run_folders, search

Result = TypeVar("Result")
KINDS = {
    "": "everything",
    "correction": "corrections",
    "general": "general statements",
    "template": "programs",
    "function": "functions",
    "call": "calls of functions",
}
ONE = {
    "correction": "correction",
    "general": "general statement",
    "template": "program",
    "function": "function",
    "call": "call of a function",
}
OUTCOMES = {"approved": "it worked", "corrected": "corrected", "unobserved": "nobody said", "not over": "not over yet"}
_READING_S = 60.0  # a large book, with many folders of runs, on a machine under load
_MOST_SHOWN = 200  # entries of a list, and uses of an entry
_records = RunRecords()


@attrs.frozen
class BookShelf:
    """The book that Why pages show.

    Attributes:
        url: returns the book's database URL or file; "" if no run has named one yet.
    """

    url: Callable[[], str]

    async def read(self, work: Callable[[Skillbook], Result]) -> Result | None:
        """Read the book in another thread; None, with a sentence on the page, if there is no book that can be read.

        Args:
            work: takes the open book.

        Returns:
            What ``work`` returned.
        """
        return await self._open(work, read_only=True)

    async def write(self, work: Callable[[Skillbook], Result]) -> Result | None:
        """Change the book in another thread; as ``read``."""
        return await self._open(work, read_only=False)

    async def _open(self, work: Callable[[Skillbook], Result], read_only: bool) -> Result | None:
        url = self.url()
        if not url:
            words("No run has begun, so there is no book to show yet.")
            return None

        def do() -> Result:
            if not read_only:
                with Skillbook(url, read_only=True):
                    pass  # a missing book is an error, not a new empty one
            with Skillbook(url, read_only=read_only) as book:
                return work(book)

        try:
            return await run.io_bound(do)
        except MemoError as error:
            words(f"This cannot be shown: {error}")
            return None


def add_pages(view: RunView) -> None:
    """Add the pages of the book.

    Args:
        view: the run.
    """
    study = study_of(view)
    view.on("book", lambda message, blob: view.more.update(book=message["url"]))
    LINKS.add("/why", "Why", study.sees_all)

    def shelf() -> BookShelf | None:
        if study.sees_all(visitor()):
            return BookShelf(lambda: book_url(view))
        heading("This page is for the person who runs the study")
        return None

    @ui.page("/why", response_timeout=_READING_S)
    async def why() -> None:
        with framed(view, "Why"):
            if (book := shelf()) is not None:
                await show_list(book)

    @ui.page("/why/{number}", response_timeout=_READING_S)
    async def why_entry(number: int) -> None:
        with framed(view, "Why"):
            if (book := shelf()) is not None:
                await show_entry(book, number)


def book_url(view: RunView) -> str:
    """The book that is taught into: the run's, or else the first of the study's that is there; "" if there is none.

    Args:
        view: the run.

    Returns:
        Its database URL or file.
    """
    folder = study_of(view).shown.get("folder")
    books = sorted(Path(folder).glob("history-*/skillbook.db")) if folder else []
    return str(view.more.get("book") or (books[0] if books else ""))


# -- the list ----------------------------------------------------------------------------------------------------------
async def show_list(shelf: BookShelf) -> None:
    """Show the list of entries with a search field, and a form to have a person forgotten.

    Args:
        shelf: the book.
    """
    heading("What the robot was taught")
    with ui.row().classes("items-center w-full"):
        wanted = ui.input("words").props(f"clearable maxlength={LONGEST_SEARCH}").classes("w-72").mark("search")
        kind = ui.select(KINDS, value="", label="show").classes("w-56")
        retired = ui.checkbox("also what was replaced")
    results = ui.column().classes("w-full gap-2").mark("results")
    turn = asyncio.Lock()  # searches of quick typing follow one another

    async def refresh() -> None:
        async with turn:
            before = list(results)
            with results:
                found = await shelf.read(
                    lambda book: search(
                        book, (wanted.value or "")[:LONGEST_SEARCH], kind.value or "", bool(retired.value)
                    )
                )
                if found is not None:
                    _list(found)
            for element in before:
                element.delete()

    for field in (kind, retired):
        field.on_value_change(refresh)
    wanted.on_value_change(refresh)
    await refresh()
    ui.separator()
    await _show_forgetting(shelf, refresh)


def _list(entries: Sequence[Entry]) -> None:
    count = len(entries)
    words("Nothing was found." if not count else f"{count} {'entry' if count == 1 else 'entries'}, newest first")
    for entry in entries[:_MOST_SHOWN]:
        entry_line(entry)
    if count > _MOST_SHOWN:
        words(f"{count - _MOST_SHOWN} more: search for words to find them.")


def entry_line(entry: Entry) -> None:
    """Show one line for an entry, which leads to its page."""
    with ui.row().classes("items-baseline no-wrap w-full gap-3"):
        ui.link(f"{ONE[entry.kind]} {entry.id}", f"/why/{entry.id}").classes("whitespace-nowrap")
        ui.label(str(entry.key) if entry.key.objects else "everywhere").classes("text-gray-700 whitespace-nowrap")
        ui.label(Explanation(entry, ()).title).classes("break-words min-w-0")
        if entry.superseded_by is not None:
            ui.label("replaced").classes("text-gray-600 italic")


# -- one entry ---------------------------------------------------------------------------------------------------------
async def show_entry(shelf: BookShelf, number: int) -> None:
    """Show an entry: its text, the words it was made of, its programs, its tests, and its uses.

    Args:
        shelf: the book.
        number: id of the entry.
    """
    found = await shelf.read(lambda book: (explain(book, number), _records.of(book, number)))
    if found is None:
        return
    entry, uses = found
    _show_text(entry)
    _show_said(entry)
    _show_programs(entry)
    _show_tests(entry)
    _show_uses(entry, uses)


def _show_text(found: Explanation) -> None:
    entry = found.entry
    name = f" {found.function_name}" if found.function_name else ""
    heading(f"{ONE[entry.kind].capitalize()}{name} ({entry.id})")
    where = "everywhere" if not entry.key.objects else ", ".join(found.keys)
    words(f"Used for: {where}. Stored {local_time(entry.created)}.")
    if entry.kind in ("correction", "general"):
        ui.label(entry.text).classes("text-lg whitespace-pre-wrap break-words border-l-4 pl-3")
    else:
        program(entry.text)
    if found.retired or entry.superseded_by is not None:
        words(f"It is used no more: {found.retired or 'replaced'}.")
    if found.gave_way_to is not None:
        words("In its place:")
        entry_line(found.gave_way_to)


def _show_said(found: Explanation) -> None:
    section("What people said")
    if not found.said:
        words("Nothing is known: it was imported, or the words were withdrawn.")
    for one in found.said:
        with ui.column().classes("gap-0 border-l-4 pl-3"):
            said = one.words or ("(said that it worked)" if one.kind == "approval" else "(no words)")
            ui.label(said).classes("text-lg whitespace-pre-wrap break-words")
            about = f", about {one.subtask}" if one.subtask else ""
            task = f' in "{one.task}"' if one.task else ""
            ui.label(f"{one.who}, {local_time(one.time)}{about}{task}").classes("text-gray-700")
    for reaction in found.reactions:
        became = f": {reaction.text}" if reaction.text else ""
        words(f"Read back to {reaction.who}, {local_time(reaction.time)}: {reaction.outcome}{became}")
    if found.made_of:
        words("Made of:")
        for entry in found.made_of:
            entry_line(entry)


def _show_programs(found: Explanation) -> None:
    codes = list(dict.fromkeys(one.code for one in found.said if one.code.strip()))
    if not codes and found.function is None:
        return
    section("Programs")
    if found.function is not None:
        _show_function(found)
    for code in codes:
        with ui.expansion("The program that this was said about").classes("w-full"):
            program(code)


def _show_function(found: Explanation) -> None:
    record = found.function
    assert record is not None
    learnt = record.learnt
    if learnt.entry.id != found.entry.id:
        words("It calls:")
        entry_line(learnt.entry)
        return
    count = len(record.replaced)
    words(f"Learnt from {count} {_programs(count)} of {', '.join(record.people) or 'nobody known'}.")
    for call, replaced in zip(learnt.calls, record.replaced, strict=True):
        entry_line(call)
        with ui.expansion(f"in place of the program {replaced.id}").classes("w-full pl-6"):
            program(replaced.text)


def _show_tests(found: Explanation) -> None:
    record = found.function
    own = record is not None and record.learnt.entry.id == found.entry.id
    calls = {call.id: call.text for call in record.learnt.calls} if record is not None and own else {}
    trials = (
        [(calls.get(call, ""), one) for call, some in record.trials.items() for one in some] if calls and record else []
    )
    trials += [("", one) for one in found.trials]
    if found.entry.kind in ("correction", "general"):
        return
    section("Where it was tested")
    if record is not None:
        words(f"The function {record.learnt.function.name}: {record.tested}.")
    elif not trials:
        words("It was approved by the people above, and not run again since.")
    for call, trial in trials:
        ended = "succeeded" if trial.success else f"failed: {trial.reason or 'no reason is known'}"
        words(f"{local_time(trial.time)}, {trial.start}{f', {call}' if call else ''}: {ended}")


def _show_uses(found: Explanation, uses: Sequence[Use]) -> None:
    section("Where it was retrieved, and what came of it")
    if not uses and not found.evidence:
        words("It was not retrieved yet.")
    for one in found.evidence:
        words(f"{one.key}: for {one.served} {_programs(one.served)} that ran, {one.approved} of them approved")
    for use in uses[-_MOST_SHOWN:][::-1]:
        _show_use(use)


def _programs(count: int) -> str:
    return "program" if count == 1 else "programs"


def _show_use(use: Use) -> None:
    with ui.column().classes("gap-0 border-l-4 pl-3 w-full"):
        with ui.row().classes("items-baseline gap-3"):
            ui.badge(OUTCOMES[use.outcome], color="green-9" if use.outcome == "approved" else "grey-8")
            attempt = f", attempt {use.attempt}" if use.attempt else ""
            ui.label(f"{use.subtask}{attempt}").classes("break-words")
            ui.label(f'{local_time(use.time)}, in "{use.task}" (score {use.score:.2f})').classes(
                "text-gray-700 break-words"
            )
        for one in use.words:
            words(f"They said: {one}")
        if use.error:
            words(f"The program ended with: {use.error}")
        if use.code:
            with ui.expansion("The program that was written with it").classes("w-full"):
                program(use.code)


# -- the right to withdraw ---------------------------------------------------------------------------------------------
async def _show_forgetting(shelf: BookShelf, refresh: Callable[[], Awaitable[None]]) -> None:
    section("Forget a person")
    words(
        "Removes everything that a person said, and what was made of their words alone: from the book, from the "
        "folders of its runs, and from exports and backups that it knows of. This cannot be undone."
    )
    people = await shelf.read(lambda book: book.people())
    if people is None:
        return
    with ui.row().classes("items-center"):
        who = ui.select(people, label="person").classes("w-56").mark("person")
        button = ui.button("Forget …")
    report = ui.column().classes("w-full gap-1").mark("forgotten")
    button.on_click(lambda: _confirm(shelf, str(who.value), report, done) if who.value else None)

    async def done() -> None:
        who.set_options([one for one in who.options if one != who.value], value=None)
        await refresh()


def _confirm(shelf: BookShelf, who: str, report: ui.column, done: Callable[[], Awaitable[None]]) -> None:
    """Ask for the person's name once more, since this cannot be undone."""
    with ui.dialog() as dialog, ui.card():
        ui.label(f"Forget {who} for good?").classes("text-lg break-words")
        typed = ui.input(f"type {who} to confirm").classes("w-64").mark("confirmation")

        async def forget() -> None:
            if (typed.value or "").strip() != who:
                ui.notify(f"Type {who} exactly as it is written here.", type="warning")
                return
            dialog.close()
            if await _forget(shelf, who, report):
                await done()

        with ui.row():
            ui.button("Forget for good", on_click=forget, color="negative")
            ui.button("Keep", on_click=dialog.close).props("flat")
    dialog.open()


async def _forget(shelf: BookShelf, who: str, report: ui.column) -> bool:
    """Forget a person and report it; False, with the reason on the page, if that could not be done."""

    def work(book: Skillbook) -> Forgotten:
        check_quiet(run_folders(book), "person")
        return book.forget(who)

    report.clear()
    with report:
        gone = await shelf.write(work)
        if gone is None:
            return False
        words(f"{who} is forgotten: {gone.feedback} sentences and {gone.entries} entries were removed.")
        for file in (*gone.rewritten, *gone.deleted):
            words(f"cleaned: {file}")
        words("Not reached, to be seen to by hand:")
        for where in gone.unreached:
            words(f"– {where}")
        return True
