"""Whether a person's words are about the plan: another thing or place than the one that was chosen, or another step that
comes before, after or instead. Such words are kept as they are, for whoever plans the next step.

They must name one of these, and nothing of how the hand moves, how fast, how hard or where it takes hold.
"""

from __future__ import annotations

import re

# Words for how a step is done.
_MOTION = re.compile(
    r"\b(?:hands?|fingers?|gripper|arm|wrist|elbow|claws?|handle|grip\w*|gr[ae]b\w*|hold\w*|held|squeez\w*|lift\w*|"
    r"lower\w*|rais\w*|tilt\w*|lean\w*|push\w*|press\w*|shov(?:e|ing)\w*|pull\w*|yank\w*|tug\w*|drag\w*|slid\w*|"
    r"turn(?! (?:\w+ ){0,3}(?:on|off)\b)\w*|twist\w*|rotat\w*|flip\w*|fold\w*|screw\w*|unscrew\w*|swing\w*|swung|"
    r"let(?:ting)? (?:it |them )?go|releas\w*|drop\w*|shak\w*|stir\w*|pour\w*|sprinkl\w*|spread\w*|spout|reach\w*|"
    r"touch\w*|aim\w*|wedge\w*|knock\w*|keep|until|till|stop (?!stop|!)\w+|wait\w*|pause|moment|seconds?|"
    r"slow\w*|fast\w*|quick\w*|gent\w*|soft\w*|careful\w*|hard(?:er)?|firm\w*|tight\w*|loos\w*|click\w*|"
    r"up(?! (?:before|first|the))|upwards?|down|higher|deep\w*|further|farther|closer|nearer|sideways|direction|(?<!in your )(?<!in the )way|"
    r"straight\w*|crooked|level|upright|flat|angle|curve|arc|circles?|line|centimet\w*|cm|inch\w*|degrees?|"
    r"edges?|corners?|rim|cent(?:re|er)\w*|middle(?! (?:rack|shelf))|spot|space|over the|only thing|"
    r"from (?:above|below|the (?:top|side|front|back|left|right)))\b"
)
_STEP = (
    r"(?:open|close|shut|lock|unlock|empty|fill|wash|rinse|wet|wring|dry|clean|wipe|clear|take|remove|get|fetch|bring|"
    r"put|start|begin|turn (?:on|off)|switch|check|look|leave|use|scrape|preheat|heat|unplug|undo|tip (?:it|them|that) out|bin|throw|serve|cut|"
    r"peel|stack|pick)"
)
_ORDER = (
    r"first|beforehand|in advance|at the (?:very )?(?:beginning|start)|(?:always|do|that|it) (?:that )?at the end|"
    r"last(?: thing| step)?|afterwards?|one at a time|one by one|two trips|all at once|in one go|"
    r"(?:start|begin|began|started)(?: out)? (?:with|at|from)|the order|in order|sequence|lid on|"
    rf"{_STEP}\b[^.!?;]*\b(?:before|(?:when|once) you're (?:done|finished)|after that|and then)|"
    r"before (?:you|it|the|any|that|putting)|\w+ before \w+$|forg[eo]t\w*|left out|"
    r"never (?:leave|put|use|take)|always (?:start|take|close|empty|put|wash)|check (?:that|the|if)"
)
_COLOUR = r"red|blue|green|yellow|white|black|grey|gray|brown|gold|orange"
_WHICH = (
    r"(?:no|nope),? (?:the )?other \w+|other (?:door|flap|side)|not (?:that|this) one|not that|wrong \w+|"
    r"i (?:want|wanted|meant|mean|said|did mean) (?:the|my|a|left|right|you to take)|th(?:ose|ese) are|"
    r"that(?:'s| is)(?: not)? (?:my|your|our|\w+'s|"
    r"(?:the|an?) (?!bit|lot|little|way|shame|pity|good|nice|start|rim|edge|spout|lid|end|top|bottom)\w+)|"
    r"(?:isn't|is not|not) (?:trash|rubbish|garbage|lonely)|still (?:on|in|out|off|open|there)|missing|"
    r"leave (?:it|that|the \w+|this)(?: \w+)? (?:alone|there|be|where)|instead|"
    r"(?:use|take|get|bring|want|have) (?:me )?(?:an?|the) (?:different|clean|fresh|new|other|glass|big|small)|"
    rf"(?:use|take) (?:the|an?|my) \w+ (?:one|dish)|(?:another|different|clean|glass|{_COLOUR}) one|"
    r"the one (?:closest|next|in front|behind|with|above|below|in|on|at|by)|"
    r"(?:still|hadn't|haven't|not) (?:drinking|eating|using|finished|done)"
)
_THING = r"(?!top\b|its\b|standing|the (?:middle|side|edge)\b)"
_WHERE = (
    r"(?:go(?:es)?|belongs?|lives?|should (?:go|be)|ha(?:s|ve) to go) (?:back )?(?:in|on|into|onto|next|under|at|there|here) "
    rf"{_THING}|\w+ (?:goes|belongs|lives|go|belong|live) (?:on|to) the (?:left|right)|"
    r"(?:big|bigger|biggest|large|largest|small\w*|heav\w+)(?: ones?| things?)? (?:goes |go )?(?:at|on) the (?:bottom|top)|"
    r"(?:middle|top|bottom|upper|lower) (?:rack|shelf)|not (?:in|on|onto|into) (?:there|the|my|that|top)|"
    rf"the (?:{_COLOUR}|other|right|left|lower|upper|top|bottom) (?:one|bin|shelf|door|bag|burner|ring)"
)
_HOW_MUCH = (
    r"we're (?:two|three|four|five|six)|more of|(?:two|three|four|five|six|ten|one) (?:minutes?|will do|more)|"
    r"on (?:two|three|four|five|six|medium|low|high)"
)
_NAMED = re.compile(rf"\b(?:{_ORDER}|{_WHICH}|{_WHERE}|{_HOW_MUCH})\b")
# A step of its own, whatever else the words may mean.
_STEP_FIRST = re.compile(rf"\b(?:forg[eo]t\w* (?:to|the|your)|{_STEP} [^.;!?]*?\b(?:first|beforehand|before)|door first)\b")
_NEXT_STEP = re.compile(r"\bbefore (?:you|your|it|the|that|any)\b[^.,;!?]*|\bbefore \w+ing\b[^.,;!?]*")
_HANDS_FULL = re.compile(r"\b(?:no|one|both|your) hands?(?: are| is)? (?:full|free)\b|\bwith (?:just |only )?one hand\b")


def is_about_plans(words: str, understood: bool) -> bool:
    """``understood``: whether something of the words was understood as a motion."""
    plain = words.lower().replace("’", "'")
    named = _STEP_FIRST if understood else _NAMED
    about_it = _HANDS_FULL.sub("", _NEXT_STEP.sub("before you", plain))
    return named.search(plain) is not None and _MOTION.search(about_it) is None
