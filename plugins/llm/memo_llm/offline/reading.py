"""From everyday sentences to edits, and the words that could not be made sense of."""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_llm.offline.spelling import in_figures
from memo_llm.offline.vocabulary import Amount, Phrase, Vocabulary

_UNITS = {"cm", "mm", "inch", "m", "degrees", "seconds", "newton"}
MOST_UNKNOWN = 0.22  # share of a clause's words beside what was understood, above which it may mean something else


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
    said: str = attrs.field(default="", eq=False)  # the words it was read from
    phrase: Phrase | None = attrs.field(default=None, eq=False, repr=False)


@attrs.frozen
class Reading:
    """What was understood of one sentence, in the order it was said, and what was not."""

    edits: tuple[Edit, ...]
    not_understood: tuple[str, ...]  # words, or a whole clause where nothing of it was understood
    unsure: tuple[str, ...] = ()  # clauses that may mean something else than what was understood of them


def read_sentence(text: str, vocabulary: Vocabulary, known: Iterable[str] = (), kind: str = "") -> Reading:
    """``known`` are words that name something in the scene, ``kind`` is the kind of subtask that was spoken of (see
    ``memo_llm.offline.recipe``), "" where that is not known."""
    nouns = {word for name in known for word in re.findall(r"[\w'-]+", name.lower())}
    edits: list[Edit] = []
    missed: list[str] = []
    unsure: list[str] = []
    found, plain = _read_whole(_plain(text), vocabulary, kind)
    edits += found
    for clause in _clauses(plain):
        found, rest = _read_clause(clause, vocabulary, kind)
        said = [edit for edit in found if edit.kind != "nothing"]
        unknown = [w for w in re.findall(r"[^\W_][\w'-]*", rest) if not _plain_word(w, vocabulary, nouns)]
        for edit in said:
            edits += [] if any(_same(edit, other) for other in edits) else [edit]
        if unknown and not said:
            missed.append(clause)
            continue
        missed += unknown
        if len(unknown) > 1 and len(unknown) >= MOST_UNKNOWN * len(clause.split()):
            unsure.append(clause)
    if not edits:
        missed = [" ".join(text.split())]
    return Reading(tuple(edits), tuple(missed), tuple(unsure))


def _same(one: Edit, other: Edit) -> bool:
    """Whether one says nothing that the other does not say."""
    measured = one.amount is not None and one.amount.exact and one.amount != other.amount
    return (one.kind, one.value, one.negated, one.degrees, one.count) == (
        other.kind,
        other.value,
        other.negated,
        other.degrees,
        other.count,
    ) and not measured


def clauses(text: str) -> list[str]:
    """Lower-case pieces of a sentence that are read by themselves."""
    return _clauses(_plain(text))


def _plain(text: str) -> str:
    plain = text.lower().replace("’", "'").replace("`", "'")
    plain = re.sub(r"[\"“”()\[\]]", " ", plain)
    plain = re.sub(r"\bgotta\b", "have to", re.sub(r"\bgonna\b", "going to", plain))
    plain = re.sub(r"\b(?:can't|couldn't|can|could|would|won't|why don't|will) you\b", "", plain)  # asked politely
    return in_figures(" ".join(plain.split()))


def _clauses(plain: str) -> list[str]:
    plain = re.sub(r"\b(instead of|rather than|but|so that)\b", r"; \1", plain)
    plain = re.sub(
        r"\b(?:and then|and|then|because|since|as)\b(?! (?:far|much|that|it is|it turns|the door))", ";", plain
    )
    pieces = re.split(r"[,;:!?\x00]|\.(?!\d)", plain)
    return [piece for piece in (" ".join(p.split()) for p in pieces) if piece]


def _read_whole(plain: str, vocabulary: Vocabulary, kind: str) -> tuple[list[Edit], str]:
    """What is said over several clauses, and the text with a mark in its place."""
    edits: list[Edit] = []
    for phrase in vocabulary.phrases:
        if not phrase.whole or (phrase.only and kind not in phrase.only):
            continue
        for pattern in phrase.patterns:
            match = pattern.search(plain)
            if match and match.group().strip():
                edit = _edit(phrase, match, False, vocabulary)
                edits += [] if any(edit.kind == other.kind for other in edits) else [edit]
                plain = plain[: match.start()] + "\x00" + plain[match.end() :]
    return edits, plain


def _read_clause(clause: str, vocabulary: Vocabulary, kind: str) -> tuple[list[Edit], str]:
    """Edits in the order of the words, and the clause with what was read blanked out."""
    rest = clause
    found: list[tuple[int, Phrase, re.Match[str]]] = []
    for phrase in vocabulary.phrases:
        if phrase.whole or (phrase.only and kind not in phrase.only):
            continue
        for pattern in phrase.patterns:
            while match := pattern.search(rest):
                if not match.group().strip():
                    break
                found.append((match.start(), phrase, match))
                rest = rest[: match.start()] + "\x00" * (match.end() - match.start()) + rest[match.end() :]
    rest = vocabulary.complaints.sub(lambda m: "\x00" * len(m.group()), rest)
    denial = vocabulary.negations.search(rest)
    edits = []
    for start, phrase, match in sorted(found, key=lambda item: item[0]):
        edits.append(_edit(phrase, match, denial is not None and denial.start() < start, vocabulary))
    rest = vocabulary.negations.sub(" ", rest)
    return edits, rest.replace("\x00", " ")


def _edit(phrase: Phrase, match: re.Match[str], negated: bool, vocabulary: Vocabulary) -> Edit:
    words = match.group()
    spelled = (match.groupdict().get("value") or "").strip()
    value = phrase.values.get(spelled) or vocabulary.values.get(spelled, spelled) or phrase.value
    if phrase.flip:
        value = vocabulary.opposites.get(value, value)
    if negated and phrase.flip:
        negated = False  # "not too far to the left" is still about a fault
    kind = phrase.edit
    if negated and phrase.opposite:
        phrase = next((p for p in vocabulary.phrases if p.edit == phrase.opposite), phrase)
        kind, negated = phrase.edit, False
    return Edit(
        kind=kind,
        value=value,
        amount=vocabulary.amount(words),
        degrees=vocabulary.angle(words),
        seconds=vocabulary.seconds(words),
        count=vocabulary.count(words),
        negated=negated,
        said=words,
        phrase=phrase,
    )


def _plain_word(word: str, vocabulary: Vocabulary, nouns: set[str]) -> bool:
    bare = word.removesuffix("'s").strip("'")
    return (
        bare in vocabulary.fillers
        or word in vocabulary.fillers
        or bare in nouns
        or (bare.endswith("s") and bare[:-1] in nouns | vocabulary.fillers)
        or bare in vocabulary.numbers
        or bare.isdigit()
        or bare in _UNITS
    )
