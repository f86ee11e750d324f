"""Explaining an entry: the words and programs that it derives from, its tests, and its uses by key."""

from __future__ import annotations

import attrs

from memo_core.skillbook import history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import FunctionRecord, functions_of, further_keys, record_of
from memo_core.skillbook.model.entries import Entry, Feedback, KeptReadBack, headline, key_label
from memo_core.skillbook.model.functions import NotAFunction, read_function
from memo_core.skillbook.retrieval.negative_transfer import Evidence
from memo_core.skillbook.store.trials import TemplateTrial
from memo_core.skillbook.track_record import evidence_of, trials_of


@attrs.frozen
class Explanation:
    """An entry with everything that the book knows of its origin and its record.

    Attributes:
        entry: the entry itself, active or superseded.
        keys: its keys as text, its own first; ``*`` for general statements.
        said: feedback that it derives from, oldest first; an approval may have no words.
        reactions: how people reacted when it was read back, edited or removed, oldest first.
        made_of: entries that gave way to it when it was stored.
        gave_way_to: the entry that replaced it; None if it is active, or was retired without a replacement.
        retired: why it was retired, in the book's words; "" if it is active.
        evidence: its retrievals for code that ran and their approvals, by key.
        trials: results of running its program again in a simulator, oldest first.
        function: the record of the active function that it is, or that it calls; None for other entries.
    """

    entry: Entry
    keys: tuple[str, ...]
    said: tuple[Feedback, ...] = ()
    reactions: tuple[KeptReadBack, ...] = ()
    made_of: tuple[Entry, ...] = ()
    gave_way_to: Entry | None = None
    retired: str = ""
    evidence: tuple[Evidence, ...] = ()
    trials: tuple[TemplateTrial, ...] = ()
    function: FunctionRecord | None = None

    @property
    def title(self) -> str:
        """One line for lists: the text, or a program's name with the first line of its docstring."""
        return headline(self.entry.kind, self.entry.text)

    @property
    def people(self) -> tuple[str, ...]:
        """People from whose words and approvals it derives, in the order in which they first spoke."""
        return tuple(dict.fromkeys(one.who for one in self.said))

    @property
    def function_name(self) -> str:
        """Name of the function that its text defines; "" if the text defines none."""
        try:
            return read_function(self.entry.text).name if self.entry.kind in ("template", "function") else ""
        except NotAFunction:
            return ""


def explain(book: Skillbook, entry_id: int) -> Explanation:
    """Gather what the book knows of an entry.

    Args:
        book: the open book; neither embedder nor vector store is used.
        entry_id: the entry, active or superseded.

    Returns:
        The entry with its origin and its record.

    Raises:
        UnknownName: if there is no such entry.
    """
    entry = book.entry(entry_id)
    said = tuple(book.feedback(number) for number in book.sources([entry_id]))
    reactions = [one for feedback in said for one in book.read_backs(feedback.id) if one.entry == entry_id]
    added = history.revision(book, entry.revision).changes
    retired = None
    if entry.superseded_by is not None:
        changes = history.revision(book, entry.superseded_by).changes
        retired = next((one for one in changes if one.entry.id == entry_id and one.change == "superseded"), None)
    replaced_by = retired.because if retired is not None else None
    return Explanation(
        entry,
        (key_label(entry.key), *(str(key) for key in further_keys(book, entry))),
        said,
        tuple(reactions),
        tuple(one.entry for one in added if one.because == entry_id and one.change == "superseded"),
        book.entry(replaced_by) if replaced_by is not None else None,
        retired.why if retired is not None else "",
        tuple(evidence_of(book, entry_id)),
        tuple(trials_of(book, [entry_id]).get(entry_id, ())),
        _function_record(book, entry),
    )


def _function_record(book: Skillbook, entry: Entry) -> FunctionRecord | None:
    if entry.kind not in ("function", "call"):
        return None
    for learnt in functions_of(book):
        if entry.id == learnt.entry.id or entry.id in {call.id for call in learnt.calls}:
            return record_of(book, learnt)
    return None
