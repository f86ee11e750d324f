"""What an answer to a question stands for."""

from __future__ import annotations

import re

from memo_llm.offline.clauses import is_request
from memo_llm.offline.reading import clauses
from memo_llm.offline.remark import Heard
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import sentence_plainly

_ASKED = re.compile(r"\n\(asked back: (?P<question>.*?)\)\n(?P<answer>[^\n]*(?:\n(?!\(asked back).*)*)\Z", re.S)
_MEANT = re.compile(r"is this what you mean: (?P<understood>.*?) (?:It is not clear|You said:)")
_YES = re.compile(
    r"(?:yes|yep|yeah|y|ok|okay|sure|right|correct|exactly|that's (?:it|right)|please|do|i do|it is|that too|[, .!])+",
    re.I,
)
_YES_AND = re.compile(
    r"(?:(?:yes|yep|yeah|sure|exactly|right|correct|ok|okay|that's (?:it|right))[,.!]+\s*|yes )+", re.I
)
_BUT = re.compile(r"(?:but|only|except|though|however|no|not|don't|unless|if)\b", re.I)  # a yes with a reservation
_YES_OR_NO = re.compile(
    r"(?:yes|yep|yeah|no|nope|nah|sort of|not really|none of (?:that|those|them|these))[,.!;]+\s*(?:but )?", re.I
)
# What an answer is about, said before it: "Where you let go. Put it down further in."
_ASPECT = re.compile(
    r"(?:i mean )?(?:it's |just )?(?:where|which way|how (?:far|hard|fast|much)|the way|when)\b(?: [\w']+){0,5}[.!] "
    r"(?=\w)|i mean ",
    re.I,
)
_NO_ANSWER = re.compile(
    r"\b(?:never ?mind|forget (?:it|that)|(?:don't|do not) (?:know|care)|no idea|not sure|whatever|nothing|"
    r"(?:don't|do not) understand|(?:already|just) (?:told|said))\b|\?\s*$"
)


def settled_words(words: str) -> tuple[list[str], bool]:
    """What somebody said in the end, the first that is understood counts, and whether it answers a question. An answer
    stands for what it was asked about, and "yes" for what the question took it to mean, whatever else is said with
    it."""
    asked = _ASKED.search(words)
    if asked is None:
        return [words], False
    answer = asked.group("answer").strip()
    meant = _MEANT.search(asked.group("question"))
    if meant is None:
        return [_without_echo(answer)], True
    understood = meant.group("understood")
    if _YES.fullmatch(answer):
        return [understood], True
    if (yes := _YES_AND.match(answer)) is None:
        return [_without_echo(answer)], True
    rest = answer[yes.end() :]
    both = f"{understood} {rest[:1].upper()}{rest[1:]}"
    return [both] if _BUT.match(rest) else [both, understood], True


def _without_echo(answer: str) -> str:
    """Without "yes" or "no", and without what the question offered."""
    for echo in (_YES_OR_NO, _ASPECT):
        if (found := echo.match(answer)) is not None:
            answer = answer[found.end() :] or answer
    return answer[:1].upper() + answer[1:]


def wished(heard: Heard, vocabulary: Vocabulary) -> list[str]:
    """The sentences of an answer of which nothing was read, where they are a request all the same: who was asked
    already, and asks for it again, is not asked a second time. Nothing follows from them here."""
    words = " ".join(heard.sentences)
    if any(reading.edits for reading in heard.readings) or _NO_ANSWER.search(words.lower()):
        return []
    said = [one for one in heard.sentences if len(one.split()) > 3 and not vocabulary.praises(one)]
    wishes = any(is_request(clause) and vocabulary.lexicon.asks(clause) for one in said for clause in clauses(one))
    return [sentence_plainly(one) for one in said] if wishes else []
