"""What a template does, matter by matter, as far as its text tells: the docstring of its function is read like what a
person says; its parameters' defaults and the functions it calls say the rest."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable

import attrs

from memo_llm.offline.editing import GENTLE
from memo_llm.offline.edits import Edit
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.vocabulary import Vocabulary

_BY_KIND = {  # edits that are two sides of one matter
    "arc": "path",
    "straight": "path",
    "follow-hand": "turning of the hand",
    "stiff-hand": "turning of the hand",
    "release": "letting go",
    "hold-on": "letting go",
    "open-first": "fingers at first",
    "close-first": "fingers at first",
    "all-the-way": "how far",
    "less-far": "how far",
}
_BY_VALUE = {  # edits whose value is what they want
    "pivot": "edge",
    "hold-at": "place to hold",
    "approach": "side to come from",
    "fingers": "way the fingers close",
    "finger-width": "width of the fingers",
    "way": "direction",
    "offset": "offset",
}
_OPPOSED = {frozenset(pair.split("|")) for pair in ("up|down", "in|out", "left|right", "away|towards", "in|towards")}
_ANGLE_SLACK = 0.2  # share by which angles may differ that are about the same
_VERBS = """
grasp grip grab hold take pull push press lead guide move bring lift raise lower open turn rotate twist tilt swing go
come approach reach let keep back pinch seize squeeze slide put close start follow
"""
_THIRD_PERSON = re.compile(rf"\b({'|'.join(_VERBS.split())})(?:s|es)\b", re.I)
_GENTLE_N, _FIRM_N = 25.0, 50.0
_TURNING = {"turn_point", "turn_about", "sin", "cos", "tan"}
_CALLS = {"top_orientation": ("side to come from", "top"), "align_from_top": ("side to come from", "top")}


@attrs.frozen
class Conduct:
    """``positions`` by matter; a number of degrees for angles, else a word."""

    positions: dict[str, frozenset[str | float]]

    def said(self, matter: str) -> str:
        """For a reason: "path: arc"."""
        return f"has {matter}: {', '.join(sorted(map(str, self.positions[matter])))}"


def conduct_of(template: str, vocabulary: Vocabulary) -> Conduct:
    """Empty for what does not parse."""
    try:
        function = next((n for n in ast.parse(template).body if isinstance(n, ast.FunctionDef)), None)
    except (SyntaxError, ValueError, RecursionError):
        function = None
    if function is None:
        return Conduct({})
    found: dict[str, set[str | float]] = {}
    for matter, does in (*_called(function), *_parameters(function)):
        found.setdefault(matter, set()).add(does)
    told: dict[str, set[str | float]] = {}
    for sentence in re.split(r"(?<=[.!?])\s+|\n+", ast.get_docstring(function) or ""):
        for edit in read_sentence(_told_to(sentence), vocabulary).edits:
            for matter, does in claims(edit) if not edit.negated else ():
                told.setdefault(matter, set()).add(does)
    # What it says of itself is meant; what its calls look like is a guess.
    merged = found | told
    return Conduct({matter: frozenset(positions) for matter, positions in merged.items()})


def _told_to(sentence: str) -> str:
    """A docstring says that a function grasps and leads; people say: grasp, lead."""
    return _THIRD_PERSON.sub(lambda match: match.group(1), sentence)


def claims(edit: Edit) -> list[tuple[str, str | float]]:
    """What an edit wants, by matter; nothing where nothing can be said against it."""
    found: list[tuple[str, str | float]] = []
    if edit.kind in ("angle", "turn-thing") and edit.degrees is not None:
        found.append(("angle", edit.degrees))
    if edit.kind == "turn-thing" and edit.value:
        left = edit.value == "left" or edit.value.startswith(("counter", "anti"))
        found.append(("turn", "counterclockwise" if left else "clockwise"))
    if edit.kind == "force":
        found.append(("force", "gentle" if edit.value in GENTLE else "firm"))
    if edit.kind == "speed":
        found.append(("speed", "slow" if edit.value.startswith("slow") else "fast"))
    if edit.kind == "repeat":
        found.append(("repetition", float(edit.count)))
    if edit.kind in _BY_VALUE and edit.value:
        found.append((_BY_VALUE[edit.kind], edit.value))
    if edit.kind in _BY_KIND:
        found.append((_BY_KIND[edit.kind], edit.kind))
    return found


def disputed(edits: Iterable[Edit], conduct: Conduct) -> str:
    """The first matter in which edits want something else than what the template does; "" where there is none."""
    for edit in edits:
        for matter, wanted in claims(edit):
            theirs = conduct.positions.get(matter, frozenset())
            agrees = any(_same(wanted, one) for one in theirs)
            if edit.negated and agrees and len(theirs) == 1:
                return matter
            if not edit.negated and not agrees and any(_differs(matter, wanted, one) for one in theirs):
                return matter
    return ""


def supported(edits: Iterable[Edit], conduct: Conduct) -> bool:
    """Whether edits want in some matter what the template does."""
    return any(
        not edit.negated and any(_same(wanted, one) for one in conduct.positions.get(matter, frozenset()))
        for edit in edits
        for matter, wanted in claims(edit)
    )


def _same(one: str | float, other: str | float) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return abs(one - other) <= _ANGLE_SLACK * max(abs(one), abs(other))
    return one == other


def _differs(matter: str, one: str | float, other: str | float) -> bool:
    """Unequal words differ in most matters; directions only when one undoes the other."""
    if matter in ("direction", "offset"):
        return frozenset((str(one), str(other))) in _OPPOSED
    return type(one) is type(other) and not _same(one, other)


def _called(function: ast.FunctionDef) -> Iterable[tuple[str, str]]:
    calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
    names = [c.func.id if isinstance(c.func, ast.Name) else getattr(c.func, "attr", "") for c in calls]
    if _TURNING & set(names):
        yield "path", "arc"
    elif "move_straight" in names and "follow_path" not in names:
        yield "path", "straight"
    for name in names:
        if name in _CALLS:
            yield _CALLS[name]
    for call, name in zip(calls, names, strict=True):
        values = [
            node.value for node in [*call.args, *(k.value for k in call.keywords)] if isinstance(node, ast.Constant)
        ]
        if name == "close_gripper" and values and isinstance(values[0], (int, float)):
            yield from _force(float(values[0]))


def _parameters(function: ast.FunctionDef) -> Iterable[tuple[str, str | float]]:
    named = [*function.args.posonlyargs, *function.args.args]
    defaults = zip(named[len(named) - len(function.args.defaults) :], function.args.defaults, strict=True)
    for parameter, default in [*defaults, *zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True)]:
        if not isinstance(default, ast.Constant) or isinstance(default.value, (bool, str)) or default.value is None:
            continue
        value = float(default.value) if isinstance(default.value, (int, float)) else 0.0
        if re.search(r"angle|degrees|_deg\b|\bdeg\b", parameter.arg) and abs(value) > 3.2:
            yield "angle", abs(value)
        elif "force" in parameter.arg or "newton" in parameter.arg:
            yield from _force(value)


def _force(newtons: float) -> Iterable[tuple[str, str]]:
    if newtons <= _GENTLE_N:
        yield "force", "gentle"
    elif newtons >= _FIRM_N:
        yield "force", "firm"
