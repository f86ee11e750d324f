"""What every simulator derives from a scene description before building it: checks, masses, pairs that do not
collide."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Body, Geom, Hinge, SceneDescription, Slide
from memo_core.scene.pose import Pose

DENSITY = 500.0  # kg/m3, of bodies that state no mass
FLOOR_DEPTH = 0.75  # m below the table's top
_SIZES = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "mesh": 1}


def check_scene(scene: SceneDescription) -> None:
    """Check that a scene can be built, except for its mechanisms (``Mechanisms`` checks those).

    Args:
        scene: description to check.

    Raises:
        InvalidArgument: if the name of a body, joint or camera is not unique or is reserved (``world``, ``floor``,
            ``robot/…``), a moving body has no geoms, an attached body moves freely, a geom's size does not fit its
            shape, a joint has no axis, an empty range or a start outside its range, or a latch names an unknown joint
            or has no width or effort; and for a scene that another simulator alone can build (``only_in``).
    """
    if scene.only_in:
        raise InvalidArgument(
            "simulator.backend", "cannot build this scene, which comes with a simulator", scene.only_in
        )
    _check_names(scene)
    for body, parent in scene.walk():
        where = f"scene body {body.name!r}"
        if body.joint is not None and not body.geoms:
            raise InvalidArgument(where, "moves but has no geoms", "at least one geom, or no joint")
        if parent is not None and body.joint is not None and not isinstance(body.joint, (Hinge, Slide)):
            raise InvalidArgument(
                where, f"moves freely but is attached to {parent.name!r}", "a body of the scene itself"
            )
        for geom in body.geoms:
            check_size(geom, where)
        if isinstance(body.joint, (Hinge, Slide)):
            _check_joint(body.joint)
    for latch in scene.latches:
        if latch.width <= 0 or latch.effort <= 0:
            raise InvalidArgument(f"latch on {latch.joint!r}", "has no width or effort", "both more than 0")


def _check_names(scene: SceneDescription) -> None:
    bodies: set[str] = set()
    joints: set[str] = set()
    for body, _ in scene.walk():
        if not body.name or body.name in bodies or body.name in ("world", "floor") or body.name.startswith("robot/"):
            raise InvalidArgument(
                "scene", f"two bodies, or one and the house, are called {body.name!r}", "unique names"
            )
        bodies.add(body.name)
        if isinstance(body.joint, (Hinge, Slide)):
            if body.joint.name in joints or body.joint.name.startswith("robot/"):
                raise InvalidArgument("scene", f"two joints are called {body.joint.name!r}", "unique names")
            joints.add(body.joint.name)
    for latch in scene.latches:
        if latch.joint not in joints:
            known = ", ".join(sorted(joints)) or "none"
            raise InvalidArgument(
                "scene", f"a latch is on the joint {latch.joint!r}, which does not exist", f"one of {known}"
            )
    cameras = [camera.name for camera in scene.cameras]
    if len(set(cameras)) != len(cameras):
        raise InvalidArgument("scene", "two cameras have the same name", "unique names")


def _check_joint(joint: Hinge | Slide) -> None:
    where = f"joint {joint.name!r}"
    if math.sqrt(sum(v * v for v in joint.axis)) < 1e-9:
        raise InvalidArgument(where, "its axis has no length", "a direction such as (0, 0, 1)")
    if joint.range[0] >= joint.range[1]:
        raise InvalidArgument(where, f"its range {joint.range} is empty", "(lower, upper)")
    if not joint.range[0] <= joint.initial <= joint.range[1]:
        raise InvalidArgument(where, f"starts at {joint.initial}, outside {joint.range}", "a start inside its range")


def check_size(geom: Geom, where: str) -> None:
    """Check that a geom's shape exists and that its size fits the shape.

    Args:
        geom: geom to check.
        where: name of its owner for the error message, such as ``scene body 'cup'``.

    Raises:
        InvalidArgument: if the shape is unknown, or the size is not the right count of positive numbers.
    """
    if geom.shape not in _SIZES:
        raise InvalidArgument(where, f"unknown shape {geom.shape!r}", ", ".join(_SIZES))
    if len(geom.size) != _SIZES[geom.shape] or min(geom.size) <= 0:
        raise InvalidArgument(where, f"a {geom.shape} of size {geom.size}", f"{_SIZES[geom.shape]} positive numbers")


def default_table(height: float) -> Body:
    """Table that simulators add to a scene without a body called ``table``.

    Args:
        height: z of the table's top (m, base frame).

    Returns:
        A fixed body called ``table``: a top of 1.6 x 1.6 x 0.04 m whose upper face is centred at (0.45, 0, ``height``)
            (m, base frame), and four legs to ``FLOOR_DEPTH`` below that face, which do not collide.
    """
    legs = FLOOR_DEPTH - 0.04
    grey = (0.55, 0.56, 0.58, 1.0)
    return Body(
        "table",
        (
            Geom("box", (1.6, 1.6, 0.04), Pose((0.0, 0.0, -0.02)), (0.80, 0.69, 0.54, 1.0)),
            *(
                Geom("box", (0.06, 0.06, legs), Pose((x, y, -0.04 - legs / 2)), grey, collides=False)
                for x in (-0.72, 0.72)
                for y in (-0.72, 0.72)
            ),
        ),
        Pose((0.45, 0.0, height)),
    )


def masses(body: Body, mesh_volume: Callable[[str], float]) -> tuple[float, ...]:
    """Masses of a body's geoms (kg): stated masses are kept, and the rest of the body's mass is shared by volume.

    In a body without a mass, geoms without one have a density of 500 kg/m3. Decoration (geoms that do not collide)
    without a stated mass has none, unless the body consists of decoration. If every other geom states a mass and the
    body does too, the geoms' masses are scaled to sum to the body's.

    Args:
        body: body whose geoms are weighed, without the bodies attached to it.
        mesh_volume: returns the volume (m3) that a mesh file encloses at scale 1, given the file's path.

    Returns:
        One mass for each of ``body.geoms``, in their order.

    Raises:
        InvalidArgument: if the body's mass leaves nothing for the geoms without a stated mass.
    """
    volumes = [volume(geom, mesh_volume) if geom.mass is None and geom.collides else 0.0 for geom in body.geoms]
    stated = sum(geom.mass for geom in body.geoms if geom.mass is not None)
    if sum(volumes) == 0.0 and stated == 0.0:
        volumes = [volume(geom, mesh_volume) for geom in body.geoms]
    density = DENSITY
    if body.mass is not None and sum(volumes) > 0:
        if body.mass <= stated:
            problem = f"weighs {body.mass} kg, its geoms alone {stated} kg"
            raise InvalidArgument(f"scene body {body.name!r}", problem, "more than its geoms state, or no mass")
        density = (body.mass - stated) / sum(volumes)
    scale = 1.0
    if body.mass is not None and sum(volumes) == 0 and stated > 0:
        scale = body.mass / stated
    return tuple(
        density * one if geom.mass is None else geom.mass * scale for geom, one in zip(body.geoms, volumes, strict=True)
    )


def volume(geom: Geom, mesh_volume: Callable[[str], float]) -> float:
    """m3."""
    size = geom.size
    if geom.shape == "box":
        return size[0] * size[1] * size[2]
    if geom.shape == "cylinder":
        return math.pi * size[0] ** 2 * size[1]
    if geom.shape == "sphere":
        return 4 / 3 * math.pi * size[0] ** 3
    if geom.shape == "capsule":
        return math.pi * size[0] ** 2 * size[1] + 4 / 3 * math.pi * size[0] ** 3
    return mesh_volume(str(geom.mesh)) * size[0] ** 3


def joined_pairs(scene: SceneDescription) -> Iterator[tuple[str, str]]:
    """Pairs of bodies that must not collide because a hinge or slide joins them.

    Args:
        scene: scene whose bodies are paired.

    Yields:
        (name, name): a body on the parent's side of a joint and a body on the child's side; bodies rigidly attached to
        either count too.
    """
    group: dict[str, str] = {}
    joined: list[tuple[str, str]] = []
    for body, parent in scene.walk():
        group[body.name] = group[parent.name] if parent is not None and body.joint is None else body.name
        if parent is not None and isinstance(body.joint, (Hinge, Slide)):
            joined.append((group[parent.name], body.name))
    members: dict[str, list[str]] = {}
    for name, root in group.items():
        members.setdefault(root, []).append(name)
    for first, second in joined:
        for one in members[first]:
            for other in members[second]:
                yield one, other


def families(scene: SceneDescription) -> dict[str, frozenset[str]]:
    """Names of each body's subtree.

    Args:
        scene: scene whose bodies are listed.

    Returns:
        Body name -> its own name and those of all bodies attached to it, directly or through others.
    """
    found = {body.name: {body.name} for body, _ in scene.walk()}
    pairs = [(body.name, parent.name) for body, parent in scene.walk() if parent is not None]
    for child, parent in reversed(pairs):
        found[parent] |= found[child]
    return {name: frozenset(names) for name, names in found.items()}
