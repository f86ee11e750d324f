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
    is_own_act,
    is_request,
    mood_of,
    split_words,
    time_part,
    unread,
)
from memo_llm.offline.composition import TIMES
from memo_llm.offline.degrees import REFUSED, Degree
from memo_llm.offline.meaning import Meant, meaning
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.typos import in_full
from memo_llm.offline.vocabulary import Amount, Phrase, Vocabulary

_UNITS = {"cm", "mm", "inch", "m", "degrees", "seconds", "newton"}
_SUBORDINATOR = (
    r"\b(?:only )?(?:unless|if|when|once|until|after)(?: you| it)* ?\x00"
    r"|\b(?:if|when) it (?:sticks|jams|gets stuck|is stuck|catches|hangs)[,]? ?(?:then )?\x00"
)
_AFTER_SO = "you|it|the|we|please|just|go|be|do|try|hold|push|pull|move|open|lower|lift|take|turn|grab|make|keep|put"
_CARRIED_BY_WAY = ("offset", "farther", "less-far", "all-the-way", "angle")
_BARE = r"(?:push|press|shove|lift|raise)(?: [\w' ]+?)??(?: (?:it|them|this|that))?"
# Fillers that say which, when or whether, where nothing else was read.
_MATTERS = split_words(
    "in out up down off on away over back under only not no other another first more less about what here there finger "
    "fingers"
)
_DETERMINERS = split_words("a an the my your his her our their this that each every kitchen in")
_NOUNS_TOO = split_words("sink dip press push pull lift rest slide drop tip shake stretch reach draw")
# Edits that say themselves how long something goes on.
_ENDS = frozenset(["hold-for", "set-down", "extent", "all-the-way", "first-in", "hold-on", "less-far"])
# An amount that is told and bounds what is to be done: "an inch is enough".
_BOUNDED = (
    r"\d (?:cm|mm|inch|m|degrees|seconds)\b.*\b(?:plenty|enough|all|do)\b|\b(?:at (?:least|most)|no more than) \d"
)
_SIDES = frozenset(["left", "right", "front", "back", "top", "bottom", "upper", "lower"])
_SIDED = ("force", "speed")
# What only a composition of parts says.
_COMPOSED_ONLY = frozenset(["travel", "retreat", "slow-end", "ease-open", "pose", "set-down", "finger-width", "beside"])
_FINGERS = r"\b(?:fingers|gripper|jaws|hand)\b"
_OPENS_FINGERS = r"\b(?:open|spread)\w*(?: up)? (?:the |your |its )?(?:hand|gripper|fingers|jaws)\b"
_MOTIONS = {
    "pick": "approach|mov|com|reach",
    "push": "approach|mov|com|reach",
    "place": "approach|mov|com|reach|put|set|lay|plac|lower",
}
_GRIPS = r"\b(?:grip|grab|grasp|hold|squeeze|take|pick|fingers|force|press)\w*\b"
_GRIPS_ALONE = r"\b(?:grip|grab|grasp|hold|squeeze|take|fingers|pinch)\w*\b"
_FORCEFUL = {
    "pull": "pull|tug|yank|heave",
    "push": "push|shov|nudg|lean",
    "press": "press|wip|rub|scrub",
    "turn": "turn|twist|rotat|screw|unscrew",
}
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
TOLD = re.compile(r"^(?:[a-z]+,? )?(?:you|i|we|your|because|since|otherwise|or|when|that's why)\b|\bwhen you\b")


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


def read_sentence(
    text: str, vocabulary: Vocabulary, known: Iterable[str] = (), kind: str = "", others: Iterable[str] = ()
) -> Reading:
    """``known`` are words that name what the subtask is about or something in the scene, ``others`` those of them that
    the subtask is not about; ``kind`` is the kind of subtask that was spoken of (see ``memo_llm.offline.recipe``), ""
    where that is not known."""
    nouns = _words(known)
    other_things = _words(others)
    edits: list[Edit] = []
    missed: list[str] = []
    unsure: list[str] = []
    found, plain = _read_whole(_plain(text, vocabulary, nouns), vocabulary, kind)
    edits += found
    request, praised = True, False
    when = ""
    for clause, part in _parted(plain):
        if not part and _only_when(clause, vocabulary, nouns - other_things, other_things):
            when = f"{when} {clause}"
            continue
        if when and not part:
            clause, when = f"{clause}{when}", ""
        mood = mood_of(clause, is_request(clause, request), bool(edits))
        request = mood == "request"
        if edits and (amount := _amount_alone(clause, vocabulary)) and not _measured(edits[-1]):
            edits[-1] = attrs.evolve(edits[-1], amount=amount)
            continue
        found, rest = _read_clause(clause, vocabulary, kind, nouns)
        complains = vocabulary.complaint(clause)
        said = [
            edit
            for edit in found
            if edit.kind not in ("nothing", REFUSED) and _asks(edit, mood, clause, complains, kind)
        ]
        rest = core(rest, nouns - other_things, other_things)
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
        doubtful |= _clash(said, clause) or in_parts(clause)
        doubtful |= any(edit.kind in ("offset", "approach") for edit in said) and _beside_another(clause, other_things)
        doubtful |= request and not said and (_forbids(clause, rest, vocabulary, nouns, kind) or _insists(rest, kind))
        doubtful |= ends_when(clause) is not None and not any(edit.kind in _ENDS for edit in said)
        doubtful |= mood == "told" and re.search(_BOUNDED, rest) is not None
        if not part:
            composed = _composed(clause, mood, vocabulary, kind, nouns - other_things, other_things)
            if composed is not None and _preferred(composed, said, doubtful):
                edits = [*before, *(edit for edit in composed if not any(_same(edit, other) for other in before))]
                continue
        if unknown and not said:
            missed.append(clause)
        else:
            missed += unknown
        if doubtful:
            unsure.append(clause)
    ways = {(edit.kind, edit.value) for edit in edits if edit.kind in ("offset", "way")}
    if len(ways) > 1 and re.search(r"\b(?:then|before|after)\b", plain):
        unsure.append(plain)  # one after the other, which is no place
    if not edits:
        missed = [" ".join(text.split())]
    return Reading(tuple(edits), tuple(missed), praised, tuple(unsure))


def _composed(
    clause: str, mood: Mood, vocabulary: Vocabulary, kind: str, own: set[str], others: set[str]
) -> list[Edit] | None:
    """Edits of a clause that is made up of known parts throughout; None where it is not, or where they mean nothing."""
    if mood not in ("request", "told"):
        return None
    parts = vocabulary.lexicon.parts(
        re.sub(r"^so (?=\w+ (?:it|the|your|that|up|down)\b)", "", clause), frozenset(own), frozenset(others)
    )
    if not parts:
        return None
    meant = meaning(parts, kind)
    if meant is not None and "lever" in own and any(one.kind == "turn-thing" for one in meant):
        return None  # which way a lever's end goes is not which way round it is turned
    normal = kind == "place" and any(part.said in ("goes", "go", "belongs", "belong", "should go") for part in parts)
    if normal and meant is not None and [one.kind for one in meant] == ["beside"]:
        return [_as_edit(one, clause, vocabulary, kind) for one in meant]  # "forks go to the left of the plate"
    tells = any(part.kind in ("verb", "thing", "pronoun", "be", "other", "not") for part in parts)
    if meant is None or (mood == "told" and tells and not any(part.kind in ("too", "enough") for part in parts)):
        return None
    return [_as_edit(one, clause, vocabulary, kind) for one in meant]


def _only_when(clause: str, vocabulary: Vocabulary, own: set[str], others: set[str]) -> bool:
    """Whether a clause only says when what follows it is to be done: "when you have let go"."""
    if time_part(clause) != 0:
        return False
    parts = vocabulary.lexicon.parts(clause, frozenset(own), frozenset(others))
    return bool(parts) and all(part.kind in TIMES for part in parts or ())


def _preferred(composed: list[Edit], said: list[Edit], doubtful: bool) -> bool:
    """Whether a clause's reading as a composition of parts stands in place of what its phrases say."""
    if not said:
        return True
    if not composed:  # it asks for nothing: in place of what nothing would follow from
        return all(edit.negated or (edit.kind == "tilt" and not edit.value and edit.degrees is None) for edit in said)
    if doubtful or any(edit.kind in _COMPOSED_ONLY for edit in composed):
        return True
    kinds, phrased = {edit.kind for edit in composed}, {edit.kind for edit in said}
    if phrased == {"farther"} and "offset" in kinds:
        return True  # "lower it 2 cm": which way is said, too
    if phrased == {"offset"} and kinds <= {"farther", "all-the-way"}:
        return True  # "down until it goes no further"
    if kinds == phrased == {"offset"} and {edit.value for edit in composed} != {edit.value for edit in said}:
        return True  # "you went down too far"
    return kinds < phrased or (
        kinds == phrased and any(_senses(composed, kind) != _senses(said, kind) for kind in _SIDED)
    )


def _senses(edits: list[Edit], kind: str) -> set[bool]:
    """Which ends of a scale the edits of a kind ask for: gentle or slow is the low one."""
    return {edit.value in GENTLE or edit.value.startswith("slow") for edit in edits if edit.kind == kind}


def _as_edit(one: Meant, clause: str, vocabulary: Vocabulary, kind: str) -> Edit:
    phrases = [p for p in vocabulary.phrases if p.edit == one.kind and p.value in ("", one.value) and not p.flip]
    phrase = next((p for p in phrases if kind in p.only), None) or next((p for p in phrases if not p.only), None)
    return Edit(
        one.kind,
        one.value,
        vocabulary.amount(one.amount),
        vocabulary.angle(one.amount) if one.amount else vocabulary.angle(one.value),
        vocabulary.seconds(one.amount),
        verb=one.verb,
        said=f"lift {clause}" if one.lifted else clause,
        phrase=phrase,
        degree=True,
    )


def _of_the_thing(rest: str, kind: str, others: set[str]) -> str:
    """A clause's remainder without another name for what is in the hand: "hold the carton" of the milk."""
    if kind not in ("pick", "place"):
        return rest
    verbs = "hold|carry|take|grab|grip|grasp|lift|pick up|put|set|lay|lower"
    named = re.compile(
        rf"\b({verbs})(ing)? (?:the|that|this|my|your) (\w+)(?= (?:\W|down|up|in|at|by|on|around|$)|$|  )"
    )
    return named.sub(lambda m: m.group() if m.group(3) in others else f"{m.group(1)}{m.group(2) or ''} it", rest)


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
    if edit.phrase is not None and edit.phrase.lesson:
        return True  # how a thing moves is a reason to move it so
    if mood in ("contrast", "hypothesis", "question"):
        return False
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
        or (of_fingers is not None and "all-the-way" in kinds)
        or len({edit.value for edit in edits if edit.kind == "way"}) > 1
    )


def _beside_another(clause: str, others: set[str]) -> bool:
    """Whether a way is one from or to another thing: "further away from the tray", "from the right box"."""
    named = "|".join(map(re.escape, sorted(others - _SIDES))) or "(?!)"
    sides = "|".join(sorted(others & _SIDES)) or "(?!)"  # of several alike, the one on that side
    the = r"\b(?:from|to|than) (?:the|that|my|your|a) (?:\w+ )?"
    return re.search(rf"{the}(?:(?:{named})\b|(?:{sides}) (?!side|hand|and|or|but|of)\w)", clause) is not None


def _forbids(clause: str, rest: str, vocabulary: Vocabulary, nouns: set[str], kind: str) -> bool:
    """Whether a clause says what not to do, and it is not known what follows from that."""
    denial = vocabulary.negations.search(clause)
    if denial is None or re.match(r"(?:not|never|instead|rather|no need|without)\b", clause[denial.start() :]):
        return False
    return not _adds_nothing(rest, "", vocabulary, nouns)


def _insists(rest: str, kind: str) -> bool:
    """Whether a clause in which nothing was read names a state of things that has to be seen to."""
    return re.search(r"\b(?:make sure|ensure|check|be sure|take care|mind that)\b", rest) is not None


def _bare_way(edit: Edit) -> bool:
    """Whether an offset was read from no more than a verb and a way, as in "come up"."""
    return edit.amount is None and re.search(r"\w+er\b|more|further|farther|\btoo\b", edit.said) is None


def _measured(edit: Edit) -> bool:
    return edit.kind not in ("offset", "farther", "less-far", "beside") or (
        edit.amount is not None and edit.amount.exact
    )


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
    if vocabulary is not None:
        plain = in_full(plain, vocabulary.spelled | set(nouns))
    plain = re.sub(r"[\"“”()\[\]]", " ", plain)
    side = r"(?:on|to) (?:the|its) (left|right)(?:[- ]hand)?(?: side)?"
    plain = re.sub(
        rf"\b(?:next to|beside) ((?:the|my|your|that) [a-z]+),? {side}\b",
        r"to the \2 of \1",
        plain,
    )
    plain = re.sub(r"\brighty[- ]tighty,? (?:and )?lefty[- ]loosey\b", " ", plain)  # a rhyme, and no request
    plain = re.sub(r"\bgotta\b", "have to", re.sub(r"\bgonna\b", "going to", plain))
    plain = re.sub(
        r"\b(?:(?:can't|couldn't|can|could|would|won't|will) you|why (?:don't|not)(?: you)?)\b", "", plain
    )  # asked politely
    plain = in_figures(" ".join(plain.split()))
    if vocabulary is not None:
        plain = vocabulary.lexicon.as_request(plain)
    return re.sub(r"\b(?:maybe|roughly|like|say|approximately|perhaps|i'd say|something like) (?=\d)", "", plain)


def _clauses(plain: str) -> list[str]:
    return [clause for clause, _ in _parted(plain)]


def _parted(plain: str) -> list[tuple[str, bool]]:
    """Clauses, each with whether it is what is left beside something that was read already."""
    plain = re.sub(r"\b(instead of|rather than|but|so that)\b", r"; \1", plain)
    plain = re.sub(r"\b(because|since|otherwise|or else|or(?= (?:you|it|the|they|your|i|we)\b))", r"; \1", plain)
    plain = re.sub(r"\bexcept (?:that|for)\b", "; but", plain)
    plain = re.sub(r"\bup and over\b", "up over", plain)
    plain = re.sub(r"\b(too|so) (\w+) and (\1) (\w+)", r"\1 \2; \3 \4", plain)
    plain = re.sub(rf"\bso(?= (?:{_AFTER_SO})\b)", ";", plain)
    plain = re.sub(r"\b(?:and then|and|then)\b(?! (?:far|much|that))", ";", plain)
    plain = re.sub(r"(?<!soon )(?<!far )(?<!much )\bas(?= (?:you|they|i|we|there|your)\b)", ";", plain)
    found = []
    for piece in re.split(r"[,;:!?]|\.(?!\d)", plain):
        beside = "\x00" in piece
        found += [(words, beside) for part in piece.split("\x00") if (words := " ".join(part.split()))]
    return found


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
                plain = re.sub(_SUBORDINATOR, "\x00", plain)
    return edits, plain


def _read_clause(clause: str, vocabulary: Vocabulary, kind: str, nouns: set[str]) -> tuple[list[Edit], str]:
    """Edits in the order of the words, and the clause with what was read blanked out."""
    rest = clause
    found: list[tuple[int, Phrase, re.Match[str]]] = []
    when = time_part(clause)  # what begins in there only says when
    degrees = [one for one in vocabulary.degrees.read(clause, kind) if one.start <= when]
    for one in degrees:
        rest = rest[: one.start] + "\x00" * (one.end - one.start) + rest[one.end :]
    if any(one.edit in ("finger-width", "farther", "less-far") for one in degrees):
        rest = re.sub(_OPENS_FINGERS, lambda m: "\x00" * len(m.group()), rest)
    for phrase in vocabulary.phrases:
        if phrase.whole or (phrase.only and kind not in phrase.only):
            continue
        for pattern in phrase.patterns:
            while match := pattern.search(rest):
                if not match.group().strip():
                    break
                if match.start() <= when and not _a_noun(rest, match):
                    found.append((match.start(), phrase, match))
                rest = rest[: match.start()] + "\x00" * (match.end() - match.start()) + rest[match.end() :]
    rest = vocabulary.complaints.sub(lambda m: "\x00" * len(m.group()), rest)
    denial = vocabulary.negations.search(rest)
    placed = [(one.start, _of_degree(one, clause, kind, vocabulary)) for one in degrees]
    for start, phrase, match in found:
        placed.append((start, _edit(phrase, match, denial is not None and denial.start() < start, vocabulary)))
    edits = [
        _as_turn(_as_motion(edit, clause, kind, vocabulary), kind, vocabulary, nouns)
        for _, edit in sorted(placed, key=lambda item: item[0])
    ]
    if any(edit.kind == "speed" for edit in edits):  # "come up slower": how, not where to
        edits = [edit for edit in edits if edit.kind != "offset" or edit.degree or not _bare_way(edit)]
    if any(edit.kind == "offset" for edit in edits):  # "2 cm lower, a bit more": how much, not how far
        edits = [edit for edit in edits if edit.kind != "farther" or edit.said.strip() not in ("more", "further")]
    if kind == "pick":
        edits = [_from_above(_lifted(edit), vocabulary) for edit in edits]
    if kind == "pour" and len(edits) > 1:  # tilting is what it does; how far, and how fast, stands beside it
        edits = [edit for edit in edits if edit.kind != "tilt" or edit.degrees is not None or edit.value]
    if any(
        edit.kind in _CARRIED_BY_WAY for edit in edits
    ):  # "push it further": the verb carries what is said beside it
        edits = [edit for edit in edits if edit.kind != "way" or not re.fullmatch(_BARE, edit.said.strip())]
    if any(edit.kind == "force" for edit in edits):  # "hold on to it tighter"
        edits = [edit for edit in edits if edit.kind != "hold-on"]
    if kind in ("open", "close", "pull", "push"):  # "push it sideways": a way, and not an angle
        edits = [edit for edit in edits if edit.kind != "angle" or not re.search(r"sideways|crosswise", edit.said)]
    if kind == "close" and len(edits) > 1:  # "shut it more slowly": what it does anyway
        edits = [edit for edit in edits if edit.said.strip() not in ("shut", "closed")]
    edits = [_with_verb(edit, clause, kind) for edit in edits]
    edits, rest = _with_amount(edits, rest, vocabulary)
    rest = vocabulary.negations.sub(" ", rest)
    return edits, rest.replace("\x00", " ")


def _a_noun(clause: str, match: re.Match[str]) -> bool:
    """Whether what looks like a verb is a thing: "the sink"."""
    before = clause[: match.start()].split()
    return bool(before) and before[-1] in _DETERMINERS and match.group().split()[0] in _NOUNS_TOO


def _of_degree(degree: Degree, clause: str, subtask: str, vocabulary: Vocabulary) -> Edit:
    kind, value, lifted = degree.edit, degree.value, ""
    if kind in ("farther", "less-far") and re.search(r"wid|narrow", degree.said) and re.search(_FINGERS, clause):
        kind, value = "finger-width", "wider" if kind == "farther" else "less"
    if (
        kind == "offset"
        and value in ("up", "down")
        and re.search(r"\b(?:lift|rais|carr)\w*\b", clause)
        and subtask == "pick"
    ):
        lifted = "lift "
    phrase = next((p for p in vocabulary.phrases if p.edit == kind and not (p.only or p.whole)), None)
    degrees = vocabulary.angle(degree.said) if kind in ("farther", "less-far") else None
    return Edit(
        kind, value, vocabulary.amount(degree.said), degrees, said=lifted + degree.said, phrase=phrase, degree=True
    )


def _as_turn(edit: Edit, kind: str, vocabulary: Vocabulary, nouns: set[str]) -> Edit:
    """To the right is clockwise where something is turned in place."""
    if (
        kind != "turn"
        or "lever" in nouns
        or edit.kind not in ("offset", "pivot")
        or edit.value not in ("left", "right")
    ):
        return edit
    if edit.amount is not None and edit.amount.exact:
        return edit
    turned = next((p for p in vocabulary.phrases if p.edit == "turn-thing" and not (p.value or p.lesson)), None)
    value = "clockwise" if edit.value == "right" else "counterclockwise"
    return attrs.evolve(edit, kind="turn-thing", value=value, amount=None, phrase=turned)


def _as_motion(edit: Edit, clause: str, kind: str, vocabulary: Vocabulary) -> Edit:
    """What is to be gentle is a motion, where the clause's verb is one: then it is to be slow."""
    moved = (
        kind in ("open", "close", "pull") and re.search(r"gently|softly|carefully|delicately", edit.said) is not None
    )
    moves = (
        "approach|mov|com|reach"
        if kind in ("pick", "push")
        else "approach|mov|com|reach|put|set|lay|lower|plac|down|drop"
        if kind == "place"
        else "approach|mov|com|reach|pull|push|swing|shut|clos|open|turn|pour|slid"
    )
    set_down = kind == "place" and re.search(_GRIPS_ALONE, clause) is None
    if (
        edit.kind == "force"
        and edit.value in GENTLE
        and (moved or set_down or re.search(rf"\b(?:{moves})\w*\b", clause))
        and (set_down or not re.search(_GRIPS, clause))
    ):
        slower = next((p for p in vocabulary.phrases if p.edit == "speed"), None)
        return attrs.evolve(edit, kind="speed", value="slower", phrase=slower)
    return edit


def _lifted(edit: Edit) -> Edit:
    """What is picked up straight is lifted so."""
    if edit.kind != "straight" or edit.phrase is None or not re.search(r"\bup\b|\blift", edit.said):
        return edit
    return attrs.evolve(edit, phrase=attrs.evolve(edit.phrase, say="Lift it straight up.", opposite=""))


def _from_above(edit: Edit, vocabulary: Vocabulary) -> Edit:
    """To come straight down to something is to come from above."""
    if (
        edit.kind != "offset"
        or edit.amount
        or not re.fullmatch(r"(?:(?:go|come|reach|move|get) )?straight down", edit.said.strip())
    ):
        return edit
    phrase = next(p for p in vocabulary.phrases if p.edit == "approach")
    return attrs.evolve(edit, kind="approach", value="top", phrase=phrase)


def _with_verb(edit: Edit, clause: str, kind: str) -> Edit:
    """A remark about force with the verb that it is about: to pull harder is not to grip harder."""
    if edit.kind != "force" or kind in ("pick", "place") or re.search(_GRIPS_ALONE, clause):
        return edit
    for verb, forms in _FORCEFUL.items():
        if re.search(rf"\b(?:{forms})\w*\b", clause):
            return attrs.evolve(edit, verb=verb)
    return edit


def _with_amount(edits: list[Edit], rest: str, vocabulary: Vocabulary) -> tuple[list[Edit], str]:
    """The clause's one length goes with the one edit that it can be meant of."""
    lengths = re.findall(r"[\d.]+ (?:cm|mm|inch|m)\b", rest)
    open_ones = [i for i, edit in enumerate(edits) if not _measured(edit)]
    if len(lengths) != 1 or len(open_ones) != 1:
        return edits, rest
    i = open_ones[0]
    measured = attrs.evolve(edits[i], amount=vocabulary.amount(lengths[0]))
    return [*edits[:i], measured, *edits[i + 1 :]], rest.replace(lengths[0], " ")


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
