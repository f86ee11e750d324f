"""Clauses read by the phrases of the vocabulary and by remarks of degree, and what their words mean together."""

from __future__ import annotations

import re

import attrs

from memo_llm.offline.clauses import split_words, time_part
from memo_llm.offline.degrees import Degree
from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.vocabulary import Phrase, Vocabulary

_SUBORDINATOR = (
    r"\b(?:only )?(?:unless|if|when|once|until|after)(?: you| it)* ?\x00"
    r"|\b(?:if|when) it (?:sticks|jams|gets stuck|is stuck|catches|hangs)[,]? ?(?:then )?\x00"
)
_CARRIED_BY_WAY = ("offset", "farther", "less-far", "all-the-way", "angle")
_BARE = r"(?:push|press|shove|lift|raise)(?: [\w' ]+?)??(?: (?:it|them|this|that))?"
_DETERMINERS = split_words("a an the my your his her our their this that each every kitchen in")
_NOUNS_TOO = split_words("sink dip press push pull lift rest slide drop tip shake stretch reach draw")
_FINGERS = r"\b(?:fingers|gripper|jaws|hand)\b"
_OPENS_FINGERS = r"\b(?:open|spread)\w*(?: up)? (?:the |your |its )?(?:hand|gripper|fingers|jaws)\b"
_GRIPS = r"\b(?:grip|grab|grasp|hold|squeeze|take|pick|fingers|force|press)\w*\b"
_GRIPS_ALONE = r"\b(?:grip|grab|grasp|hold|squeeze|take|fingers|pinch)\w*\b"
_JUST_THERE = re.compile(r" (?:over|above|on|onto|in|into|at|next|below|up|down|there|by|behind|under)\b")  # right over
_FORCEFUL = {
    "pull": "pull|tug|yank|heave",
    "push": "push|shov|nudg|lean",
    "press": "press|wip|rub|scrub",
    "turn": "turn|twist|rotat|screw|unscrew",
}


def _bare_way(edit: Edit) -> bool:
    """Whether an offset was read from no more than a verb and a way, as in "come up"."""
    return edit.amount is None and re.search(r"\w+er\b|more|further|farther|\btoo\b", edit.said) is None


def is_measured(edit: Edit) -> bool:
    return edit.kind not in ("offset", "farther", "less-far", "beside") or (
        edit.amount is not None and edit.amount.exact
    )


def read_whole(plain: str, vocabulary: Vocabulary, kind: str) -> tuple[list[Edit], str]:
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


def read_clause(clause: str, vocabulary: Vocabulary, kind: str, nouns: frozenset[str]) -> tuple[list[Edit], str]:
    """Edits in the order of the words, and the clause with what was read blanked out."""
    rest = clause
    found: list[tuple[int, Phrase, re.Match[str]]] = []
    when = time_part(clause)  # what begins in there only says when
    degrees = [
        one
        for one in vocabulary.degrees.read(clause, kind)
        if one.start <= when and not (one.value == "right" and _JUST_THERE.match(clause[one.end :]))
    ]
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
    if any(edit.kind in ("speed", "approach") for edit in edits):  # "come up slower", "come down from the top"
        edits = [edit for edit in edits if edit.kind != "offset" or edit.degree or not _bare_way(edit)]
    if any(edit.kind == "offset" for edit in edits):  # "2 cm lower, a bit more": how much, not how far
        edits = [edit for edit in edits if edit.kind != "farther" or edit.said.strip() not in ("more", "further")]
    if kind == "pick" and re.search(r"\b(?:lift|raise)\b", clause):
        edits = [_lifted_more(edit, vocabulary) for edit in edits]
    if kind in ("pick", "place") and re.search(r"\bdown\b", clause):  # "put it down all the way"
        edits = [_lowered(edit, kind, vocabulary) for edit in edits]
    if kind in ("pick", "place"):
        edits = [_from_above(_lifted(edit) if kind == "pick" else edit, vocabulary) for edit in edits]
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
    if len(edits) > 1:  # "keep it upright all the way down": throughout
        edits = [edit for edit in edits if edit.kind != "offset" or edit.said.strip() != "all the way down"]
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


def _as_turn(edit: Edit, kind: str, vocabulary: Vocabulary, nouns: frozenset[str]) -> Edit:
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
        kind in ("open", "close", "pull", "turn")
        and re.search(r"gently|softly|carefully|delicately|rough", edit.said) is not None
    )
    moves = (
        "approach|mov|com|reach"
        if kind in ("pick", "push")
        else "approach|mov|com|reach|put|set|lay|lower|plac|down|drop"
        if kind == "place"
        else "approach|mov|com|reach|pull|push|swing|shut|clos|open|turn|pour|slid"
    )
    shut = kind == "close" and edit.said.strip() != "" and not edit.verb
    set_down = kind == "place" and re.search(_GRIPS_ALONE, clause) is None
    if (
        edit.kind == "force"
        and edit.value in GENTLE
        and (moved or shut or set_down or re.search(rf"\b(?:{moves})\w*\b", clause))
        and (set_down or not re.search(_GRIPS_ALONE if shut else _GRIPS, clause))
        and "rough with" not in clause
    ):
        slower = next((p for p in vocabulary.phrases if p.edit == "speed"), None)
        return attrs.evolve(edit, kind="speed", value="slower", phrase=slower)
    return edit


def _lifted(edit: Edit) -> Edit:
    """What is picked up straight is lifted so."""
    if edit.kind != "straight" or edit.phrase is None or not re.search(r"\bup\b|\blift", edit.said):
        return edit
    return attrs.evolve(edit, phrase=attrs.evolve(edit.phrase, say="Lift it straight up.", opposite=""))


def _lifted_more(edit: Edit, vocabulary: Vocabulary) -> Edit:
    """To lift it more, or up a bit, is to lift it higher."""
    up = edit.kind == "way" and edit.value == "up" and edit.amount is not None
    if not (edit.kind == "farther" or up) or edit.negated:
        return edit
    phrase = next(p for p in vocabulary.phrases if p.edit == "offset" and not p.flip)
    return attrs.evolve(edit, kind="offset", value="up", said=f"lift {edit.said}", phrase=phrase)


def _lowered(edit: Edit, kind: str, vocabulary: Vocabulary) -> Edit:
    """To go all the way down is to go lower, and to put something down so is to let it touch first."""
    if edit.kind != "all-the-way" or edit.negated:
        return edit
    to = "set-down" if kind == "place" else "offset"
    phrase = next(p for p in vocabulary.phrases if p.edit == to and not p.flip)
    return attrs.evolve(edit, kind=to, value="" if kind == "place" else "down", phrase=phrase)


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
    open_ones = [i for i, edit in enumerate(edits) if not is_measured(edit)]
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
