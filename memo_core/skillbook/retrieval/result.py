"""The result of a retrieval: entries with each term of their scores, and what was cut by which rule."""

from __future__ import annotations

import attrs

from memo_core import events
from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.entries import Entry, key_label
from memo_core.skillbook.model.functions import as_template, read_function
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.provenance import Provenance

ALIKE = ("the same subtask", "the same action on something else", "another action on the same thing", "something else")


def alike(subtask: Key, key: Key, actions: Actions) -> str:
    """Likeness of an entry's key to a subtask in words for prompts, one of ``ALIKE``."""
    one, other = actions.about(subtask), actions.about(key)
    same_action = actions.canonical(subtask.action) == actions.canonical(key.action)
    same_objects = one.objects == other.objects
    return ALIKE[(0 if same_objects else 1) if same_action else (2 if same_objects else 3)]


@attrs.frozen
class RetrievedEntry:
    """An entry with each term of its score: what retrieval ranks and the run logs. The prompt leaves out what was
    said in this run already, and repeats.

    ``passes`` tells the two ways of being retrieved apart. True: the entry's key passes the cut (``retrieval.cut``), it
    is about this subtask or one like it, and is meant to be followed; so are general statements. False: it is a hint,
    retrieved for what its text says or as the nearest there is, and may be about something else. General statements
    have no key cosines; their score is their text's similarity to the subtask.
    """

    entry: Entry
    rank: int  # 1 is first
    score: float  # what it is ranked by: r, or s(q, e) and the term of structure that ranking adds
    action_cosine: float
    objects_cosine: float
    text_similarity: float  # cosine of its text and the subtask's words
    key_score: float = 0.0  # r(q, v); 0 for general statements
    overlap: float = 0.0  # share of the subtask's terms that the text has; 0 where r alone decides
    provenance: Provenance = Provenance()  # who said it, when, and of which subtask
    passes: bool = True
    built: float | None = None  # how alike the things are built, in [0, 1]; None: not known, or not compared
    exchanged: float = 0.0  # x(q, v): how far its key has the subtask's objects in exchanged roles
    alike: str = ""  # how its key compares with the subtask, one of ``ALIKE``; "" for general statements
    origin: str = ""  # how the prompt introduces it
    under: str = ""  # of a note with several keys, the one that it was retrieved under, if it is not its first

    @property
    def about(self) -> Key:
        """The key that it was retrieved under."""
        return Key.parse(self.under) if self.under else self.entry.key

    @property
    def key(self) -> str:
        return self.under or key_label(self.entry.key)

    @property
    def text(self) -> str:
        return self.entry.text

    def event(self) -> events.EntryServed:
        cosines = (self.action_cosine, self.objects_cosine)
        key_score = self.key_score if self.alike else None
        return events.EntryServed(
            self.entry.id, self.entry.kind, self.key, self.text, self.score, *cosines, key_score, not self.passes
        )


@attrs.frozen
class Standing:
    """The evidence for a function.

    Attributes:
        tested: calls of it succeeded when they were run, or its code was approved as it is.
        approved: programs written with it that were approved.
    """

    tested: bool = True
    approved: int = 0


@attrs.frozen
class RetrievedFunction:
    """A function with those of its calls that were retrieved, best first."""

    entry: Entry
    calls: tuple[RetrievedEntry, ...]
    standing: Standing = Standing()

    @property
    def signature(self) -> str:
        return read_function(self.entry.text).signature

    @property
    def docstring(self) -> str:
        return read_function(self.entry.text).docstring

    def event(self) -> events.EntryServed:
        """The function with the key and the scores of its best call."""
        return attrs.evolve(self.calls[0].event(), entry=self.entry.id, kind=self.entry.kind, text=self.entry.text)

    def as_template(self) -> RetrievedEntry:
        """The function with the arguments of its best call as defaults, as the template of that call's key."""
        best = self.calls[0]
        return attrs.evolve(best, entry=attrs.evolve(best.entry, text=as_template(self.entry.text, best.text)))


@attrs.frozen
class Cut:
    """A key whose entries were not, or not all, retrieved, and the rule that kept them out."""

    key: str
    score: float  # r
    rule: (
        str  # "opposite action", "below the cut 0.85", "beyond the first 20 corrections", "the same code as template 3"
    )
    action_cosine: float = 0.0
    objects_cosine: float = 0.0
    entries: int = 0


@attrs.frozen
class Retrieval:
    """The entries retrieved for one subtask."""

    query: Key
    corrections: tuple[RetrievedEntry, ...] = ()
    general: tuple[RetrievedEntry, ...] = ()
    templates: tuple[RetrievedEntry, ...] = ()
    cut: tuple[Cut, ...] = ()  # nearest first
    generation: int = 0  # of the book
    sources: tuple[int, ...] = ()  # feedback that the entries derive from
    functions: tuple[RetrievedFunction, ...] = ()  # best first

    @property
    def served(self) -> tuple[RetrievedEntry, ...]:
        """All entries: corrections, general statements, templates, calls of functions."""
        calls = tuple(call for function in self.functions for call in function.calls)
        return self.corrections + self.general + self.templates + calls

    @property
    def entry_ids(self) -> tuple[int, ...]:
        """Ids of all entries, functions last."""
        return (*(one.entry.id for one in self.served), *(one.entry.id for one in self.functions))

    def event(self) -> events.Retrieved:
        return events.Retrieved(
            subtask=str(self.query),
            served=(*(one.event() for one in self.served), *(one.event() for one in self.functions)),
            cut=tuple((c.key, c.score, c.rule) for c in self.cut),
        )
