"""What people said about plans, as wishes: what is to be done before the rest, and what was left out.

Words of this run (*Just corrected*) are followed. A note from another run or task is followed only where the step that
comes next has to do with what the note names.
"""

from __future__ import annotations

import re

import attrs

from memo_core.plugin import Prompt, SceneGraph
from memo_offline.surroundings import descendants, find

_OPENERS = re.compile(r"^(?:(?:no|but|well|please|hey|and|so|now|then|next time|always|robot)[, ]+)+")
_OBLIGED = (
    r"^(?:(?:you|first|please|now|then|just)[, ]+)*"
    r"(?:(?:have|need|ought|got) to |must |should |forgot to |could |can |want you to |didn't |did not |never )?"
    r"(?:first )?"
)
_FIRST = re.compile(
    r"^(?P<what>.+?),? (?:first|beforehand|before(?: \w[^,;]*)?)$|^first,? (?P<then>.+?)(?:,? (?:and )?then .+)?$"
)
_SHUT = re.compile(r"(?P<what>\bthe (?:\w+ ){0,2}?\w+) is (?:closed|shut), open (?:it|that) first$")
_LEFT_OUT = re.compile(
    r"(?:forgot|forgotten|left out|missed|didn't|did not)(?P<do> to)? (?P<what>.+)"
    r"|(?P<also>.+?) (?:as well|too|also|afterwards|at the end)$"
)


@attrs.frozen
class Remark:
    """A clause that asks for a step. ``before``: of what comes next, else after everything; ``trusted``: said in this
    run, so that nothing else has to speak for it."""

    clause: str
    before: bool
    trusted: bool


def remarks(prompt: Prompt) -> tuple[list[Remark], tuple[str, ...]]:
    """Steps that were asked for, the newest remark first, and plan notes of which no step could be made."""
    said = re.sub(r"^- said of .*$", "", prompt.sections.get("just corrected", ""), flags=re.M)
    words = re.sub(r"^> ?", "", said, flags=re.M).strip()
    found = [one for sentence in reversed(_sentences(words)) for one in _read(sentence, True)]
    missed = []
    notes = prompt.sections.get("what people said about plans", "")
    for line in re.findall(r"^- (?:\[[^\]]*\] )?(.+)$", notes, flags=re.M):
        noted = [one for sentence in _sentences(line) for one in _read(sentence, False)]
        found += noted
        missed += [] if noted else [line]
    return found, tuple(missed)


def asked_in(words: str) -> list[Remark]:
    """The steps that a person's words ask for."""
    return [one for sentence in _sentences(words) for one in _read(sentence, True)]


def concerns(thing: str, objects: tuple[str, ...], scene: SceneGraph) -> bool:
    """Whether a step about ``objects`` has to do with a thing: it is one of them, or a part or the whole of one."""
    node = find(scene, thing)
    if node is None:
        return False
    family = {node.id, *(one.id for one in descendants(scene, node)), *([node.part_of] if node.part_of else [])}
    named = [find(scene, name) for name in objects]
    return any(one is not None and (one.id in family or one.part_of in family) for one in named)


def _sentences(text: str) -> list[str]:
    plain = text.lower().replace("’", "'")
    return [one for part in re.split(r"[.!?;\n]+", plain) if (one := " ".join(part.split()))]


def _read(sentence: str, trusted: bool) -> list[Remark]:
    sentence = _OPENERS.sub("", sentence)
    if shut := _SHUT.search(sentence):  # "the crate is closed, open it first"
        sentence = f"open {shut.group('what')} first"
    first = _FIRST.search(sentence)
    if first:
        return [Remark(_bare(first.group("what") or first.group("then")), True, trusted)]
    left_out = _LEFT_OUT.search(sentence)
    if left_out is None:
        return []
    clause = left_out.group("also") or left_out.group("what")
    # "you forgot the napkin" names a thing, "you forgot to close it" and "you didn't close it" a step
    named = left_out.group("what") and not left_out.group("do") and not re.search(r"did(?:n't| not)", sentence)
    return [Remark(f"forgotten: {clause}" if named else _bare(clause), False, trusted)]


def _bare(clause: str) -> str:
    clause = re.sub(r"\b(?:the|its) (\w+)'s ", r"the \1 ", re.sub(_OBLIGED, "", clause))
    return re.sub(r",$", "", clause).strip()
