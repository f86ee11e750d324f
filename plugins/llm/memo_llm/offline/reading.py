"""From everyday sentences to edits, and the words that could not be made sense of."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import attrs

from memo_llm.offline.clauses import Mood, is_needless, is_request, mood_of
from memo_llm.offline.composed import composed_edits, only_when, preferred
from memo_llm.offline.coverage import Context
from memo_llm.offline.degrees import REFUSED
from memo_llm.offline.doubts import ReadClause, is_beyond, is_doubtful
from memo_llm.offline.edits import GENTLE, Edit, Reading
from memo_llm.offline.phrases import is_measured, read_clause, read_whole
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.typos import in_full
from memo_llm.offline.vocabulary import Amount, Vocabulary

_AFTER_SO = "you|it|the|we|please|just|go|be|do|try|hold|push|pull|move|open|lower|lift|take|turn|grab|make|keep|put"
# What telling of it does not ask for: "you approached it from the left".
ORDERS = frozenset(
    [
        "way",
        "approach",
        "hold-at",
        "repeat",
        "turn-hand",
        "turn-thing",
        "look",
        "back-off",
        "open-first",
        "close-first",
        "back-off-before",
        "tilt",
    ]
)
_COMPARED = re.compile(
    r"(?!you\b)(?:(?:the|that|this|my|your|its) )?\w+(?:'s| is| are| was| were) (?:more \w+|\w+er)\b"
)
# How one knows that it is done.
_SIGN = re.compile(
    r"(?:you(?:'ve| have| should| need| want| must| ought|'ll)?|i)(?: \w+){0,2} (?:hear|see|feel) [\w' ]+"
)
_GOES_ON = re.compile(r"(?:then )?(?:go|come|move) (?:in|down|over|on)(?: there)?")
TOLD = re.compile(r"^(?:[a-z]+,? )?(?:you|i|we|your|because|since|otherwise|or|when|that's why)\b|\bwhen you\b")


def read_sentence(
    text: str,
    vocabulary: Vocabulary,
    known: Iterable[str] = (),
    kind: str = "",
    others: Iterable[str] = (),
    asked: bool = False,
) -> Reading:
    """``known`` are words that name what the subtask is about or something in the scene, ``others`` those of them that
    the subtask is not about; ``kind`` is the kind of subtask that was spoken of (see ``memo_llm.offline.recipe``), ""
    where that is not known; ``asked``: whether a sentence before it was read as a request."""
    elsewhere = _words(others)
    context = Context(vocabulary, kind, _words(known) - elsewhere, elsewhere)
    edits: list[Edit] = []
    missed: list[str] = []
    unsure: list[str] = []
    found, plain = read_whole(_plain(text, vocabulary, context.nouns), vocabulary, kind)
    edits += found
    request, praised = True, False
    when = ""
    for words, beside in _parted(plain):
        if not beside and only_when(words, context):
            when = f"{when} {words}"
            continue
        if when and not beside:
            words, when = f"{words}{when}", ""
        mood = mood_of(words, is_request(words, request), asked or bool(edits))
        request = mood == "request"
        if edits and (amount := _amount_alone(words, vocabulary)) and not is_measured(edits[-1]):
            edits[-1] = attrs.evolve(edits[-1], amount=amount)
            continue
        found, left = read_clause(words, vocabulary, kind, context.nouns)
        if mood == "request" and not found and (is_needless(words) or _SIGN.fullmatch(words)):
            mood, request = "told", False
        if not found and kind in ("pick", "place") and _GOES_ON.fullmatch(words):
            continue  # "... and then go in": what it does anyway
        said = [edit for edit in found if edit.kind not in ("nothing", REFUSED) and _asks(edit, mood, words, context)]
        praised |= not said and vocabulary.praises(words)
        clause = ReadClause(words, mood, beside, bool(found), said, _with(edits, said), left, context)
        doubtful = is_doubtful(clause)
        if not (beside or is_beyond(clause)):
            composed = composed_edits(words, mood, context)
            if composed is not None and preferred(composed, said, doubtful):
                edits = _with(edits, composed)
                continue
        edits = list(clause.edits)
        missed += [words] if clause.unknown and not said else clause.unknown
        unsure += [words] if doubtful else []
    ways = {(edit.kind, edit.value) for edit in edits if edit.kind in ("offset", "way")}
    rising = {
        edit.value in GENTLE or edit.value.startswith("slow") for edit in edits if edit.kind in ("force", "speed")
    }
    if len(rising) > 1 and re.search(r"\bthen\b", plain):
        unsure.append(plain)  # first so, then so
    if len(ways) > 1 and re.search(r"\b(?:then|before|after)\b", plain):
        unsure.append(plain)  # one after the other, which is no place
    if not edits:
        missed = [" ".join(text.split())]
    return Reading(tuple(edits), tuple(missed), praised, tuple(unsure))


def _with(edits: Sequence[Edit], more: Sequence[Edit]) -> list[Edit]:
    """Edits, and those of others that say something that they do not say."""
    found = list(edits)
    for edit in more:
        found += [] if any(_same(edit, other) for other in found) else [edit]
    return found


def _words(names: Iterable[str]) -> frozenset[str]:
    return frozenset(word for name in names for word in re.findall(r"[\w'-]+", name.lower()))


def _only_told(edit: Edit, clause: str) -> bool:
    """Whether it names what the hand did, which nobody asks for by saying so."""
    faulted = edit.phrase is not None and edit.phrase.told
    return edit.kind in ORDERS and not faulted and TOLD.search(clause) is not None


def _asks(edit: Edit, mood: Mood, clause: str, context: Context) -> bool:
    """Whether an edit's words, said in such a clause, ask for it."""
    if mood == "request":
        return True
    if re.match(r"(?:i|we) (?:didn't|did not|don't|never) (?:want|mean|ask|say)\b", clause):
        return False
    if edit.phrase is not None and edit.phrase.lesson and mood != "hypothesis":
        return True  # how a thing moves is a reason to move it so
    if mood in ("contrast", "hypothesis", "question"):
        return False
    if edit.kind == "all-the-way" and re.fullmatch(r"completely|fully", edit.said.strip()):
        return False  # "you missed it completely"
    if edit.kind in ("force", "speed") and _COMPARED.match(clause):
        return False  # "he is stronger than my grandpa"
    if edit.degree and re.search(r"\w+er$", edit.said.strip()) and re.match(r"you(?:'re| are| were) \w+ing\b", clause):
        return False  # "you're screwing it tighter"
    if mood == "told" and re.search(r"\b(?:if|when) (?:i|we)\b", clause):
        return False  # "it leaks if I tip it"
    if edit.degrees is not None and re.search(r"\b(?:not|n't) enough\b", clause):
        return False  # "one turn isn't enough"
    if edit.kind == "speed" and edit.said.strip().startswith("like ") and not re.match(r"(?:and )?you\b", clause):
        return False  # "it wobbles like crazy"
    flipped = edit.phrase is not None and edit.phrase.flip
    if (
        edit.kind == "offset"
        and edit.amount is not None
        and not flipped
        and re.match(r"(?:it|the \w+)(?:'s| is)\b", clause)
    ):
        return context.kind not in ("place", "pour", "")  # "it's 2 cm lower": where the hand should have been
    faulted = edit.degree or (edit.phrase is not None and (edit.phrase.told or edit.phrase.flip or edit.phrase.value))
    return bool(faulted or context.vocabulary.complaint(clause)) and not _only_told(edit, clause)


def _amount_alone(clause: str, vocabulary: Vocabulary) -> Amount | None:
    """The length that is all a clause says: "about 6 cm"."""
    about = r"(?:(?:by|about|around|roughly|maybe|say|just|some|at least|like|i think|i guess) )*"
    if not re.fullmatch(
        rf"{about}[\d.]+ (?:cm|mm|inch|m)(?: or so| i think| maybe| only| please| away| apart)?", clause
    ):
        return None
    return vocabulary.amount(clause)


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


def _plain(text: str, vocabulary: Vocabulary | None = None, nouns: Iterable[str] = ()) -> str:
    plain = text.lower().replace("’", "'").replace("`", "'")
    plain = plain.replace("'ve gotta", "'ve got to")
    if vocabulary is not None:
        plain = in_full(plain, vocabulary.spelled | set(nouns))
    plain = re.sub(r"[\"“”()\[\]]", " ", plain)
    plain = re.sub(r"([a-z])\1{2,}", r"\1", plain)  # "sooo slow"
    plain = re.sub(r"\bnice and (?=\w)|\bgood (?:spot|start)\b", "", plain)
    plain = re.sub(r"\b(?:(?:the|that|this|my) )?poor (?:\w+ )?(?:\w+)(?=[.!,])", " ", plain)
    side = r"(?:on|to) (?:the|its) (left|right)(?:[- ]hand)?(?: side)?"
    plain = re.sub(
        rf"\b(?:next to|beside) ((?:the|my|your|that) [a-z]+),? {side}\b",
        r"to the \2 of \1",
        plain,
    )
    plain = re.sub(r"\brighty[- ]tighty,? (?:and )?lefty[- ]loosey\b", " ", plain)  # a rhyme, and no request
    plain = plain.replace("gotta", "have to").replace("gonna", "going to")
    plain = re.sub(
        r"\b(?:(?:can't|couldn't|can|could|would|won't|will) you|why (?:don't|not)(?: you)?)\b", "", plain
    )  # asked politely
    plain = in_figures(" ".join(plain.split()))
    plain = re.sub(r"\b([\d.]+) more (cm|mm|inch|m|degrees)\b", r"\1 \2 more", plain)
    plain = re.sub(  # which way a door swings is to be seen
        r"\b(in an? (?:\w+ )?(?:curve|arc)),? (?:a?round |out )?(?:to|towards?) (?:the|your) (?:left|right|side)\b",
        r"\1",
        plain,
    )
    if vocabulary is not None:
        plain = vocabulary.lexicon.as_request(plain)
    return re.sub(r"\b(?:maybe|roughly|like|say|approximately|perhaps|i'd say|something like) (?=\d)", "", plain)


def _clauses(plain: str) -> list[str]:
    return [clause for clause, _ in _parted(plain)]


def _parted(plain: str) -> list[tuple[str, bool]]:
    """Clauses, each with whether it is what is left beside something that was read already."""
    plain = re.sub(r"\b(instead of|rather than|but|so that)\b", r"; \1", plain)
    plain = re.sub(
        r"\b(because|since|otherwise|or else|or(?= (?:you|it|the|they|your|i|we|nothing|everything)\b))", r"; \1", plain
    )
    plain = re.sub(r"\bexcept (?:that|for)\b", "; but", plain)
    plain = re.sub(r"\bas (\w+) as you (like|want|please|wish)\b", r"as \1 as-you-\2", plain)
    plain = re.sub(r"\bup and over\b", "up over", plain)
    plain = re.sub(r"\b(too|so) (\w+) and (\1) (\w+)", r"\1 \2; \3 \4", plain)
    plain = re.sub(
        r"\bso(?= (?:it|they|that|nothing|the \w+) (?:does|do|will|can|is|are|wo|ca)(?:n't| not)\b)", "; so that", plain
    )
    plain = re.sub(rf"\bso(?= (?!that\b)(?:{_AFTER_SO})\b)", ";", plain)
    plain = re.sub(r"\b(?:and then|and|then)\b(?! (?:far|much|that(?!'s)))", ";", plain)
    plain = re.sub(r"(?<!soon )(?<!far )(?<!much )\bas(?= (?:you|they|i|we|there|your)\b)", ";", plain)
    found = []
    for piece in re.split(r"[,;:!?—–…]| -+ |\.(?!\d)", plain):
        beside = "\x00" in piece
        found += [(words, beside) for part in piece.split("\x00") if (words := " ".join(part.split()))]
    return found
