"""From everyday sentences to edits, and the words that could not be made sense of."""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_llm.offline.clauses import (
    Mood,
    core,
    ends_when,
    has_condition,
    in_parts,
    is_act,
    is_needless,
    is_own_act,
    is_request,
    mood_of,
    split_words,
    unread,
)
from memo_llm.offline.composed import composed_edits, only_when, preferred
from memo_llm.offline.coverage import unaccounted
from memo_llm.offline.degrees import REFUSED
from memo_llm.offline.edits import GENTLE, Edit, Reading
from memo_llm.offline.phrases import is_measured, read_clause, read_whole
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.typos import in_full
from memo_llm.offline.vocabulary import Amount, Vocabulary

_UNITS = {"cm", "mm", "inch", "m", "degrees", "seconds", "newton"}
_AFTER_SO = "you|it|the|we|please|just|go|be|do|try|hold|push|pull|move|open|lower|lift|take|turn|grab|make|keep|put"
# Fillers that say which, when or whether, where nothing else was read.
_MATTERS = split_words(
    "in out up down off on away over back under only not no other another first more less about what here there finger "
    "fingers"
)
# Edits that say themselves how long something goes on.
_ENDS = frozenset(["hold-for", "set-down", "extent", "all-the-way", "first-in", "hold-on", "less-far"])
# An amount that is told and bounds what is to be done: "an inch is enough".
_BOUNDED = (
    r"\d (?:cm|mm|inch|m|degrees|seconds)\b.*\b(?:plenty|enough|all|do)\b|\b(?:at (?:least|most)|no more than) \d"
)
_SIDES = frozenset(["left", "right", "front", "back", "top", "bottom", "upper", "lower"])
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
# Where it was, unless it is to be moved there.
_OFF = re.compile(
    r"^(?!.*\b(?:mov|shift|slid|nudg|scoot|go|com|put|plac|set|aim)\w*\b).*\boff to (?:the|your) (?:left|right)\b"
)
# How one knows that it is done.
_SIGN = re.compile(
    r"(?:you(?:'ve| have| should| need| want| must| ought|'ll)?|i)(?: \w+){0,2} (?:hear|see|feel) [\w' ]+"
)
_BEYOND = re.compile(r"\b(?:right|other|wrong) way up\b|\b(?:other|both) hands?\b")  # no edit says that
_GOES_ON = re.compile(r"(?:then )?(?:go|come|move) (?:in|down|over|on)(?: there)?")
_OWN = re.compile(r"\b(?:you|yourself|robot|base|front)\b")
# Where something was, told as a fault.
_FAULT = re.compile(
    r"\btoo (?:far|high|low|long|short|close|near|deep|wide)\b|\boff (?:to the|by)\b|"
    r"\bby (?:about )?[\d.]+ (?:cm|mm|inch)\b"
)
# Nearer to or further from what is neither the robot nor named.
_TOWARDS = re.compile(
    r"\b(?:closer|nearer|further|farther|away)(?: in| out| over)? (?:to|towards?|from) "
    r"(?:me\b|us\b|(?:the|its|that|this|my) (?!robot\b|base\b|front\b))"
)
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
    nouns = _words(known)
    other_things = _words(others)
    own = nouns - other_things
    edits: list[Edit] = []
    missed: list[str] = []
    unsure: list[str] = []
    found, plain = read_whole(_plain(text, vocabulary, nouns), vocabulary, kind)
    edits += found
    request, praised = True, False
    when = ""
    for clause, part in _parted(plain):
        if not part and only_when(clause, vocabulary, own, other_things):
            when = f"{when} {clause}"
            continue
        if when and not part:
            clause, when = f"{clause}{when}", ""
        mood = mood_of(clause, is_request(clause, request), asked or bool(edits))
        request = mood == "request"
        if edits and (amount := _amount_alone(clause, vocabulary)) and not is_measured(edits[-1]):
            edits[-1] = attrs.evolve(edits[-1], amount=amount)
            continue
        found, rest = read_clause(clause, vocabulary, kind, nouns)
        if mood == "request" and not found and (is_needless(clause) or _SIGN.fullmatch(clause)):
            mood, request = "told", False
        if not found and kind in ("pick", "place") and _GOES_ON.fullmatch(clause):
            continue  # "... and then go in": what it does anyway
        complains = vocabulary.complaint(clause)
        said = [
            edit
            for edit in found
            if edit.kind not in ("nothing", REFUSED) and _asks(edit, mood, clause, complains, kind)
        ]
        plain_rest = rest
        rest = core(rest, own, other_things)
        rest = _of_the_thing(rest, kind, other_things)
        unknown = [
            w for w in re.findall(r"[^\W_][\w'-]*", rest) if not (_plain_word(w, vocabulary, nouns) or is_act(w))
        ]
        praised |= not said and vocabulary.praises(clause)
        before = list(edits)
        for edit in said:
            edits += [] if any(_same(edit, other) for other in edits) else [edit]
        denied = vocabulary.negations.search(clause) is not None and not said
        contrasted = (
            denied and re.search(r"^(?:never|not|no),? (?:by|at|on|from|around|with|near|in)\b", clause) is not None
        )
        said_of = {word for edit in edits for word in re.findall(r"[a-z]+", edit.said)}  # "the stem, always the stem"
        beside = set() if part else other_things  # what stands beside what was read already may name anything
        open_words = unread(rest, kind, [edit.kind for edit in said], beside) if request and not denied else []
        doubtful = (mood in ("request", "told") and has_condition(rest)) or bool(open_words)
        doubtful |= (
            request
            and not contrasted
            and bool(unknown[part:] or not (found or part or _adds_nothing(rest, kind, vocabulary, nouns | said_of)))
        )
        placed = mood == "told" and any(edit.kind == "offset" for edit in said)
        if (request and not denied) or placed:
            doubtful |= not (part and re.fullmatch(r"(?:the|that|this|its) \w+", clause)) and bool(
                unaccounted(
                    clause,
                    _of_the_thing(plain_rest, kind, other_things) if said else plain_rest,
                    {edit.kind for edit in (edits if part else said)},
                    {edit.kind for edit in edits},
                    kind,
                    vocabulary.lexicon,
                    own,
                    other_things,
                    vocabulary.small_talk,
                )
            )
        beyond = _BEYOND.search(clause) is not None
        doubtful |= _clash(said, clause) or in_parts(clause) or beyond
        doubtful |= _relative_to_something(said, clause, other_things)
        doubtful |= request and not said and (_forbids(clause, rest, vocabulary, nouns, kind) or _insists(rest, kind))
        doubtful |= ends_when(clause) is not None and not any(edit.kind in _ENDS for edit in said)
        doubtful |= mood == "told" and re.search(_BOUNDED, rest) is not None
        faulty = _FAULT.search(clause) is not None or vocabulary.lexicon.begins_with_wish(clause)
        doubtful |= mood == "told" and not said and faulty  # told, and yet something is to be different
        if not (part or beyond):
            composed = composed_edits(clause, mood, vocabulary, kind, own, other_things)
            if composed is not None and preferred(composed, said, doubtful):
                edits = [*before, *(edit for edit in composed if not any(_same(edit, other) for other in before))]
                continue
        if unknown and not said:
            missed.append(clause)
        else:
            missed += unknown
        if doubtful:
            unsure.append(clause)
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


def _of_the_thing(rest: str, kind: str, others: set[str]) -> str:
    """A clause's remainder without another name for what is in the hand: "hold the carton" of the milk."""
    if kind not in ("pick", "place", ""):
        return rest
    verbs = "hold|carry|take|grab|grip|grasp|lift|pick up|put|set|lay|lower" if kind else "get|hold|keep|move|bring"
    named = re.compile(
        rf"\b({verbs})(ing)? (?:the|that|this|my|your) (\w+)(?= (?:\W|down|up|in|at|by|on|around|$)|$|  )"
    )
    rest = named.sub(lambda m: m.group() if m.group(3) in others else f"{m.group(1)}{m.group(2) or ''} it", rest)
    with_it = re.fullmatch(r"(?:\s|be\b|please\b|more\b|really\b)*with (?:the|those|that|this|these) (\w+)", rest)
    return rest if with_it is None or with_it.group(1) in others else ""  # "be gentler with the fruit"


def _words(names: Iterable[str]) -> set[str]:
    return {word for name in names for word in re.findall(r"[\w'-]+", name.lower())}


def _only_told(edit: Edit, clause: str) -> bool:
    """Whether it names what the hand did, which nobody asks for by saying so."""
    faulted = edit.phrase is not None and edit.phrase.told
    return edit.kind in ORDERS and not faulted and TOLD.search(clause) is not None


def _asks(edit: Edit, mood: Mood, clause: str, complains: bool, kind: str) -> bool:
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
        return kind not in ("place", "pour", "")  # "it's 2 cm lower": where the hand should have been
    faulted = edit.degree or (edit.phrase is not None and (edit.phrase.told or edit.phrase.flip or edit.phrase.value))
    return bool(faulted or complains) and not _only_told(edit, clause)


def _adds_nothing(rest: str, kind: str, vocabulary: Vocabulary, nouns: set[str]) -> bool:
    """Whether the words of a clause in which nothing was read do not ask for anything either: small talk, or no more
    than what the subtask does anyway ("and then take it")."""
    words = re.findall(r"[a-z][a-z'-]*|\d+", rest)
    empty = vocabulary.small_talk | vocabulary.fillers - _MATTERS
    return all(
        word in vocabulary.small_talk
        or word in empty
        or word.removesuffix("s") in nouns
        or word in nouns
        or is_own_act(word, kind)
        for word in words
    )


def _clash(edits: list[Edit], clause: str) -> bool:
    """Whether what was read in one clause cannot be all that it means."""
    kinds = {edit.kind for edit in edits}
    of_fingers = re.search(
        r"\b(?:open|clos|spread|shut)\w*(?: up)? (?:the |your |its )?(?:hand|gripper|fingers|jaws)\b", clause
    )
    of_doors = re.search(r"\b(?:door|lid|flap|panel)s?\b", clause) is not None
    return (
        (of_doors and "finger-width" in kinds)
        or ("offset" in kinds and bool(kinds & {"arc", "pivot"}))
        or {"speed", "release"} <= kinds
        or {"fingers", "release"} <= kinds
        or len({edit.value for edit in edits if edit.kind == "offset"}) > 1
        or (of_fingers is not None and "all-the-way" in kinds)
        or len({edit.value for edit in edits if edit.kind == "way"}) > 1
    )


def _beside_another(clause: str, others: set[str]) -> bool:
    """Whether a way is one from or to another thing: "further away from the tray", "from the right box"."""
    named = "|".join(map(re.escape, sorted(others - _SIDES))) or "(?!)"
    sides = "|".join(sorted(others & _SIDES)) or "(?!)"  # of several alike, the one on that side
    the = r"\b(?:from|to|than) (?:the|that|my|your|a) (?:\w+ )?"
    return re.search(rf"{the}(?:(?:{named})\b|(?:{sides}) (?!side|hand|and|or|but|of)\w)", clause) is not None


def _flipped(edit: Edit) -> bool:
    return edit.phrase is not None and edit.phrase.flip


def _relative_to_something(said: list[Edit], clause: str, others: set[str]) -> bool:
    """Whether a way is one from or to what is neither the robot nor known: another thing, a part, the person, or
    "closer", and it is not said to what."""
    if any(edit.kind in ("offset", "approach") for edit in said) and _beside_another(clause, others):
        return True
    if any(edit.value in ("left", "right") and _OFF.search(clause) for edit in said if not _flipped(edit)):
        return True
    along = [edit for edit in said if edit.value in ("away", "towards")]
    if along and _TOWARDS.search(clause):
        return True
    return any(
        edit.value == "towards" and re.search(r"\b(?:closer|nearer)\b", edit.said) and not _OWN.search(edit.said)
        for edit in along
    )


def _forbids(clause: str, rest: str, vocabulary: Vocabulary, nouns: set[str], kind: str) -> bool:
    """Whether a clause says what not to do, and it is not known what follows from that."""
    denial = vocabulary.negations.search(clause)
    if denial is None or re.match(r"(?:not|never|instead|rather|no need|without)\b", clause[denial.start() :]):
        return False
    return not _adds_nothing(rest, "", vocabulary, nouns)


def _insists(rest: str, kind: str) -> bool:
    """Whether a clause in which nothing was read names a state of things that has to be seen to."""
    return re.search(r"\b(?:make sure|ensure|check|be sure|take care|mind that)\b", rest) is not None


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
