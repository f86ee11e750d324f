"""What retrieval answers, as values: what was served with each term of its score, and what was cut by which rule."""

from __future__ import annotations

import attrs

from memo_core import events
from memo_core.skillbook.action_relations import Actions
from memo_core.skillbook.entries import Entry, key_label
from memo_core.skillbook.keys import Key
from memo_core.skillbook.provenance import Provenance

ALIKE = ("the same subtask", "the same action on something else", "another action on the same thing", "something else")


def alike(subtask: Key, key: Key, actions: Actions) -> str:
    """How an entry's key compares with a subtask, for prompts: one of ``ALIKE``."""
    one, other = actions.about(subtask), actions.about(key)
    same_action = actions.canonical(subtask.action) == actions.canonical(key.action)
    same_objects = one.objects == other.objects
    return ALIKE[(0 if same_objects else 1) if same_action else (2 if same_objects else 3)]


@attrs.frozen
class Served:
    """An entry that was served: its place (1 is first) and each term of its score. General statements have no cosines
    of their own, their score is their text's similarity to the subtask.

    ``passes`` tells the two ways of being served apart. True: the entry's key passes the cut (``retrieval.cut``), it is
    about this subtask or one like it, and is meant to be followed; so are general statements. False: it is only a hint,
    served beside the others, or because there are none, for what its text says or as the nearest there is: it may be of
    use and may as well be about something else. ``alike`` says in words what the key has in common with the subtask.
    """

    entry: Entry
    rank: int
    score: float  # what it is ranked by: r, or s with ``retrieval.ranking: key-and-text``
    action_cosine: float
    objects_cosine: float
    text_similarity: float  # cosine of its text and the subtask's words
    key_score: float = 0.0  # r(q, v); 0 for general statements
    overlap: float = 0.0  # share of the subtask's terms that the text has; 0 where r alone decides
    provenance: Provenance = Provenance()  # who said it, when, and of which subtask
    passes: bool = True  # whether its key passes the cut; False: a hint from something else, see above
    built: float | None = None  # how alike the things are built, 0 to 1; None: not known, or not compared
    exchanged: float = 0.0  # how far its key has the subtask's objects in exchanged roles; words count so much less
    alike: str = ""  # how the key compares with the subtask, in words: one of ``ALIKE``; "" for general statements

    @property
    def key(self) -> str:
        return key_label(self.entry.key)

    @property
    def text(self) -> str:
        return self.entry.text

    def event(self) -> events.EntryServed:
        return events.EntryServed(
            self.entry.id, self.entry.kind, self.key, self.text, self.score, self.action_cosine, self.objects_cosine
        )


@attrs.frozen
class Cut:
    """A key whose entries were not, or not all, served, and the rule that kept them out."""

    key: str
    score: float  # r
    action_cosine: float
    objects_cosine: float
    entries: int
    rule: str  # "opposite action", "below the cut 0.85", "beyond the first 20 corrections"


@attrs.frozen
class Retrieval:
    """What one subtask is served."""

    query: Key
    corrections: tuple[Served, ...]
    general: tuple[Served, ...]
    templates: tuple[Served, ...]
    cut: tuple[Cut, ...]  # nearest first
    generation: int

    @property
    def served(self) -> tuple[Served, ...]:
        return self.corrections + self.general + self.templates

    def event(self) -> events.Retrieved:
        return events.Retrieved(
            subtask=str(self.query),
            served=tuple(one.event() for one in self.served),
            cut=tuple((c.key, c.score, c.rule) for c in self.cut),
        )
