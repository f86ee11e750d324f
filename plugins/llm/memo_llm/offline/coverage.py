"""Which words of a clause no reading accounts for.

A clause is acted on only where each of its words belongs to an edit that was read, names what the subtask is about,
says when in a way that is known, or carries nothing: a pronoun, an address, words that lead up to a request.
"""

from __future__ import annotations

import re
from collections.abc import Collection

import attrs

from memo_llm.offline.clauses import core, goes_on_to_end, is_act, is_own_act, split_words, time_part
from memo_llm.offline.composition import TIMES
from memo_llm.offline.vocabulary import Vocabulary

# Parts of the lexicon that change nothing of what is asked for beside them.
_IDLE = frozenset(["lead", "vocative", "very", "pronoun", "thing", "hand", "be", "comparison", "destination", "vessel"])
_MOMENTS = _IDLE | TIMES | {"while_lift", "when_above", "prep"}
# Edits that say how far: what is said of the end of the motion ("until it clicks") belongs to them.
_BOUNDED = frozenset(["farther", "less-far", "all-the-way", "angle", "extent", "offset", "turn-thing", "hold-for"])
_STARTING = frozenset(["start", "begin", "starting", "beginning"])  # only at first
_LAST = frozenset(["release", "back-off"])
_FUNCTION_WORDS = split_words(
    "a an the to of at about like good so or two three few little nice same thing and as than some one with for by "
    "from on onto into in would be give another super you've handle hand fingers gripper arm continue continuing"
)
# Where the motion of a kind of subtask goes anyway.
_PARTICLES = {
    "pick": "in up down on off out",
    "place": "in down on over",
    "open": "open out up back",
    "close": "shut closed in up down to",
    "pull": "out back",
    "push": "in down on against",
    "pour": "out over in",
    "turn": "round around on off",
}
# What a telling clause is about: "the bar is higher".
_SUBJECT = re.compile(r"(?:(?:the|my|your|its|that|this) )?[a-z]+(?:'s|'re| is| are| was| were)(?= |$)")
_GOING_ON = re.compile(r"(?:just )?(?:go on|carry on|keep going)\b")
_REASON = re.compile(r"^(?:because|since|as|that's why) ")
_PURPOSE = re.compile(r"\bfor (?:\w+ )?(?:it|them|\w+) to [\w ]+")
_HELD = re.compile(r"(?:the|its|their|by|at) ")
_DONE = re.compile(r"(?:when|once|after|as soon as) you(?:'re| are) (?:done|finished|through)\b")
_MOMENT = re.compile(r"(?:when|while|as|before|after|once) (?:(?:you|it|they)(?:'re| are|'s| is)? )?(\w+)\b")


@attrs.frozen(eq=False)
class Context:
    """What a sentence is said of. ``kind`` is the kind of subtask (``memo_llm.offline.recipe``), "" where that is not
    known; ``own`` are words for what the subtask is about, ``others`` for what else is to be seen."""

    vocabulary: Vocabulary
    kind: str
    own: frozenset[str]
    others: frozenset[str]

    @property
    def nouns(self) -> frozenset[str]:
        return self.own | self.others


def unaccounted(clause: str, rest: str, edits: Collection[str], before: Collection[str], context: Context) -> list[str]:
    """Words of a clause that carry meaning and that no reading accounts for. ``rest`` is the clause without the words
    that ``edits`` (their kinds) were read from, ``before`` kinds of what was read before it."""
    kind, lexicon, things, around = context.kind, context.vocabulary.lexicon, context.own, context.others
    particles = _PARTICLES.get(kind, "").split()
    body = _REASON.sub("", _PURPOSE.sub(" ", rest[: time_part(rest)]).strip())
    body = _GOING_ON.sub("", _SUBJECT.sub("", body, 1))
    found = []
    acts = False
    for part, said in lexicon.pieces(core(body, things, around, times=False), things, around):
        words = [word for word in re.findall(r"[\w'-]*\w", said.removesuffix("'s")) if word not in _FUNCTION_WORDS]
        returns = said == "back" and "back" not in particles
        if returns or said == "something" or (said in _STARTING and {"force", "speed"} & set(edits)):
            found.append(said)
            continue
        held = part == "hold_at" and "hold-at" in edits and _HELD.match(said) is not None
        if (
            held
            or part in _IDLE
            or said in context.vocabulary.small_talk
            or all({word, word.removesuffix("s")} & things for word in words)
        ):
            continue
        if part == "verb" or is_act(said):
            acts = True
            # What is done is judged by what was read beside it (``clauses.unread``).
            if not edits and not all(is_own_act(word, kind) or word in particles for word in words):
                found.append(said)
        elif not (acts and said in particles):
            found.append(said)
    when = clause[time_part(clause) :] if time_part(rest) < len(rest) else ""  # else it was read itself
    if when and not _known_moment(when, {*edits, *before}, context):
        found.append(when)
    return found


def _known_moment(when: str, edits: Collection[str], context: Context) -> bool:
    """Whether words that say when say no more than what is done anyway, or how far."""
    if re.match(r"(?:until|till)\b", when):
        return bool(_BOUNDED & set(edits)) or goes_on_to_end(when)
    if _LAST & set(edits) and _DONE.match(when):
        return True
    moment = _MOMENT.match(when)
    if moment is not None and is_own_act(moment.group(1), context.kind):
        when = when[moment.end() :].strip()
    particles = _PARTICLES.get(context.kind, "").split()
    parts = context.vocabulary.lexicon.parts(when, context.own, context.others) if when else []
    return parts is not None and all(part.kind in _MOMENTS or part.said in particles for part in parts)
