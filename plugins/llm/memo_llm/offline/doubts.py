"""Whether a clause may mean something else than what was read in it; then its speaker is asked."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property

import attrs

from memo_llm.offline.clauses import (
    Mood,
    core,
    ends_when,
    has_condition,
    in_parts,
    is_act,
    is_own_act,
    split_words,
    unread,
)
from memo_llm.offline.coverage import Context, unaccounted
from memo_llm.offline.edits import Edit

_UNITS = {"cm", "mm", "inch", "m", "degrees", "seconds", "newton"}
# Fillers that say which, when or whether, where nothing else was read.
_MATTERS = split_words(
    "in out up down off on away over back under only not no other another first more less about what here there finger "
    "fingers"
)
# Edits that say themselves how long something goes on.
_ENDS = frozenset(["hold-for", "set-down", "extent", "all-the-way", "first-in", "hold-on", "less-far"])
# An amount that is told and bounds what is to be done: "an inch is enough".
_BOUNDED = re.compile(
    r"\d (?:cm|mm|inch|m|degrees|seconds)\b.*\b(?:plenty|enough|all|do)\b|\b(?:at (?:least|most)|no more than) \d"
)
_SIDES = frozenset(["left", "right", "front", "back", "top", "bottom", "upper", "lower"])
# Where it was, unless it is to be moved there.
_OFF = re.compile(
    r"^(?!.*\b(?:mov|shift|slid|nudg|scoot|go|com|put|plac|set|aim)\w*\b).*\boff to (?:the|your) (?:left|right)\b"
)
# What no edit says.
_BEYOND = re.compile(r"\b(?:right|other|wrong) way up\b|\b(?:other|both) hands?\b")
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


@attrs.frozen(eq=False)
class ReadClause:
    """A clause and what was read in it."""

    words: str
    mood: Mood
    beside: bool  # whether it is what is left beside something that was read before the sentence was taken apart
    found: bool  # whether phrases were found in it, also such as ask for nothing
    said: Sequence[Edit]  # what it asks for
    edits: Sequence[Edit]  # of the sentence so far
    left: str  # words of it that no phrase accounts for
    context: Context

    @property
    def denies(self) -> bool:
        """Whether it says what not to do, and nothing follows from that."""
        return not self.said and self.context.vocabulary.negations.search(self.words) is not None

    @cached_property
    def rest(self) -> str:
        """What no phrase accounts for and says more than where and when."""
        return _of_the_thing(core(self.left, self.context.own, self.context.others), self.context)

    @cached_property
    def unknown(self) -> list[str]:
        """Words that are not known at all."""
        words = re.findall(r"[^\W_][\w'-]*", self.rest)
        return [word for word in words if not (_is_plain(word, self.context) or is_act(word))]


def is_beyond(clause: ReadClause) -> bool:
    """Whether it says what no edit says, however it is read."""
    return _BEYOND.search(clause.words) is not None


def is_doubtful(clause: ReadClause) -> bool:
    asks, told = clause.mood == "request", clause.mood == "told"
    return (
        ((asks or told) and has_condition(clause.rest))
        or (asks and not clause.denies and bool(_open_words(clause)))
        or (asks and _is_unexplained(clause))
        or _leaves_words(clause)
        or _clashes(clause.said, clause.words)
        or in_parts(clause.words)
        or is_beyond(clause)
        or _is_relative_to_something(clause)
        or (asks and not clause.said and (_forbids(clause) or _insists(clause)))
        or (ends_when(clause.words) is not None and not any(edit.kind in _ENDS for edit in clause.said))
        or (told and _BOUNDED.search(clause.rest) is not None)
        or (told and not clause.said and _finds_fault(clause))
    )


def _open_words(clause: ReadClause) -> list[str]:
    """Words that say what to do, where or how much and that nothing was read from. What stands beside what was read
    already may name anything."""
    others = () if clause.beside else clause.context.others
    return unread(clause.rest, clause.context.kind, [edit.kind for edit in clause.said], others)


def _is_unexplained(clause: ReadClause) -> bool:
    """Whether a request has unknown words, or nothing in it was read that it could be about."""
    if clause.denies and re.search(r"^(?:never|not|no),? (?:by|at|on|from|around|with|near|in)\b", clause.words):
        return False  # "not by the rim": a contrast
    if clause.unknown[clause.beside :]:
        return True
    named = {word for edit in clause.edits for word in re.findall(r"[a-z]+", edit.said)}  # "the stem, always the stem"
    return not (clause.found or clause.beside or _adds_nothing(clause.rest, clause.context.kind, clause.context, named))


def _leaves_words(clause: ReadClause) -> bool:
    """Whether words that carry meaning are accounted for by no reading."""
    placed = clause.mood == "told" and any(edit.kind == "offset" for edit in clause.said)
    if not placed and (clause.mood != "request" or clause.denies):
        return False
    if clause.beside and re.fullmatch(r"(?:the|that|this|its) \w+", clause.words):
        return False
    return bool(
        unaccounted(
            clause.words,
            _of_the_thing(clause.left, clause.context) if clause.said else clause.left,
            {edit.kind for edit in (clause.edits if clause.beside else clause.said)},
            {edit.kind for edit in clause.edits},
            clause.context,
        )
    )


def _clashes(said: Sequence[Edit], words: str) -> bool:
    """Whether what was read in one clause cannot be all that it means."""
    kinds = {edit.kind for edit in said}
    fingers = r"\b(?:open|clos|spread|shut)\w*(?: up)? (?:the |your |its )?(?:hand|gripper|fingers|jaws)\b"
    of_doors = re.search(r"\b(?:door|lid|flap|panel)s?\b", words) is not None
    return (
        (of_doors and "finger-width" in kinds)
        or ("offset" in kinds and bool(kinds & {"arc", "pivot"}))
        or {"speed", "release"} <= kinds
        or {"fingers", "release"} <= kinds
        or len({edit.value for edit in said if edit.kind == "offset"}) > 1
        or ("all-the-way" in kinds and re.search(fingers, words) is not None)
        or len({edit.value for edit in said if edit.kind == "way"}) > 1
    )


def _is_relative_to_something(clause: ReadClause) -> bool:
    """Whether a way is one from or to what is neither the robot nor known: another thing, a part, the person, or
    "closer", and it is not said to what."""
    said, words = clause.said, clause.words
    if any(edit.kind in ("offset", "approach") for edit in said) and _is_beside_another(words, clause.context.others):
        return True
    aside = [edit for edit in said if edit.value in ("left", "right")]
    if _OFF.search(words) and not all(edit.phrase is not None and edit.phrase.flip for edit in aside):
        return True
    along = [edit for edit in said if edit.value in ("away", "towards")]
    if along and _TOWARDS.search(words):
        return True
    return any(
        edit.value == "towards" and re.search(r"\b(?:closer|nearer)\b", edit.said) and not _OWN.search(edit.said)
        for edit in along
    )


def _is_beside_another(words: str, others: frozenset[str]) -> bool:
    """Whether a way is one from or to another thing: "further away from the tray", "from the right box"."""
    named = "|".join(map(re.escape, sorted(others - _SIDES))) or "(?!)"
    sides = "|".join(sorted(others & _SIDES)) or "(?!)"  # of several alike, the one on that side
    the = r"\b(?:from|to|than) (?:the|that|my|your|a) (?:\w+ )?"
    return re.search(rf"{the}(?:(?:{named})\b|(?:{sides}) (?!side|hand|and|or|but|of)\w)", words) is not None


def _forbids(clause: ReadClause) -> bool:
    """Whether it says what not to do, and it is not known what follows from that."""
    denial = clause.context.vocabulary.negations.search(clause.words)
    if denial is None:
        return False
    if re.match(r"(?:not|never|instead|rather|no need|without)\b", clause.words[denial.start() :]):
        return False
    return not _adds_nothing(clause.rest, "", clause.context)


def _insists(clause: ReadClause) -> bool:
    """Whether it names a state of things that has to be seen to."""
    return re.search(r"\b(?:make sure|ensure|check|be sure|take care|mind that)\b", clause.rest) is not None


def _finds_fault(clause: ReadClause) -> bool:
    """Whether something is to be different from how it was."""
    wishes = clause.context.vocabulary.lexicon.begins_with_wish(clause.words)
    return wishes or _FAULT.search(clause.words) is not None


def _adds_nothing(rest: str, kind: str, context: Context, named: set[str] | None = None) -> bool:
    """Whether words from which nothing was read do not ask for anything either: small talk, or no more than what the
    subtask does anyway ("and then take it"). ``named``: nouns besides those of the context."""
    words = re.findall(r"[a-z][a-z'-]*|\d+", rest)
    empty = context.vocabulary.small_talk | context.vocabulary.fillers - _MATTERS | context.nouns | (named or set())
    return all(
        word in empty or word.removesuffix("s") in context.nouns | (named or set()) or is_own_act(word, kind)
        for word in words
    )


def _of_the_thing(rest: str, context: Context) -> str:
    """A clause's remainder without another name for what is in the hand: "hold the carton" of the milk."""
    if context.kind not in ("pick", "place", ""):
        return rest
    verbs = (
        "hold|carry|take|grab|grip|grasp|lift|pick up|put|set|lay|lower" if context.kind else "get|hold|keep|move|bring"
    )
    named = re.compile(
        rf"\b({verbs})(ing)? (?:the|that|this|my|your) (\w+)(?= (?:\W|down|up|in|at|by|on|around|$)|$|  )"
    )
    rest = named.sub(
        lambda m: m.group() if m.group(3) in context.others else f"{m.group(1)}{m.group(2) or ''} it", rest
    )
    with_it = re.fullmatch(r"(?:\s|be\b|please\b|more\b|really\b)*with (?:the|those|that|this|these) (\w+)", rest)
    return rest if with_it is None or with_it.group(1) in context.others else ""  # "be gentler with the fruit"


def _is_plain(word: str, context: Context) -> bool:
    """Whether a word is known, and carries nothing by itself."""
    bare = word.removesuffix("'s").strip("'")
    known = context.vocabulary.fillers | context.nouns
    return (
        bare in known
        or word in context.vocabulary.fillers
        or bare.removesuffix("s") in known
        or bare in context.vocabulary.numbers
        or bare.isdigit()
        or bare in _UNITS
    )
