"""From everyday sentences to edits, and the words that could not be made sense of."""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_llm.offline.vocabulary import Amount, Phrase, Vocabulary


@attrs.frozen
class Edit:
    """One thing to do differently. ``kind`` is a heading of the vocabulary's phrases."""

    kind: str
    value: str = ""  # looked up in the vocabulary's values
    amount: Amount | None = None
    degrees: float | None = None
    count: int = 1
    negated: bool = False  # only where the phrase has no opposite
    said: str = attrs.field(default="", eq=False)  # the words it was read from
    phrase: Phrase | None = attrs.field(default=None, eq=False, repr=False)


@attrs.frozen
class Reading:
    """What was understood of one sentence, in the order it was said, and what was not."""

    edits: tuple[Edit, ...]
    not_understood: tuple[str, ...]  # words, or a whole clause where nothing of it was understood


def read_sentence(text: str, vocabulary: Vocabulary, known: Iterable[str] = ()) -> Reading:
    """``known`` are words that name something in the scene."""
    nouns = {word for name in known for word in re.findall(r"[\w'-]+", name.lower())}
    edits: list[Edit] = []
    missed: list[str] = []
    for clause in clauses(text):
        found, rest = _read_clause(clause, vocabulary)
        found = [edit for edit in found if edit.kind != "nothing" and edit not in edits]
        unknown = [w for w in re.findall(r"[^\W_][\w'-]*", rest) if not _plain_word(w, vocabulary, nouns)]
        edits += found
        if unknown and not found:
            missed.append(clause)
        else:
            missed += unknown
    if not edits:
        missed = [" ".join(text.split())]
    return Reading(tuple(edits), tuple(missed))


def clauses(text: str) -> list[str]:
    """Lower-case pieces of a sentence that are read by themselves."""
    plain = text.lower().replace("’", "'").replace("`", "'")
    plain = re.sub(r"[\"“”()\[\]]", " ", plain)
    plain = re.sub(r"\b(instead of|rather than|but|so that)\b", r"; \1", plain)
    plain = re.sub(
        r"\b(?:and then|and|then|because|since|as)\b(?! (?:far|much|that|it is|it turns|the door))", ";", plain
    )
    pieces = re.split(r"[,;:!?]|\.(?!\d)", plain)
    return [piece for piece in (" ".join(p.split()) for p in pieces) if piece]


def _read_clause(clause: str, vocabulary: Vocabulary) -> tuple[list[Edit], str]:
    """Edits in the order of the words, and the clause with what was read blanked out."""
    rest = clause
    found: list[tuple[int, Phrase, re.Match[str]]] = []
    for phrase in vocabulary.phrases:
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
    spelled = match.groupdict().get("value") or ""
    kind = phrase.edit
    if negated and phrase.opposite:
        phrase = next((p for p in vocabulary.phrases if p.edit == phrase.opposite), phrase)
        kind, negated = phrase.edit, False
    return Edit(
        kind=kind,
        value=vocabulary.values.get(spelled, spelled),
        amount=vocabulary.amount(words),
        degrees=vocabulary.angle(words),
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
    )
