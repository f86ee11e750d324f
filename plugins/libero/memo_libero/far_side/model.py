"""Things in a loaded scene, read from the compiled model: rigid pieces, their joints, and the shapes one sees."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

SEEN_GROUP, SOLID_GROUP = 1, 0
_SUPPORTS = ("table", "kitchen_table", "living_room_table", "study_table", "coffee_table", "floor")
_JOINTS = {int(mujoco.mjtJoint.mjJNT_SLIDE): "slide", int(mujoco.mjtJoint.mjJNT_HINGE): "hinge"}
_FREE, _BOX, _MESH = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_MESH)


def described(world: Any) -> dict[str, Any]:
    """Describe a scene, and tell the world which bodies and joints are to be observed.

    Args:
        world: a ``World``.

    Returns:
        JSON values: ``things`` with their ``regions`` (places that the judge uses, in the base's frame) and ``pieces``
            (each in the frame of its first body; the joint's zero is the pose that the model describes), ``cameras``,
            ``base`` (position of the robot's base, world frame), ``table`` (height of what things stand on, world
            frame), ``owners`` (what each body of the model belongs to), ``states`` (number of initial states),
            ``done`` (whether the goal holds at the start) and ``digest``.
    """
    named = [*world.env.objects_dict.items(), *world.env.fixtures_dict.items()]
    things = [_thing(world, name, one, name in world.env.fixtures_dict) for name, one in named]
    pieces = [piece for thing in things for piece in thing["pieces"]]
    world.bodies = [piece["body"] for piece in pieces] + [*world.links, world.hand]
    world.joints = [piece["joint"]["id"] for piece in pieces if piece["joint"]]
    base = world.data.xpos[world.base]
    if np.abs(world.data.xquat[world.base] - (1, 0, 0, 0)).max() > 1e-9:
        raise ValueError("the robot's base is turned in the world")
    return {
        "things": things,
        "cameras": list(_cameras(world)),
        "base": base.tolist(),
        "table": _support(world),
        "owners": _owners(world, pieces),
        "states": world.states,
        "done": world._now,
        "digest": _digest(world),
    }


def _thing(world: Any, name: str, one: Any, fixture: bool) -> dict[str, Any]:
    root = world.id("body", one.root_body)
    return {
        "name": name,
        "category": _categories(world)[name],
        "fixture": fixture,
        "pieces": list(_pieces(world, root, None)),
        "regions": {
            region: (world.data.site_xpos[world.id("site", region)] - world.data.xpos[world.base]).tolist()
            for region, site in world.env.object_sites_dict.items()
            if site.parent_name == name
        },
    }


def _categories(world: Any) -> dict[str, str]:
    """Category of each thing, as the task's file spells it; the suite's classes spell some differently."""
    problem = world.env.parsed_problem
    kinds = (*problem["objects"].items(), *problem["fixtures"].items())
    return {thing: kind for kind, things in kinds for thing in things}


def _pieces(world: Any, body: int, parent: int | None) -> Iterator[dict[str, Any]]:
    """The rigid piece that begins with a body, then those that move against it."""
    model = world.model
    members, movers = _rigid(model, body)
    joint = _joint(world, body)
    yield {
        "body": body,
        "name": world.name("body", body),
        "parent": parent,
        "pose": _pose(model, body, parent, joint),
        "free": _joint_types(model, body) == [_FREE],
        "joint": joint,
        "shapes": list(_shapes(world, body, members)),
        "solids": list(_solids(world, body, members)),
        "members": members,
        "mass": float(model.body_mass[members].sum()),
    }
    for mover in movers:
        yield from _pieces(world, mover, body)


def _rigid(model: Any, body: int) -> tuple[list[int], list[int]]:
    """Bodies that are fixed to a body, itself first, and those that move against it."""
    members: list[int] = [body]
    movers: list[int] = []
    for child in range(body + 1, model.nbody):
        if int(model.body_parentid[child]) in members:
            (movers if model.body_jntnum[child] else members).append(child)
    return members, movers


def _joint_types(model: Any, body: int) -> list[int]:
    first = model.body_jntadr[body]
    return [int(model.jnt_type[first + number]) for number in range(model.body_jntnum[body])]


def _joint(world: Any, body: int) -> dict[str, Any] | None:
    model = world.model
    types = _joint_types(model, body)
    if not types or types == [_FREE]:
        return None
    if len(types) != 1 or types[0] not in _JOINTS:
        raise ValueError(f"body {world.name('body', body)!r} moves in a way that is not known here")
    number = int(model.body_jntadr[body])
    return {
        "id": number,
        "name": world.name("joint", number),
        "kind": _JOINTS[types[0]],
        "axis": model.jnt_axis[number].tolist(),
        "anchor": model.jnt_pos[number].tolist(),
        "range": model.jnt_range[number].tolist(),
        "position": float(world.data.qpos[model.jnt_qposadr[number]]),
    }


def _pose(model: Any, body: int, parent: int | None, joint: dict[str, Any] | None) -> list[float] | None:
    """Pose in the frame of the piece that it moves against, its joint at zero; None for a piece of the world."""
    if parent is None:
        return None
    position, turn = model.body_pos[body].copy(), model.body_quat[body].copy()
    at = int(model.body_parentid[body])
    while at != parent:  # fixed bodies between them
        rotated, turned = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(rotated, position, model.body_quat[at])
        mujoco.mju_mulQuat(turned, model.body_quat[at], turn)
        position, turn = model.body_pos[at] + rotated, turned
        at = int(model.body_parentid[at])
    return [*position.tolist(), *turn.tolist()]


def _shapes(world: Any, frame: int, members: list[int]) -> Iterator[dict[str, Any]]:
    """Boxes around what one sees, along the axes of the piece's frame."""
    for geom in _geoms(world.model, members, SEEN_GROUP):
        points = _in_frame(world, frame, geom, _corners(world.model, geom))
        low, high = points.min(axis=0), points.max(axis=0)
        yield {
            "name": " ".join(_names(world, geom)),
            "capsule": int(world.model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_CAPSULE),
            "centre": ((low + high) / 2).tolist(),
            "size": (high - low).tolist(),
            "colour": _colour(world.model, geom),
        }


def _solids(world: Any, frame: int, members: list[int]) -> Iterator[dict[str, Any]]:
    """Boxes that things collide with, in the piece's frame."""
    model = world.model
    for geom in _geoms(model, members, SOLID_GROUP):
        if int(model.geom_type[geom]) == _BOX and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            middle = _in_frame(world, frame, geom, np.zeros((1, 3)))[0]
            axes = _in_frame(world, frame, geom, np.eye(3)) - middle
            yield {"centre": middle.tolist(), "axes": axes.tolist(), "half": model.geom_size[geom].tolist()}


def _geoms(model: Any, members: list[int], group: int) -> list[int]:
    return [g for g in range(model.ngeom) if int(model.geom_bodyid[g]) in members and model.geom_group[g] == group]


def _corners(model: Any, geom: int) -> np.ndarray:
    """Points (n, 3) in the geom's frame whose box is that of the geom."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _MESH:
        mesh = int(model.geom_dataid[geom])
        first = model.mesh_vertadr[mesh]
        return np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=float)
    half = {
        int(mujoco.mjtGeom.mjGEOM_SPHERE): (size[0],) * 3,
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): (size[0], size[0], size[1] + size[0]),
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): (size[0], size[0], size[1]),
    }.get(kind, tuple(size))
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float) * half


def _in_frame(world: Any, frame: int, geom: int, points: np.ndarray) -> np.ndarray:
    data = world.data
    placed = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return (placed - data.xpos[frame]) @ data.xmat[frame].reshape(3, 3)


def _names(world: Any, geom: int) -> Iterator[str]:
    """Names in the model of a geom, its mesh and its material."""
    yield world.name("geom", geom)
    for kind, number in (("mesh", world.model.geom_dataid[geom]), ("material", world.model.geom_matid[geom])):
        if number >= 0:
            yield world.name(kind, int(number))


def _colour(model: Any, geom: int) -> list[float]:
    """Mean colour that is seen, red, green, blue and opacity."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return [float(value) for value in model.geom_rgba[geom]]
    colour = np.array(model.mat_rgba[material], dtype=float)
    texture = int(np.max(model.mat_texid[material]))  # one a material, or one a role in newer versions
    if texture >= 0:
        colour[:3] *= _mean_of_texture(model, texture)
    return colour.tolist()


def _mean_of_texture(model: Any, texture: int) -> np.ndarray:
    pixels = model.tex_data if hasattr(model, "tex_data") else model.tex_rgb
    channels = int(model.tex_nchannel[texture]) if hasattr(model, "tex_nchannel") else 3
    first, count = int(model.tex_adr[texture]), int(model.tex_height[texture] * model.tex_width[texture])
    return np.asarray(pixels[first : first + count * channels]).reshape(-1, channels)[:, :3].mean(axis=0) / 255


def _cameras(world: Any) -> Iterator[dict[str, Any]]:
    """Position and rotation matrix (OpenGL's axes) of each camera, in the world's or the hand's frame."""
    model, data = world.model, world.data
    for number in range(model.ncam):
        carried = int(model.body_rootid[model.cam_bodyid[number]]) != 0 and int(model.cam_bodyid[number]) > world.base
        frame = world.hand if carried else 0
        rotation = data.xmat[frame].reshape(3, 3)
        yield {
            "name": world.name("camera", number),
            "carried": carried,
            "position": ((data.cam_xpos[number] - data.xpos[frame]) @ rotation).tolist(),
            "rotation": (rotation.T @ data.cam_xmat[number].reshape(3, 3)).tolist(),
            "field_of_view": float(np.radians(model.cam_fovy[number])),
        }


def _support(world: Any) -> float:
    """Height of what things stand on: the median of rays from above that meet it."""
    model, data = world.model, world.data
    bodies = {body for body in range(model.nbody) if world.name("body", body).startswith(_SUPPORTS)}
    geoms = {geom for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) in bodies | {0}}
    met, groups = [], np.array([1, 1, 0, 0, 0, 0], dtype=np.uint8)
    for x in np.linspace(-0.25, 0.25, 11):
        for y in np.linspace(-0.35, 0.35, 11):
            hit = np.array([-1], dtype=np.int32)
            start = np.array([x, y, 2.0])
            away = mujoco.mj_ray(model, data, start, np.array([0.0, 0.0, -1.0]), groups, 1, -1, hit)
            if away >= 0 and int(hit[0]) in geoms:
                met.append(2.0 - away)
    return float(np.median(met))


def _owners(world: Any, pieces: list[dict[str, Any]]) -> list[str]:
    """Owner of each body of the model: ``piece N``, ``robot NAME``, ``table`` or ``floor``."""
    model = world.model
    owners = ["floor"] * model.nbody
    for body in range(1, model.nbody):
        name = world.name("body", body)
        if name.startswith(("robot0_", "gripper0_", "mount0_")):
            owners[body] = f"robot {name}"
        elif name.startswith(_SUPPORTS) and not name.startswith("floor"):
            owners[body] = "table"
    for number, piece in enumerate(pieces):
        for member in piece["members"]:
            owners[member] = f"piece {number}"
    return owners


def _digest(world: Any) -> str:
    """Identifies the model, where its fixtures stand, and the start."""
    names = ("body_pos", "body_quat", "body_mass", "body_inertia", "dof_armature", "dof_damping", "dof_frictionloss")
    shapes = (
        "geom_size",
        "geom_pos",
        "geom_quat",
        "geom_friction",
        "geom_solref",
        "jnt_range",
        "jnt_axis",
        "mesh_vert",
    )
    arrays = [np.asarray(getattr(world.model, name)).tobytes() for name in (*names, *shapes)]
    arrays += [world.physics().tobytes(), mujoco.__version__.encode()]
    return hashlib.sha256(b"".join(arrays)).hexdigest()[:32]
