"""Whether a person's words are about the plan: another thing or place than was chosen, or another step before, after or
instead of this one. Such words are kept as they are, for whoever plans the next step.

They must name one of these, and nothing of how the hand moves, how fast, how hard or where it takes hold.
"""

from __future__ import annotations

import re

# Words for how a step is done.
_MOTION = re.compile(
    r"\b(?:hands?|fingers?|gripper|arm|wrist|elbow|claws?|handle|grip\w*|gr[ae]b\w*|hold\w*|held|squeez\w*|lift\w*|"
    r"lower(?! (?:rack|shelf|door|one)\b)\w*|rais\w*|tilt\w*|lean\w*|push\w*|press\w*|shov(?:e|ing)\w*|pull\w*|"
    r"yank\w*|tug\w*|drag\w*|slid\w*|"
    r"turn(?!(?:ed|ing)? (?:\w+ ){0,3}(?:on|off)\b)\w*|twist\w*|rotat\w*|flip\w*|fold\w*|screw\w*|unscrew\w*|swing\w*|"
    r"swung|let(?:ting)? (?:it |them )?go|releas\w*|drop\w*|shak\w*|stir\w*|pour\w*|sprinkl\w*|spread\w*|spout|"
    r"reach\w*|touch\w*|aim\w*|wedge\w*|knock\w*|keep|until|till|stop (?!stop|!)\w+|wait(?!,)\w*|pause|moment|seconds?|"
    r"slow\w*|fast\w*|quick\w*|gent\w*|soft\w*|careful\w*|hard(?:er)?|firm\w*|tight\w*|loos\w*|click\w*|"
    r"(?<!crumpled )(?<!screwed )(?<!scrunched )up(?! (?:before|first|the|there|one|bit))|upwards?|"
    r"down(?! (?:there|at|in the))|higher|deep\w*|further|farther|closer|nearer|sideways|"
    r"direction|(?<!your )(?<!in the )(?<!of the )way(?! too)|straight\w*|crooked|level|upright|angle|curve|arc|"
    r"circles?|line|centimet\w*|cm|inch\w*|degrees?|edges?|corners|corner of|rim|"
    r"cent(?:re|er)\w*|middle(?! (?:rack|shelf))|(?<!all )over the|only thing|if (?:the|it|they|there)|"
    r"from (?:above|below|the (?:top|side|front|back|left|right)))\b"
)
_STEP = (
    r"(?:open|close|shut|lock|unlock|empty|fill|wash|rinse|wet|wring|dry|clean|wipe|clear|take|remove|get|fetch|bring|"
    r"put|start|begin|turn (?:on|off)|switch|check|look|leave|use|scrape|preheat|heat|unplug|undo|"
    r"tip (?:it|them|that) out|bin|throw|serve|cut|peel|stack|pick|turn (?:it|that|the \w+) (?:on|off))"
)
_ORDER = (
    r"first|beforehand|in advance|at the (?:very )?(?:beginning|start)|(?:always|do|that|it) (?:that )?at the end|"
    r"last(?: thing| step)?|afterwards?|one (?:\w+ )?at a time|one by one|two trips|all at once|in one go|"
    r"(?:start|begin|began|started)(?: out)? (?:with|at|from)|the order|in order|sequence|lid on|"
    rf"{_STEP}\b[^.!?;]*\b(?:before|(?:when|once) you(?:'re|'ve| are| have) (?:done|finished)|after that|and then)|"
    r"before (?:you|it|the|any|that|putting)|\w+ before \w+$|forg[eo]t\w*|left out|"
    r"never (?:leave|put|use|take)|always (?:start|take|close|empty|put|wash)|check (?:that|the|if)"
)
_COLOUR = r"red|blue|green|yellow|white|black|grey|gray|brown|gold|orange"
_NO_THING = r"bit|lot|little|way|shame|pity|good|nice|start|rim|edge|spout|lid|end|top|bottom"
_WHICH = (
    r"(?:no|nope),? (?:the )?other \w+|other (?:door|flap|side)|not (?:that|this) one|not that|wrong (?!way)\w+|"
    r"i (?:want|wanted|meant|mean|said|did mean) (?:the|my|a|left|right|you to take)|th(?:ose|ese) are|"
    rf"that(?:'s| is)(?: not)? (?:my|your|our|\w+'s|(?:the|an?) (?!{_NO_THING})\w+)|"
    r"(?:isn't|is not|not) (?:trash|rubbish|garbage|lonely)|still (?:on|in|out|off|open|there)|missing|"
    r"leave (?:it|that|the \w+|this)(?: \w+)? (?:alone|there|be|where)|instead|only take|"
    r"(?<!i )use (?:the|an?|my) (?!handle|side|edge|tip|rim|end|full|whole|other)\w+|"
    r"(?:take|get|bring|want|have) (?:me )?(?:an?|the) (?:different|clean|fresh|new|other|glass|big|small)|"
    rf"take (?:the|an?|my) \w+ (?:one|dish)|(?:another|different|clean|glass|{_COLOUR}) one|the one (?:closest|next|"
    r"sitting|standing|lying|that's|all|over|in front|behind|with|above|below|in|on|at|by)|"
    r"(?:still|hadn't|haven't|wasn't|not) (?:drinking|eating|using|finished|done)|"
    rf"(?:the \w+ one|\w+)'s (?:the (?:{_COLOUR}|one)|just (?:below|above|next|behind))"
)
_GOES = r"go(?:es)?|belongs?|lives?|should (?:go|be)|ha(?:s|ve) to go"
_WHERE = (
    rf"(?:{_GOES}) (?:back )?(?:in|on|into|onto|next|under|at|there|here) "
    r"(?!top\b|its\b|standing|the (?:middle|side|edge)\b)|"
    r"(?!it|that)\w+(?:'s| goes| belongs| lives| go| belong| live) (?:on|to) the (?:left|right)|"
    r"(?:big|large|small|heav)\w*(?: ones?| things?)? (?:go(?:es)? )?(?:at|on) the (?:bottom|top)|"
    r"(?:middle|top|bottom|upper|lower) (?:rack|shelf)|"
    r"not (?:in|on|onto|into) (?:there|the|my|that|top|it|them)|not (?:behind|beside|next to) (?:it|them|the)|"
    r"put (?:it|them|that|those) back|(?:put|get|take|bring) (?:it|them|that|those)(?: \w+){0,3} (?:too|as well)|"
    r"don't (?:set|put|place|lay) (?:it|them|that) (?:on|in|under)|"
    rf"the (?:{_COLOUR}|other|right|left|lower|upper|top|bottom) (?:one|bin|shelf|door|bag|burner|ring)"
)
_COUNT = r"one|two|three|four|five|six|ten"
_HOW_MUCH = (
    rf"we're (?:{_COUNT})|more of|(?:{_COUNT}) (?:minutes?|will do|more(?! (?:\w+ )?(?:times|turns?|shakes|goes)))|"
    rf"(?:on|(?:set|put) it to) (?:{_COUNT}|medium|low|high|full)|full blast|medium"
)
_NAMED = re.compile(rf"\b(?:{_ORDER}|{_WHICH}|{_WHERE}|{_HOW_MUCH})\b")
# A step of its own, whatever else the words may mean.
_OWN_STEP = re.compile(
    rf"\b(?:{_STEP} [^.;!?]*?\b(?:first|beforehand|before|when you're (?:done|finished))|"
    r"forg[eo]t\w* (?:to|the|your|some|one|two)|you're not (?:done|finished)|door first|"
    r"one (?:\w+ )?at a time|(?<!it )stays? (?:put|where it is)|"
    r"(?:start|begin) with (?:the|what)|(?:middle|top|bottom|upper|lower) (?:rack|shelf)|"
    rf"turn (?:it|that|the \w+) (?:down|up) to (?:about )?(?:{_COUNT}|medium|low|high))\b"
)
_NEXT_STEP = re.compile(r"\bbefore (?:you|your|it|the|that|any|\w+ing)\b[^.,;!?]*")
_NO_MOTION = re.compile(
    r"\b(?:(?:no|one|both|your) hands?(?: are| is)? (?:full|free)|(?:with|got) (?:just |only )?one hand|mixed up|"
    r"pick\w*(?: \w+)? up|turn (?:it|that|the \w+) (?:down|up) to|(?:other|(?:those|them) the wrong) way a?round)\b"
)
# Carrying in place of pushing is another step, however it is said.
_CARRY = r"pick (?:it|them|that) up"
_SHOVE = r"(?:push|drag|shov)\w*"
_CARRY_INSTEAD = re.compile(
    rf"\b{_CARRY}\b.*\b(?:instead of|rather than|don't|not) {_SHOVE}|"
    rf"\b(?:instead of|rather than|don't|not) {_SHOVE}\b.*\b{_CARRY}\b"
)


def is_about_plans(words: str, understood: bool) -> bool:
    """``understood``: whether something of the words was understood as a motion; then a step of its own must be
    named."""
    plain = words.lower().replace("’", "'")
    if _CARRY_INSTEAD.search(plain):
        return True
    named = _OWN_STEP if understood else _NAMED
    return named.search(plain) is not None and _MOTION.search(_NO_MOTION.sub("", _NEXT_STEP.sub("", plain))) is None
