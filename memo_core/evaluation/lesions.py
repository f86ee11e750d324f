"""Lesions: a book or a scene damaged on purpose, to see whether a benefit disappears where it should.

A benefit that survives a lesion which should destroy it is a bug in the set-up. Lesions of the book that should
destroy it: ``keys-shuffled``, ``nonsense``, ``opposite``, ``arc-reversed``; parts alone: ``corrections-only``,
``general-only``, ``templates-only``; all but a part: ``no-templates``, ``no-general``. Functions with their calls count
as templates there; on their own they are damaged by ``functions-failing`` and ``calls-shuffled``, left alone by
``function-only`` and left without notes by ``no-function-notes``. Lesions of the scene that should not: ``mirrored``,
``handle_moved``.
"""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.scene.description import Body, Geom, Hinge, SceneDescription, Slide, Vector
from memo_core.scene.pose import Pose
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import further_keys, store
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.entries import Entry, FeedbackKind
from memo_core.skillbook.model.functions import GeneralFunction, as_template, read_call, read_function
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.writing.functions import GroupChange

_DECOYS = (Key("wipe", ("plate",)), Key("stir", ("soup",)), Key("fold", ("towel",)))
_TURNING = {"turn_point": 3, "turn_orientation": 2, "arc_path": 4}  # skill -> place of its angle
_PROGRAMS = ("template", "function", "call")


@attrs.frozen
class Taught:
    """One entry as it goes into the lesioned book, a note with several keys once for each. ``about`` is the key of what
    was said, also for general ones; a function has that of its first source, and is stored under none."""

    kind: str
    about: Key
    text: str
    scene_graph: str = ""  # as it was seen when this was taught


Lesion = Callable[[Sequence[Taught], random.Random], list[Taught]]


def keys_shuffled(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Every entry under a key of another action: on another thing, the same action would still be served as alike.
    General statements go with what they were said about: served everywhere, they would keep what the lesion is to
    take."""
    actions = default_actions()
    keys = list(dict.fromkeys(one.about for one in taught))
    verbs = {key: actions.canonical(key.action) for key in (*keys, *_DECOYS)}
    moved = {key: rng.choice([other for other in verbs if verbs[other] != verbs[key]]) for key in keys}
    return [
        attrs.evolve(one, about=moved[one.about], kind="correction" if one.kind == "general" else one.kind)
        for one in taught
    ]


def nonsense(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Every text with each letter replaced by another at random: equal length, same keys. Calls become templates, since
    what they call is no function any more."""

    def scrambled(text: str) -> str:
        return re.sub(r"[A-Za-z]", lambda _: rng.choice("bcdfghjklmnpqrstvwxz"), text)

    return [attrs.evolve(one, text=scrambled(one.text)) for one in _with_templates(taught)]


def opposite(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """The opposite was taught: each sentence is negated; templates are left out, since no such code was approved."""

    def negated(sentence: str) -> str:
        told_not_to = sentence.lower().startswith("do not ")
        rest = sentence[len("do not ") :] if told_not_to else sentence
        return rest[:1].upper() + rest[1:] if told_not_to else f"Do not {rest[:1].lower()}{rest[1:]}"

    def opposed(text: str) -> str:
        return " ".join(negated(sentence) for sentence in re.split(r"(?<=[.!?])\s+", text.strip()))

    return [attrs.evolve(one, text=opposed(one.text)) for one in taught if one.kind not in _PROGRAMS]


def arc_reversed(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Templates and functions only, each turn in them by the opposite angle: words would tell the right way."""
    programs = [one for one in taught if one.kind in _PROGRAMS]
    return [one if one.kind == "call" else attrs.evolve(one, text=_turned_back(one.text)) for one in programs]


def functions_failing(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Every function raises an error as soon as it is called."""
    return [attrs.evolve(one, text=_failing(one.text)) if one.kind == "function" else one for one in taught]


def calls_shuffled(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Every call under the key of another one; a call that is alone stays."""
    calls = [one for one in taught if one.kind == "call"]
    by = rng.randrange(1, len(calls)) if len(calls) > 1 else 0
    texts = iter([one.text for one in calls[by:] + calls[:by]])
    return [attrs.evolve(one, text=next(texts)) if one.kind == "call" else one for one in taught]


def function_only(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Functions, each with its first call, by whose key it is found."""
    first = {read_call(one.text).function: one for one in reversed(taught) if one.kind == "call"}
    return [one for one in taught if one.kind == "function" or one in first.values()]


def no_function_notes(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """Leave out the corrections under the keys of calls."""
    keys = {one.about for one in taught if one.kind == "call"}
    return [one for one in taught if one.kind != "correction" or one.about not in keys]


def no_functions(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """A template in place of each call, as without consolidation of several keys."""
    return _with_templates(taught)


def _only(*kinds: str) -> Lesion:
    def keep(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
        return [one for one in taught if one.kind in kinds]

    return keep


def _without(*kinds: str) -> Lesion:
    def keep(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
        return [one for one in taught if one.kind not in kinds]

    return keep


def intact(taught: Sequence[Taught], rng: random.Random) -> list[Taught]:
    """No lesion: the effect of copying alone."""
    return list(taught)


OF_FUNCTIONS: dict[str, Lesion] = {
    "functions-failing": functions_failing,
    "calls-shuffled": calls_shuffled,
    "function-only": function_only,
    "no-function-notes": no_function_notes,
    "no-functions": no_functions,
}
LESIONS: dict[str, Lesion] = {
    "intact": intact,
    "keys-shuffled": keys_shuffled,
    "nonsense": nonsense,
    "opposite": opposite,
    "arc-reversed": arc_reversed,
    "corrections-only": _only("correction"),
    "general-only": _only("general"),
    "templates-only": _only(*_PROGRAMS),
    "no-templates": _without(*_PROGRAMS),
    "no-general": _without("general"),
    **OF_FUNCTIONS,
}


def lesioned_copy(book: Skillbook, copy: Skillbook, lesion: str, seed: int = 0) -> list[Taught]:
    """Fill ``copy`` (open, empty) with the lesioned content of ``book``. Returns what it now holds. Raises
    ``UnknownName`` for a lesion that is none, ``InvalidArgument`` for a copy that is not empty."""
    if lesion not in LESIONS:
        raise UnknownName("lesion", lesion, tuple(LESIONS))
    if copy.entries():
        raise InvalidArgument("copy", "this book is not empty", "a new book")
    told = [one for entry in book.entries() for one in _taught(book, entry)]
    damaged = LESIONS[lesion](told, random.Random(seed))
    function_of = {read_function(one.text).name: one.text for one in damaged if one.kind == "function"}
    calls: dict[str, list[tuple[int, str]]] = {}
    for one in damaged:
        if one.kind == "function":
            continue  # stored with its calls
        kind: FeedbackKind = "approval" if one.kind in _PROGRAMS else "correction"
        feedback = copy.record_feedback(
            one.text,
            f"lesion {lesion}",
            subtask=str(one.about),
            scene_graph=one.scene_graph,
            kind=kind,
        )
        if one.kind == "call":
            name = read_call(one.text).function
            entry = copy.add_template(feedback, one.about, as_template(function_of[name], one.text))
            calls.setdefault(name, []).append((entry.id, one.text))
        elif one.kind == "template":
            copy.add_template(feedback, one.about, one.text)
        else:
            notes = ([one.text], []) if one.kind == "correction" else ([], [one.text])
            copy.add_lessons(feedback, one.about, *notes)
    for name, made in calls.items():
        _store_function(copy, function_of[name], made)
    return damaged


def _store_function(copy: Skillbook, code: str, calls: Sequence[tuple[int, str]]) -> None:
    """Put a function with its calls in place of the templates that they are as yet; of several under one key only the
    last is still active."""
    active = {entry.id for entry in copy.entries("template")}
    function = GeneralFunction(code, tuple((entry, call) for entry, call in calls if entry in active))
    store(copy, GroupChange((function,)))


def _taught(book: Skillbook, entry: Entry) -> list[Taught]:
    said = [book.feedback(one) for one in book.sources([entry.id])]
    seen = [one for one in said if one.scene_graph]

    def scene_of(key: Key) -> str:  # of the newest feedback, if possible about this key
        return max(seen, key=lambda one: (one.subtask == str(key), one.id)).scene_graph if seen else ""

    keys = (_about(book, entry), *further_keys(book, entry))
    return [Taught(entry.kind, key, entry.text, scene_of(key)) for key in keys]


def _about(book: Skillbook, entry: Entry) -> Key:
    if entry.key.objects:
        return entry.key
    said = book.sources([entry.id])  # of a merged one, what the first of them was about
    return Key.parse(book.feedback(said[0]).subtask) if said else _DECOYS[0]


def _with_templates(taught: Sequence[Taught]) -> list[Taught]:
    """Put a template in place of each call, and leave out functions."""
    function_of = {read_function(one.text).name: one.text for one in taught if one.kind == "function"}
    return [
        attrs.evolve(one, kind="template", text=as_template(function_of[read_call(one.text).function], one.text))
        if one.kind == "call"
        else one
        for one in taught
        if one.kind != "function"
    ]


def _failing(code: str) -> str:
    """The function with an error raised in its first line; the rest stays as it is written."""
    function = next(node for node in ast.parse(code).body if isinstance(node, ast.FunctionDef))
    docstring, lines = function.body[0], code.splitlines(keepends=True)
    raising = f'{" " * docstring.col_offset}raise RuntimeError("damaged on purpose")\n'
    return "".join([*lines[: docstring.end_lineno], raising, *lines[docstring.end_lineno :]])


def _turned_back(code: str) -> str:
    """Code in which every turn by a computed angle goes the other way. Turns by a fixed angle stay: they probe which
    way is which, and reversing them too would cancel out. Code that turns nothing or does not parse stays as it is."""
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError):
        return code
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _TURNING):
            continue
        place = _TURNING[node.func.id]
        if len(node.args) > place:
            node.args[place] = _negated(node.args[place])
        for keyword in node.keywords:
            if keyword.arg == "angle":
                keyword.value = _negated(keyword.value)
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def _negated(angle: ast.expr) -> ast.expr:
    return angle if isinstance(angle, ast.Constant) else ast.UnaryOp(ast.USub(), angle)


# -- scenes -----------------------------------------------------------------------------------------------------------


class VariedTask(Task):
    """A task whose scene is changed after it was drawn; everything else, the success check too, is the task's own."""

    def __init__(self, task: Task, change: Callable[[SceneDescription], SceneDescription], name: str) -> None:
        self._task = task
        self._change = change
        self.name = f"{task.name}+{name}"
        self.instruction, self.goal = task.instruction, task.goal
        self.kind, self.split, self.time_limit = task.kind, task.split, task.time_limit
        self.settle = task.settle

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        return self._change(self._task.scene(rng))

    def monitors(self) -> tuple[Monitor, ...]:
        return self._task.monitors()

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        return self._task.check(world, monitors)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self._task.check_subtask(subtask, world)


def mirrored(scene: SceneDescription) -> SceneDescription:
    """The scene as a mirror in the plane y = 0 would show it: what hung on the left hangs on the right, and doors turn
    the other way."""
    return attrs.evolve(scene, bodies=tuple(_mirrored_body(body) for body in scene.bodies))


def _mirrored_body(body: Body) -> Body:
    joint = body.joint
    if isinstance(joint, Hinge):
        # An axis is a pseudovector: mirrored, the same turn is about the other components' negatives.
        joint = attrs.evolve(joint, axis=_pseudo(joint.axis), anchor=_vector(joint.anchor))
    elif isinstance(joint, Slide):
        joint = attrs.evolve(joint, axis=_vector(joint.axis))
    return attrs.evolve(
        body,
        pose=_mirrored_pose(body.pose),
        joint=joint,
        geoms=tuple(attrs.evolve(geom, pose=_mirrored_pose(geom.pose)) for geom in body.geoms),
        parts=tuple(attrs.evolve(part, pose=_mirrored_pose(part.pose)) for part in body.parts),
        cavities=tuple(attrs.evolve(c, pose=_mirrored_pose(c.pose), opening=_vector(c.opening)) for c in body.cavities),
        bodies=tuple(_mirrored_body(child) for child in body.bodies),
    )


def _vector(v: Vector) -> Vector:
    return (v[0], -v[1], v[2])


def _pseudo(v: Vector) -> Vector:
    return (-v[0], v[1], -v[2])


def _mirrored_pose(pose: Pose) -> Pose:
    w, x, y, z = pose.orientation
    return Pose(_vector(pose.position), (w, -x, y, -z))


def handle_moved(by: Vector) -> Callable[[SceneDescription], SceneDescription]:
    """The scene with every handle moved by ``by`` (m, in the frame of the body it is on), bar and all."""

    def change(scene: SceneDescription) -> SceneDescription:
        return attrs.evolve(scene, bodies=tuple(_with_handle_moved(body, by) for body in scene.bodies))

    return change


def _with_handle_moved(body: Body, by: Vector) -> Body:
    handles = [part for part in body.parts if "handle" in part.label.split()]

    def belongs(geom: Geom) -> bool:
        return any(
            all(
                abs(v) <= s / 2 + 0.005
                for v, s in zip(part.pose.inverse().apply(geom.pose.position), part.size, strict=True)
            )
            for part in handles
        )

    return attrs.evolve(
        body,
        parts=tuple(attrs.evolve(p, pose=_shifted(p.pose, by)) if p in handles else p for p in body.parts),
        geoms=tuple(attrs.evolve(g, pose=_shifted(g.pose, by)) if belongs(g) else g for g in body.geoms),
        bodies=tuple(_with_handle_moved(child, by) for child in body.bodies),
    )


def _shifted(pose: Pose, by: Vector) -> Pose:
    x, y, z = pose.position
    return Pose((x + by[0], y + by[1], z + by[2]), pose.orientation)
