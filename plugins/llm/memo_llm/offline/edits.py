"""What was understood of a sentence: edits, and the words that could not be made sense of."""

from __future__ import annotations

import attrs

from memo_llm.offline.vocabulary import Amount, Phrase

GENTLE = frozenset(
    [
        "gently",
        "softly",
        "lightly",
        "carefully",
        "delicately",
        "softer",
        "less hard",
        "with less force",
        "less force",
        "little force",
    ]
)


@attrs.frozen
class Edit:
    """One thing to do differently. ``kind`` is a heading of the vocabulary's phrases."""

    kind: str
    value: str = ""  # looked up in the vocabulary's values
    amount: Amount | None = None
    degrees: float | None = None
    seconds: float | None = None
    base: float | None = None  # m: where the attempt was that a relative remark was said of, along ``value``
    base_degrees: float | None = None  # the same where it is an angle
    count: int = 1
    negated: bool = False  # only where the phrase has no opposite
    verb: str = attrs.field(default="", eq=False)  # what is to be done harder or less hard, where it is not gripping
    said: str = attrs.field(default="", eq=False)  # the words it was read from
    phrase: Phrase | None = attrs.field(default=None, eq=False, repr=False)
    degree: bool = attrs.field(default=False, eq=False)  # read from an adjective of degree: "too high", "slower"


@attrs.frozen
class Reading:
    """What was understood of one sentence, in the order it was said, and what was not."""

    edits: tuple[Edit, ...]
    not_understood: tuple[str, ...]  # words, or a whole clause where nothing of it was understood
    praised: bool = False  # whether a clause approves and asks for nothing
    unsure: tuple[str, ...] = ()  # clauses that may mean something else than what was understood of them
