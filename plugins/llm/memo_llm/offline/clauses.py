"""What kind of clause something is, and whether all that matters in it was read.

A clause that asks for something is acted on only if every word of it that carries meaning is accounted for. One that
tells what happened, or why, may hold anything: the request stands elsewhere, or it is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Literal


def split_words(words: str) -> frozenset[str]:
    return frozenset(words.split())


_OPENERS = re.compile(
    r"^(?:(?:no|nope|well|ok|okay|please|hey|hm+|oh|ah|uh|um|just|then|now|so|and|but|next time|also|careful|really|"
    r"maybe|perhaps|"
    r"always|in general|first|instead(?! of)|actually|yes|sorry|still|again|here|there(?! is| are| was|'s)|"
    r"this time|robot|it looks like|i think|"
    r"looks like|seems|as i said|i said|i mean)[, ]+)+"
)
_ASKED_FOR = re.compile(
    r"\b(?:must|should(?! have)|has to|have to|need to|needs to|got to|ought to|supposed to|"
    r"want(?:s|ed)? (?:you|it)? ?to|"
    r"'d better|try to|make sure|let's|wants? to be|better to|meant to|"
    r"would (?:work|be|do|go|look) (?:better|best|easier|nicer|safer)|"
    r"you (?:just |also )?(?:could|might|may)(?! have\b))\b"
)
# Where something belongs is where it is to be put.
_BELONGS = re.compile(
    r"(?:it|they|that|this|that one|(?:the|my|your|its) \w+) (?:goes|go|belongs?|lives?) "
    r"(?:in|on|under|next to|behind|between) (?:the|its|their|my|that)\b"
)
_WISHED = re.compile(
    r"(?:(?:you|it|this|that|they) (?:only |just )?(?:needs?|wants?|takes?) (?!you)|needs? |i'd|i would"
    r"|i want|i need|i prefer)\b"
)
_SAME_IN_PAST = {"put", "set", "let", "shut", "hit"}
_REASON = re.compile(r"^(?:else|because|since|otherwise|or else|or|so that|that's why|as|which|who|that's how|for)\b")
_CONDITION = re.compile(
    r"\b(?:if|unless|except|only when|only if|only while|as long as|in case|depending|either|whether)\b"
)
_SUBJECT = re.compile(
    r"^(?:i|you|it|they|he|she|we|this|that|there|these|those|what|why|who|how|where|nothing|everything|something|"
    r"(?:my|your|its|the|a|an|one|our|his|her|some|most|all|one of) [\w'-]+(?: [\w'-]+)?|[a-z]+s|[a-z]+)(?:'\w+)?\b"
)
_FINITE = re.compile(
    r"(?:\b(?:is|are|was|were|am|be|been|has|have|had|does|did|will|would|could|can|might|may|isn't|aren't|wasn't|weren't|"
    r"doesn't|didn't|won't|can't|cannot|couldn't|hasn't|haven't|wouldn't|go|went|fell|hit|hits|came|got|gets|took|lost|made|"
    r"knocked|let|broke|threw|stuck|held|(?<=you )left|(?<=it )left|"
    r"shut|slid|swung|bent|shook|flew|tore|rang|burst|split|spilt|sank|sprang|began|saw|felt|heard|"
    r"spun|rose|drove|(?<=s )get|"
    r"closes|tightens|loosens|shuts|locks|unlocks|"
    r"cost|looks|ended|caught|ran|stood|sat|keep|comes?|goes|falls?|needs?|"
    r"wants?|likes?|makes?|gives?|takes|holds|means|weighs|belongs?|burns?|breaks?|tips|spills?|drips?|leaks?|slips?|sticks?|stinks?|"
    r"jams?|stands|hangs?|tastes?|smells?|costs?|bends?|tears?|cracks?|moves|stays|runs|taught|told|lie|lay|hurts?|scratches|"
    r"wobbles?|rattles?|catches|bites?|rolls?|swings?|slides?|turns?|opens?|lies|sits?|looks?|[a-z]{3,}ed)|'(?:s|re|ve|ll|d|m))\b"
)
_AT = "next to|over|above|in|into|inside|on|onto|at|near|of|from|off|by|under|behind|beside|between|against"
_TOUCHING = "to|than|as|hits?|hitting|bump\\w*|knock\\w*|touch\\w*|clear|miss|like|with|for"
_PARTICLES = "up|down|in|out|on|off|over|back|open|shut|away|together"
# What a hand does. Said of nothing that was read, it is a request that was not understood.
_ACTS = {
    "open": "open pull swing hold grip grab take grasp",
    "close": "close push shut press hold",
    "pick": "pick take grab grasp grip lift get hold reach catch fetch",
    "place": "place put set lay drop leave release let lie stand sit rest",
    "push": "push press hit touch use",
    "pull": "pull hold grip",
    "turn": "turn twist rotate screw unscrew open close tighten loosen hold grip grab take",
    "pour": "pour tip tilt shake sprinkle season hold put",
}
_HOLD = "hold grip grab grasp take squeeze press push pull pinch clamp catch"
_LEAD = "open close shut push pull turn twist rotate tip tilt swing slide press lift raise"
_MOVE = f"{_HOLD} put place set lay drop lift raise lower let release leave pick reach pour carry fly scoot nudge shift"
# edit -> verbs that it says how to do
_CARRIED = {
    "force": f"{_HOLD} handle touch wipe close shut turn open",
    "speed": f"{_HOLD} {_MOVE} turn twist rotate tip tilt wipe shake swing",
    "offset": _MOVE,
    "finger-width": "open spread close",
    "hold-at": _HOLD,
    "approach": f"{_HOLD} pick lift",
    "centre": _MOVE,
    "set-down": _MOVE,
    "farther": f"{_LEAD} tighten loosen screw unscrew",
    "less-far": f"{_LEAD} tighten",
    "all-the-way": "open close shut push pull turn twist rotate press",
    "turn-hand": "turn twist rotate",
    "arc": "open swing pull turn",
    "pivot": "open swing pull turn",
    "straight": "pull open",
}
_LIGHT = (
    "lead guide follow go move come do get make try be keep use bring stay start begin continue "
    "reach approach aim work have"
)
_ALL_ACTS = frozenset(" ".join(_ACTS.values()).split()) | split_words(
    "spin press wait stop turn lower raise slide swing wiggle shake knock squeeze throw wipe clean tap retreat "
    "withdraw fly scoot nudge ease carry clamp pinch set lay drop touch spread tighten loosen drag bring "
    "shift aim continue"
)
_TELLING = split_words(
    "up down left right out back front top bottom middle centre center near inside outside above below "
    "under over higher lower further farther upside sideways behind beside between edge corner side end "
    "half twice"
)


Mood = Literal["request", "told", "hypothesis", "contrast", "question"]


def mood_of(clause: str, request: bool, after_request: bool) -> Mood:
    """What a clause does. ``request``: whether it asks for something (see ``is_request``); ``after_request``: whether
    something was asked for before it in the sentence, which "not so" then only sets off."""
    plain = _OPENERS.sub("", f"{clause} ").strip()
    if re.match(
        r"like (?:a|an|the|some|it|you)\b|(?:what|such) an? \w+|(?:of course|no wonder|thank (?:god|goodness))\b", plain
    ):
        return "told"
    if after_request and is_needless(clause):
        return "contrast"
    if after_request and re.match(
        r"(?:not|instead of|rather than)\b(?! (?:so|that|too|as|quite|far|enough|only)\b)", plain
    ):
        return "contrast"
    if after_request and re.fullmatch(
        r"(?:don't|do not|never|no) (?:pull|push|drag|shov|yank|slid)(?:e|ing)?(?: (?:it|on it|at it|straight))?", plain
    ):
        return "contrast"
    if re.match(r"so that\b", clause) or re.match(r"(?:otherwise|or else|else|or|in case)\b", plain):
        return "hypothesis"
    if re.match(
        r"(?:why|what|who|where) (?:on earth |the hell )?(?:are|is|do|does|did|was|were|would|should)\b", plain
    ):
        return "question"
    return "request" if request else "told"


def is_needless(clause: str) -> bool:
    """Whether a clause says what need not be done."""
    plain = _OPENERS.sub("", f"{clause} ").strip()
    needless = r"(?:you |there's |there is )?(?:don't need|no need|needn't|don't have|won't (?:even )?(?:need|have))\b"
    return re.match(needless, plain) is not None or re.match(needless, clause) is not None


def time_part(clause: str) -> int:
    """Where a clause begins to say only when: "come up | before you let go"; its length where it does not."""
    match = re.search(r"\b(?:before|after|when|whenever|where|while|once|until|till|as soon as|by the time)\b", clause)
    return match.start() if match else len(clause)


# What a motion leads to anyway: "keep going until it is open".
_REACHED = (
    r"(?:until|till) (?:[\w']+ ){0,6}?(?:open|shut|closed|wide|flat|down|up|off|out|there|flush|click\w*|done|full|"
    r"empty|end|stop|table|bottom|no further|further|way|stays|runs|catches|snaps|locks|latches|lights|starts|snug|"
    r"tight|gone|clean)\b"
)


def ends_when(clause: str) -> str | None:
    """The words of a clause that say when to stop, where what they name is not where the motion leads to anyway; None
    where there are none: "stop as soon as it fits", "keep pulling until it gives"."""
    match = re.search(
        r"\bstop(?:ping)? (?:(?:just|right|only|immediately) )?"
        r"(?:when|before|as soon|once|at|short|after|if|until|till|the moment)\b"
        r"|\b(?:keep|go on|carry on|continue)\b[^;]*?\b(?:until|till)\b",
        clause,
    )
    if match is None or re.search(_REACHED, clause):
        return None
    return clause[match.start() :]


def goes_on_to_end(until: str) -> bool:
    """Whether words beginning with "until" name what the motion leads to anyway."""
    return re.match(_REACHED, until) is not None


def is_request(clause: str, before: bool = True) -> bool:
    """Whether a clause asks for something, rather than telling what happened or why. ``before``: whether the clause
    before it does: "it is heavy and made of glass" goes on telling."""
    plain = _OPENERS.sub("", f"{clause} ").strip()
    if (
        re.fullmatch(r"(?:too|still|so) (?!far|high|low|long|much)\w+", plain)
        or _REASON.match(plain)
        or re.match(r"(?:there's|there is|there are|there was|nearly|almost|missed|not quite$)\b", plain)
    ):
        return False
    if _ASKED_FOR.search(plain) or _WISHED.match(plain) or _BELONGS.match(plain):
        return True
    told_how = re.match(r"(?:you|we) (?:only |just |always |simply )?(\w+)\b(?! (?:\w+ )?too\b)", plain)
    if told_how and told_how.group(1) in _ALL_ACTS - _SAME_IN_PAST:
        return True  # "you turn it clockwise", not "you turned it"
    if re.match(r"(?:you|it|they|he|she|we|i)\b(?!-)", plain):
        return False
    if re.match(r"(?:until|till)\b", plain):
        return before
    subject = _SUBJECT.match(plain)
    if subject is None:
        return True
    first = plain.split()[0]
    if re.match(r"(?:(?:it|that|this|there)|(?:the|my|your|its|that|this) [\w'-]+(?: one| \w+)?) [a-z]+s\b", plain):
        return False
    if re.match(
        r"(?:your|the|my|its|our) [a-z]+s (?!up|down|left|right|first|only|last|further|closer|higher|lower)[a-z]+\b",
        plain,
    ):
        return False
    if not before and re.match(r"[a-z]+s (?:you|it|me|us|the|my|your|them|off|out|over|down)\b", plain):
        return False
    if not before and re.match(r"\w+(?:ed|ing)\b|made\b", first):
        return False
    if first == "not":
        return False  # "not that one, the other": what is wanted stands beside it
    if first in _ALL_ACTS or first in _LIGHT.split() or first in ("don't", "do", "never", "no", "stop", "avoid"):
        return True
    main = plain[: time_part(plain)] or plain
    return _FINITE.search(main, first.find("'") if "'" in first else len(first)) is None


def in_parts(clause: str) -> bool:
    """Whether it asks for one thing after the other, each by itself, which no single motion is."""
    return (
        re.search(
            r"\b(?:(?:one|two|three|\d+) (?:at a time|by one|after the other)|each of|in turn|"
            r"both (?!fingers|sides|hands|ends)\w+s)\b",
            clause,
        )
        is not None
    )


def has_condition(clause: str) -> bool:
    """Whether it says itself that it does not always hold."""
    return _CONDITION.search(clause) is not None


def core(rest: str, own: Collection[str], others: Collection[str], times: bool = True) -> str:
    """A clause's remainder without what only says where or for what, and (``times``) when: "over the bowl", "after
    letting go". ``own`` are words for what the subtask is about, ``others`` for what else is to be seen."""
    if times:
        rest = re.sub(
            r"\b(?:after|before|when|where|while|once|until|till|as) (?:you |it |you're |it's )?[\w' ]*", " ", rest
        )
    rest = re.sub(r"\b(?:mind|watch(?: out for)?|careful (?:with|of)) (?:the|my|your|that|this) \w+", " ", rest)
    rest = re.sub(r"\btry (?:it |that )?(?:again|once more|another time)\b", " ", rest)
    place = r"(?:side|edge|top|front|back|rim|bottom|middle|centre|center|end|inside|outside|wall|surface)"
    of_it = rf"(?:(?:the|its|your|that|this|each) )?(?:{place} of )?(?:(?:the|its|your|that|this|each) )?(?:\w+ )?"
    parts = "|".join(map(re.escape, sorted(own))) or "(?!)"
    rest = re.sub(rf"\b(?:the |its )?{place} of (?:the |its )?(?:\w+ )?(?:{parts})\b", " ", rest)
    for prepositions, things in ((_AT, {*own, "it", "them"}), (f"{_AT}|{_TOUCHING}", others)):
        if things:
            named = "|".join(map(re.escape, sorted(things)))
            rest = re.sub(rf"\b(?:{prepositions}) {of_it}(?:{named})\b", " ", rest)
    return rest


def unread(core: str, kind: str, carried: Collection[str], others: Collection[str]) -> list[str]:
    """Words of a request's remainder (``core``) that say what to do, where, how much or with what: none of them may
    stay unread. ``carried``: kinds of what was read in the clause; "harder" accounts for the "squeeze" before it."""
    own = set(_ACTS.get(kind, "").split()) | set(_LIGHT.split())
    # "pick it up", "take out": the particle belongs to the verb
    verbs = "|".join(sorted(_ALL_ACTS | own))
    core = re.sub(rf"\b({verbs})((?: (?:it|them|this|that|the \w+(?: \w+)?))?) (?:{_PARTICLES})\b", r"\1\2", core)
    core = re.sub(r"^ *(?:lower|raise) (?=it\b|them\b|the\b|that\b)", "bring ", core)
    words = re.findall(r"[a-z][a-z'-]*|\d+(?:\.\d+)?", core)
    found = [w for w in words if w[0].isdigit() or w in _TELLING or w in others]
    if "speed" in carried:  # "up slowly": the way is what the subtask does
        found = [w for w in found if w not in ("up", "down", "out", "back")]
    acts = [w for w in words if (stem := _stem(w)) in _ALL_ACTS and stem not in own]
    for carrier, verbs_of in _CARRIED.items():
        if carrier in carried:
            acts = [w for w in acts if _stem(w) not in verbs_of.split()]
    return [*found, *acts]


def is_act(word: str) -> bool:
    """Whether it is a form of a verb for what a hand does; ``unread`` says which of them had to be read."""
    return _stem(word) in _ALL_ACTS or word in _LIGHT.split()


def is_own_act(word: str, kind: str) -> bool:
    """Whether it is a form of a verb for what a kind of subtask does."""
    return _stem(word) in _ACTS.get(kind, "").split()


def _stem(word: str) -> str:
    for ending in ("ing", "ed", "s"):
        base = word.removesuffix(ending)
        if base != word:
            for candidate in (base, base + "e", base[:-1] if base[-1:] == base[-2:-1] else base):
                if candidate in _ALL_ACTS:
                    return candidate
    return word
