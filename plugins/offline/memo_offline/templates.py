"""Reading the structure out of a template: which path its hand takes, in which sense, how far.

The template is neither pasted nor trusted: its function is executed in the robot-code sandbox on the scene of the
prompt, with a recorder in place of the robot. The recorded motion of the hand between grasp and release is compared
with the door's geometry, and its structure (arc or line, sense, angle, distance) is adopted. So it does not matter how
the code is written, and a template with a reversed arc leads to reversed code.
"""

from __future__ import annotations

import ast
import math

import attrs
import numpy as np

from memo_core.plugin import Array, Command, Node, Pose, PromptEntry, SceneGraph, quaternion_angle
from memo_offline.imagination import Imagination
from memo_offline.recipe import Recipe
from memo_offline.surroundings import Surroundings, descendants, find, last_word

STRAIGHT = 0.04  # largest sideways deviation over length of a line
TURNS = math.radians(20)


def adopt(
    recipe: Recipe, template: PromptEntry, scene: SceneGraph, objects: tuple[str, ...], imagination: Imagination
) -> Recipe | None:
    """The recipe with the template's structure, or None if the template cannot be used."""
    around = Surroundings.of(scene, recipe.thing, recipe.place)
    if around.thing is None:
        return recipe
    events = imagine(template, scene, objects, imagination)
    if not events:
        return None
    return _shaped(recipe, events, around)


# -- imagining -------------------------------------------------------------------------------------------------------


def imagine(
    template: PromptEntry, scene: SceneGraph, objects: tuple[str, ...], imagination: Imagination
) -> list[Command]:
    """The recorded motion of the hand when the template is called for the prompt's objects; empty if it cannot be
    called."""
    try:
        tree = ast.parse(template.text)
    except (SyntaxError, ValueError):
        return []
    function = next((node for node in tree.body if isinstance(node, ast.FunctionDef)), None)
    if function is None:
        return []
    arguments = _arguments(function, template, scene, objects)
    if arguments is None:
        return []
    call = f"{function.name}({', '.join(f'{k}={v!r}' for k, v in arguments.items())})"
    return imagination.commands(f"{template.text}\n\n{call}\n", scene)


def _arguments(
    function: ast.FunctionDef, template: PromptEntry, scene: SceneGraph, objects: tuple[str, ...]
) -> dict[str, object] | None:
    """Values for the parameters that name things (those of the template's own scene are not in this one)."""
    parameters = [*function.args.posonlyargs, *function.args.args]
    defaults: list[ast.expr | None] = [None] * (len(parameters) - len(function.args.defaults)) + list(
        function.args.defaults
    )
    pairs = [
        *zip(parameters, defaults, strict=True),
        *zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True),
    ]
    old = [part.strip() for part in template.key.partition("(")[2].rstrip(")").split(",") if part.strip()]
    free = list(objects)
    values: dict[str, object] = {}
    for parameter, default in pairs:
        said = default.value if isinstance(default, ast.Constant) else None
        if default is not None and not isinstance(said, str):
            continue  # an amount keeps its default
        node = _counterpart(str(said or ""), parameter.arg, old, objects, scene)
        if node is not None:
            values[parameter.arg] = node.label
        elif default is None and free:
            values[parameter.arg] = free.pop(0)
        elif default is None:
            return None
    return values


def _counterpart(said: str, parameter: str, old: list[str], new: tuple[str, ...], scene: SceneGraph) -> Node | None:
    """The object here with the role that ``said`` had in the template's own scene."""
    mapped = said
    for before, now in zip(old, new, strict=False):
        mapped = mapped.replace(before, now)
    try:
        return scene.node(mapped)
    except Exception:  # an unknown name: look for a part of that kind instead
        pass
    thing = find(scene, new[0]) if new else None
    if thing is None:
        return None
    words = [last_word(said)] if said else [w for w in parameter.lower().split("_") if w]
    family = [thing, *descendants(scene, thing)]
    around = Surroundings.of(scene, thing.label, None)
    for word in reversed(words):
        if word == "handle" and around.handle is not None:
            return around.handle
        for node in family:
            if last_word(node.label) == word:
                return node
    if "door" in words and around.door is not None:
        return around.door
    return (around.door if old and said and said != old[0] else None) or thing


# -- from what the hand did to structure ------------------------------------------------------------------------------


def _shaped(recipe: Recipe, events: list[Command], around: Surroundings) -> Recipe:
    _, gripped = _held_path(events)
    before = events[:gripped]
    opened = [event for event in before if event.kind == "open"]
    changes: dict[str, object] = {}
    if opened:
        width = opened[-1].amount
        changes["opening"] = None if width is None or width >= 0.08 else width
    elif "open-hand" in recipe.steps[:1]:
        changes["steps"] = recipe.steps[1:]
    recipe = attrs.evolve(recipe, **changes)  # type: ignore[arg-type]
    if recipe.kind in ("place", "pick"):
        return recipe
    return path_shaped(recipe, events, around) or recipe


def path_shaped(recipe: Recipe, events: list[Command], around: Surroundings) -> Recipe | None:
    """The recipe with the shape, sense and length of the path that something held is led along; None without one."""
    held, _ = _held_path(events)
    if len(held) < 2:
        return None
    points = np.array([pose.position for pose in held])
    turned = quaternion_angle(held[0].orientation, held[-1].orientation)
    if _bend(points) <= STRAIGHT:
        return _straight(recipe, points, around)
    return _arc(recipe, points, turned, around)


def _held_path(events: list[Command]) -> tuple[list[Pose], int]:
    """Poses from the first closing at a place the hand approached until the fingers open again."""
    for i, event in enumerate(events):
        if event.kind == "close" and any(e.kind == "go" for e in events[:i]):
            path = [event.pose]
            for later in events[i + 1 :]:
                if later.kind != "go":
                    break
                path.append(later.pose)
            if len(path) > 1:
                return path, i
    return [], len(events)


def _bend(points: Array) -> float:
    chord = points[-1] - points[0]
    length = float(np.linalg.norm(chord))
    if length < 1e-6:
        return 1.0
    offsets = points - points[0]
    sideways = offsets - np.outer(offsets @ chord / length**2, chord)
    return float(np.linalg.norm(sideways, axis=1).max()) / length


def _out(around: Surroundings) -> Array | None:
    door = around.door or around.thing
    if door is None or around.handle is None:
        return None
    offset = np.asarray(around.handle.pose.position) - np.asarray(door.pose.position)
    axes = door.pose.rotation.T
    shares = [float(offset @ axis) / size for axis, size in zip(axes, door.size, strict=True)]
    best = int(np.argmax(np.abs(shares)))
    return np.sign(shares[best]) * axes[best]


def _straight(recipe: Recipe, points: Array, around: Surroundings) -> Recipe:
    out = _out(around)
    line = points[-1] - points[0]
    length = float(np.linalg.norm(line))
    if length < 1e-3:
        return recipe
    ways = {"up": (0, 0, 1), "down": (0, 0, -1), "left": (0, 1, 0), "right": (0, -1, 0)}
    directions = {name: np.asarray(v, dtype=float) for name, v in ways.items()}
    if out is not None:
        directions |= {"out": out, "in": -out}
    way = max(directions, key=lambda name: float(directions[name] @ line))
    return attrs.evolve(recipe, shape="straight", way=way, distance=round(length, 3))


def _arc(recipe: Recipe, points: Array, turned: float, around: Surroundings) -> Recipe:
    """Fit a circle in the path's plane; compare its first motion with the way out. A path on a line is no arc."""
    if (circle := _circle(points)) is None:
        return _straight(recipe, points, around)
    centre, axis = circle
    start, end = points[0] - centre, points[-1] - centre
    mid = points[len(points) // 2] - centre
    angle = _angle_between(start, mid) + _angle_between(mid, end)
    out = _out(around)
    sense = 1
    if out is not None:
        tangent = np.cross(axis, start)
        if tangent @ (points[1] - points[0]) < 0:
            tangent = -tangent
        # A first motion into the thing is the other way round.
        sense = 1 if tangent @ out > 0 else -1
    pivot = "far"
    if out is not None and around.handle is not None and (around.door or around.thing) is not None:
        door = around.door or around.thing
        assert door is not None
        towards_middle = np.asarray(door.pose.position) - np.asarray(around.handle.pose.position)
        across = -start - (-start @ out) * out
        if across @ (towards_middle - (towards_middle @ out) * out) < 0:
            pivot = "near"
    return attrs.evolve(
        recipe, shape="arc", angle=round(math.degrees(angle), 1), sense=sense, pivot=pivot, hand_follows=turned > TURNS
    )


def _circle(points: Array) -> tuple[Array, Array] | None:
    """(centre, unit normal) of the circle through the first, middle and last point; None if they are on a line."""
    a, b, c = points[0], points[len(points) // 2], points[-1]
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    n2 = float(normal @ normal)
    if n2 < 1e-12:
        return None
    centre = a + (np.cross(normal, ab) * (ac @ ac) + np.cross(ac, normal) * (ab @ ab)) / (2 * n2)
    return centre, normal / math.sqrt(n2)


def _angle_between(a: Array, b: Array) -> float:
    cosine = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.acos(max(-1.0, min(1.0, cosine)))
