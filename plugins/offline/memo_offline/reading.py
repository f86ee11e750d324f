"""Reading a remark as edits, by keywords. What is denied, bound to a condition, asked, or contradicts itself is a doubt
and yields no edits: it is never guessed."""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_core.plugin import Node
from memo_offline.phrases import Amount, Phrase, Phrases, Tokens, load

_OF_GRIPS = ("handle", "knob", "bar", "grip", "lever", "button")
_IMPERATIVE_NO = {
    ("don't",),
    ("do", "not"),
    ("never",),
    ("without",),
    ("instead", "of"),
    ("rather", "than"),
    ("stop",),
    ("avoid",),
}
_ALONE = {"degrees": "through an angle", "times": "again"}  # what an amount says that nothing else takes
_EVERYWHERE = re.compile(r"\b(?:always|every time|in general|generally|everything|all \w+s)\b")
_CONTRAST = re.compile(r",\s*(?:and |but )?not ([^,.;:!?]+)")  # "from above, not from the side"
UNKNOWN = "none of these words is known"
_COUNTS = {"twice": 2, "again": 2, "once more": 2, "a second time": 2}


@attrs.frozen
class Edit:
    """One thing to do differently: a phrase and its amount."""

    phrase: Phrase
    amount: Amount | None = None
    explained: bool = attrs.field(default=False, eq=False)  # whether the remark says why

    @property
    def note(self) -> str:
        """The edit as a note: a sentence that is read as the same edit."""
        text = self.phrase.say.format(amount=self.amount.said if self.amount else "")
        return re.sub(r"\s+(?=[.,])", "", " ".join(text.split())).replace("through by ", "through ")


@attrs.frozen
class Reading:
    """The edits of a remark in the order of its words. ``doubt`` says why there are none."""

    edits: tuple[Edit, ...] = ()
    doubt: str = ""
    praise: bool = False
    everywhere: bool = False
    rest: tuple[str, ...] = ()  # words that no keyword took


def with_names_replaced(text: str, nodes: Iterable[Node]) -> str:
    """A text with "it" in place of the names of things, and a part's bare noun in place of its name."""
    for node in sorted(nodes, key=lambda one: -len(one.label)):
        noun = node.label.split()[-1].lower()
        named = f"the {noun}" if node.kind == "part" else "it"
        label = rf"(?<!\w)(?:(?:the|a|an|this|that|its|your) )?{re.escape(node.label)}"
        if named != "it" and noun == node.label.lower():
            continue
        text = re.sub(rf"{label}['’]s(?!\w)", "its" if named == "it" else f"{named}'s", text, flags=re.I)
        text = re.sub(rf"{label}(?!\w)", named, text, flags=re.I)
    return text


def read(text: str, nodes: Iterable[Node] = ()) -> Reading:
    """Read what a remark or a note asks for. ``nodes`` are the things of the scene, whose names may be said."""
    phrases = load()
    text = with_names_replaced(text, nodes)
    contrast = _CONTRAST.search(text)
    if contrast is not None:
        said = read(text[: contrast.start()] + text[contrast.end() :])
        if {one.phrase.matter for one in said.edits} & {one.phrase.matter for one in read(contrast[1]).edits}:
            return said
    tokens = phrases.tokens(text)
    left, hits = _matched(tokens, phrases)
    if not hits and "#" not in left:
        return _nothing(tokens, phrases)
    edits, unused = _with_amounts(tokens, left, hits, phrases)
    doubt = _doubt(text, tokens, left, hits, edits, unused, phrases)
    everywhere = _EVERYWHERE.search(text.lower()) is not None
    rest = tuple(word for word in left if word and word != "#")
    return Reading((), doubt) if doubt else Reading(tuple(edits), everywhere=everywhere, rest=rest)


@attrs.frozen
class _Hit:
    start: int
    end: int
    words: tuple[str, ...]
    phrase: Phrase


def _matched(tokens: Tokens, phrases: Phrases) -> tuple[list[str], list[_Hit]]:
    """The words that no keyword took (those taken are ""), and the keywords found, in order."""
    left, hits = list(tokens.words), []
    for words, phrase in phrases.keywords:
        for start in range(len(left) - len(words) + 1):
            if tuple(left[start : start + len(words)]) != words or not words:
                continue
            end = start + len(words)
            if phrase is not None and not _fits(phrase, words, tokens, start, end):
                continue
            if phrase is not None:
                hits.append(_Hit(start, end, words, phrase))
            left[start:end] = [""] * len(words)
    return left, sorted(hits, key=lambda hit: hit.start)


def _fits(phrase: Phrase, words: tuple[str, ...], tokens: Tokens, start: int, end: int) -> bool:
    """Whether the amounts inside a keyword are ones that its phrase takes, where it takes any."""
    inside = [amount for at, amount in _placed(tokens) if start <= at < end]
    return not phrase.takes or all(_takes(phrase, amount) for amount in inside)


def _placed(tokens: Tokens) -> list[tuple[int, Amount]]:
    places = [index for index, word in enumerate(tokens.words) if word == "#"]
    return list(zip(places, tokens.amounts, strict=True))


def _takes(phrase: Phrase, amount: Amount) -> bool:
    return amount.unit in phrase.takes or (amount.unit == "rough" and bool({"cm", "percent"} & {*phrase.takes}))


def _with_amounts(
    tokens: Tokens, left: list[str], hits: list[_Hit], phrases: Phrases
) -> tuple[list[Edit], list[Amount]]:
    """An edit for each keyword with the amount in it or in its clause, and the amounts that nothing took."""
    free = dict(_placed(tokens))
    edits: list[Edit] = []
    for hit in hits:
        inside = [at for at in free if hit.start <= at < hit.end]
        clause = tokens.clause(hit.start)
        beside = [at for at in free if left[at] == "#" and tokens.clause(at) == clause]
        amount = None
        for at in [*inside, *sorted(beside, key=lambda at: abs(at - hit.start))]:
            if amount is None and _takes(hit.phrase, free[at]):
                amount = free.pop(at)
        for at in inside:
            free.pop(at, None)
        if amount is None and "times" in hit.phrase.takes:
            count = _COUNTS.get(" ".join(hit.words), 2)
            amount = Amount(f"{count} times", "times", float(count)) if count != 2 else None
        edits.append(Edit(hit.phrase, amount, hit.words in hit.phrase.lesson))
    for at, amount in list(free.items()):
        if amount.unit in _ALONE:
            edits.append(Edit(phrases.named(_ALONE[amount.unit]), free.pop(at)))
    return _joined(edits), [amount for amount in free.values() if amount.unit != "rough"]


def _joined(edits: list[Edit]) -> list[Edit]:
    """Drop what is said twice: of a phrase with and without an amount, the one with it."""
    kept: list[Edit] = []
    for edit in edits:
        same = next((one for one in kept if one.phrase is edit.phrase), None)
        if same is None:
            kept.append(edit)
            continue
        amount = same.amount or edit.amount
        if edit.amount is None or same.amount is None or same.amount == edit.amount:
            kept[kept.index(same)] = Edit(edit.phrase, amount, same.explained or edit.explained)
        else:
            kept.append(edit)
    return kept


def _doubt(
    text: str,
    tokens: Tokens,
    left: list[str],
    hits: list[_Hit],
    edits: list[Edit],
    unused: list[Amount],
    phrases: Phrases,
) -> str:
    """Why a remark with keywords is not followed; "" where nothing speaks against it."""
    if "?" in text:
        return "it is a question; say what to do instead"
    if found := _first(left, phrases.conditions):
        return f"it holds under a condition ({found[1]!r}); say only what to do"
    if found := _first(left, phrases.relations):
        return f"it says where beside something else ({found[1]!r}); say which way and how far"
    clauses = {tokens.clause(hit.start) for hit in hits}
    for words in phrases.negations:
        for start in _places(left, words):
            if words in _IMPERATIVE_NO or tokens.clause(start) in clauses:
                return f"something is denied ({' '.join(words)!r}); say only what to do"
    for start in _places(left, ("no",)):
        if any(hit.start == start + 1 for hit in hits) and start + 1 not in tokens.starts:
            return "something is denied ('no'); say only what to do"
    for index, one in enumerate(edits):
        for other in edits[index + 1 :]:
            if one.phrase.matter == other.phrase.matter:
                pair = f"{one.phrase.name}; {other.phrase.name}"
                return f"two things are asked that do not go together ({pair}); say only one of them"
    return f"it is not clear what {unused[0].said!r} is about; say it with its direction" if unused else ""


def _nothing(tokens: Tokens, phrases: Phrases) -> Reading:
    """The reading of a remark without keywords."""
    left = list(tokens.words)
    praised = False
    for words in phrases.praise:
        for start in _places(left, words):
            left[start : start + len(words)], praised = [""] * len(words), True
    denied = any(_places(left, words) for words in phrases.negations) or "no" in left
    if praised and not denied and sum(map(bool, left)) <= 4:
        return Reading(praise=True)
    return Reading(doubt=UNKNOWN)


def _first(left: list[str], known: Iterable[tuple[str, ...]]) -> tuple[int, str] | None:
    return next(((start, " ".join(words)) for words in known for start in _places(left, words)), None)


def _places(left: list[str], words: tuple[str, ...]) -> list[int]:
    return [start for start in range(len(left) - len(words) + 1) if tuple(left[start : start + len(words)]) == words]
