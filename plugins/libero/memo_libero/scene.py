"""A scene of the suite as MEMO describes scenes: what a camera could see, in boxes, parts and insides."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import (
    Array,
    Body,
    Camera,
    Cavity,
    Free,
    Geom,
    Hinge,
    Part,
    Pose,
    SceneDescription,
    Slide,
    Vector,
    quaternion_from_rotation,
)
from memo_libero.connection import Place
from memo_libero.hollows import Hollow, Solid, hollows
from memo_libero.names import HOLLOW, labels_of, mover_label, space_label
from memo_libero.robot import HAND

LINKS = (*(f"robot/panda_link{number}" for number in range(8)), f"robot/{HAND}")  # observed after the bodies
ONLY_IN = "simulator.backend=libero and robot.backend=libero-panda"
_ACROSS = np.diag((1.0, -1.0, -1.0))  # OpenGL's camera axes to OpenCV's
_LEAST_M = 0.001  # of a box
_CLOSED = {"slide": 0.03, "hinge": 0.12}  # m, rad from the end
_NEAR_PLACE_M = 0.03


@attrs.frozen
class LiberoScene(SceneDescription):
    """A description that only the process it comes from can build."""

    place: Place = attrs.field(kw_only=True)
    python: str = attrs.field(kw_only=True)
    digest: str = attrs.field(kw_only=True)  # of the compiled model
    done: bool = attrs.field(kw_only=True)  # whether the goal holds at the start
    view: View = attrs.field(kw_only=True)


@attrs.frozen
class View:
    """Names and turns of the model's bodies and joints in the description, in the order they are observed.

    ``turns``: each body's frame here in the model's; ``owners``: name of what each body of the model belongs to."""

    base: Vector
    bodies: tuple[str, ...]
    turns: tuple[Pose, ...]
    joints: tuple[str, ...]
    owners: tuple[str, ...]
    cameras: Mapping[str, str]  # name -> the model's


@attrs.frozen
class _Piece:
    """A rigid piece with its name and label. ``turn``: its frame here in the model's; ``start``: its pose there."""

    told: dict[str, Any]
    name: str
    label: str
    turn: Pose
    start: Pose
    thing: dict[str, Any]


def scene_of(told: dict[str, Any], state: Array, place: Place, python: str) -> LiberoScene:
    """Make the description of a loaded scene.

    Args:
        told: what the suite's process says of it (``far_side.model.described``).
        state: poses (n, 7) that it observes at the start: position and quaternion of each body, then of the robot's.
        place: which scene it is.
        python: interpreter of the process.

    Returns:
        The scene, in the robot's base frame.
    """
    labels = labels_of({thing["name"]: thing["category"] for thing in told["things"]}, f"{place.suite}/{place.index}")
    pieces = list(_pieces(told, state, labels))
    table = told["table"] - told["base"][2]
    names = [piece.name for piece in pieces]
    cameras = {_camera_name(camera["name"]): camera for camera in told["cameras"]}
    return LiberoScene(
        bodies=tuple(_body(piece, pieces) for piece in pieces if piece.told["parent"] is None),
        cameras=tuple(_camera(name, camera, told["base"]) for name, camera in cameras.items()),
        table_height=table,
        only_in=ONLY_IN,
        place=place,
        python=python,
        digest=told["digest"],
        done=told["done"],
        view=View(
            base=tuple(told["base"]),
            bodies=tuple(names),
            turns=tuple(piece.turn for piece in pieces),
            joints=tuple(_joint_name(piece) for piece in pieces if piece.told["joint"]),
            owners=tuple(_owner(owner, names) for owner in told["owners"]),
            cameras={name: camera["name"] for name, camera in cameras.items()},
        ),
    )


def _pieces(told: dict[str, Any], state: Array, labels: Mapping[str, str]) -> Iterator[_Piece]:
    taken: set[str] = set()
    observed = iter(state.tolist())
    for thing in told["things"]:
        for piece in thing["pieces"]:
            pose = next(observed)
            start = Pose(tuple(np.subtract(pose[:3], told["base"])), tuple(pose[3:]))
            own = labels[thing["name"]]
            label = own if piece["parent"] is None else mover_label(piece["name"])
            name = (label or f"{own} {piece['name'].removeprefix(thing['name'] + '_')}").replace(" ", "_")
            name = next(one for one in _numbered(name) if one not in taken)
            taken.add(name)
            yield _Piece(piece, name, label, upright(start), start, thing)


def _numbered(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name}_{number}" for number in itertools.count(2))


def upright(start: Pose) -> Pose:
    """The turn by right angles after which a frame's axes are nearest to the base's: z is then up."""
    rotation = start.rotation
    best = max(_right_angles(), key=lambda turn: round(float(np.trace(rotation @ turn)), 6))
    return Pose(orientation=quaternion_from_rotation(best))


def _right_angles() -> Iterator[Array]:
    """The 24 rotations that map axes to axes."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[list(order), range(3)] = signs
            if np.linalg.det(matrix) > 0:
                yield matrix


def _body(piece: _Piece, pieces: Sequence[_Piece], parent: _Piece | None = None) -> Body:
    children = [other for other in pieces if other.told["parent"] == piece.told["body"]]
    handles = [shape for shape in piece.told["shapes"] if _is_handle(shape, piece)]
    return Body(
        name=piece.name,
        geoms=tuple(_geom(shape, piece.turn) for shape in piece.told["shapes"]),
        pose=_placed(piece, parent),
        joint=Free() if piece.told["free"] else _joint(piece),
        mass=piece.told["mass"],
        label=piece.label,
        parts=(_handle(piece, handles),) if handles else (),
        cavities=tuple(_cavities(piece, children)),
        bodies=tuple(_body(child, pieces, piece) for child in children),
        fixture=piece.thing["fixture"] and parent is None,
    )


def _placed(piece: _Piece, parent: _Piece | None) -> Pose:
    if parent is None:
        return piece.start * piece.turn
    told = piece.told["pose"]
    return parent.turn.inverse() * Pose(tuple(told[:3]), tuple(told[3:])) * piece.turn


def _joint(piece: _Piece) -> Hinge | Slide | None:
    told = piece.told["joint"]
    if told is None:
        return None
    back = piece.turn.inverse()
    axis, span, at = _vector(back.apply(told["axis"])), tuple(told["range"]), told["position"]
    span = (min(span[0], at), max(span[1], at))
    if told["kind"] == "hinge":
        return Hinge(_joint_name(piece), axis, _vector(back.apply(told["anchor"])), span, initial=at)
    return Slide(_joint_name(piece), axis, span, initial=at)


def _joint_name(piece: _Piece) -> str:
    return f"{piece.name}/{piece.told['joint']['kind']}"


def _geom(shape: dict[str, Any], turn: Pose) -> Geom:
    size = np.maximum(np.abs(turn.inverse().apply(shape["size"])), _LEAST_M)
    return Geom("box", _vector(size), Pose(_vector(turn.inverse().apply(shape["centre"]))), tuple(shape["colour"]))


def _is_handle(shape: dict[str, Any], piece: _Piece) -> bool:
    return "handle" in shape["name"] or (shape["capsule"] and piece.told["joint"] is not None)


def _handle(piece: _Piece, shapes: Sequence[dict[str, Any]]) -> Part:
    geoms = [_geom(shape, piece.turn) for shape in shapes]
    low = np.min([np.subtract(geom.pose.position, np.array(geom.size) / 2) for geom in geoms], axis=0)
    high = np.max([np.add(geom.pose.position, np.array(geom.size) / 2) for geom in geoms], axis=0)
    label = piece.label.removesuffix(" door") + " handle"
    return Part(label.replace(" ", "_"), label, Pose(_vector((low + high) / 2)), _vector(high - low))


# -- insides ----------------------------------------------------------------------------------------------------------


def _cavities(piece: _Piece, children: Sequence[_Piece]) -> Iterator[Cavity]:
    slides = piece.told["joint"] is not None and piece.told["joint"]["kind"] == "slide"
    most = 1 if slides else HOLLOW.get(piece.thing["category"], 0) if piece.told["parent"] is None else 0
    door = piece if slides else next(iter(children), None)
    for number, hollow in enumerate(hollows(tuple(_solids(piece)), most) if most else ()):
        label = space_label(piece.label, "" if slides else _region(piece, hollow), number)
        cavity = Cavity(label.replace(" ", "_"), label, Pose(hollow.centre), hollow.size, hollow.opening)
        if door is not None:
            within = _CLOSED[door.told["joint"]["kind"]]
            cavity = attrs.evolve(cavity, door=_joint_name(door), closed_within=within)
        yield cavity


def _solids(piece: _Piece) -> Iterator[Solid]:
    back = piece.turn.inverse()
    for one in piece.told["solids"]:
        x, y, z = (_rounded(back.apply(axis)) for axis in one["axes"])
        yield Solid(_rounded(back.apply(one["centre"])), (x, y, z), _rounded(one["half"]))


def _region(piece: _Piece, hollow: Hollow) -> str:
    """End of the name of the suite's place that lies in an inside; empty if there is none."""
    frame = piece.start * piece.turn
    for name, position in piece.thing["regions"].items():
        away = np.abs(frame.inverse().apply(np.array(position)) - np.array(hollow.centre))
        if np.all(away <= np.array(hollow.size) / 2 + _NEAR_PLACE_M) and name.endswith("_region"):
            return name.removeprefix(piece.thing["name"] + "_")
    return ""


# -- cameras and names ------------------------------------------------------------------------------------------------


def _camera_name(name: str) -> str:
    return "wrist" if name.endswith("eye_in_hand") else name.removeprefix("robot0_")


def _camera(name: str, told: dict[str, Any], base: Sequence[float]) -> Camera:
    position = told["position"] if told["carried"] else np.subtract(told["position"], base)
    turned = quaternion_from_rotation(np.array(told["rotation"]) @ _ACROSS)
    link = HAND if told["carried"] else ""
    return Camera(name, Pose(_vector(position), turned), told["field_of_view"], link=link)


def _owner(owner: str, names: Sequence[str]) -> str:
    kind, _, which = owner.partition(" ")
    if kind == "piece":
        return names[int(which)]
    return f"robot/{_link(which)}" if kind == "robot" else kind


def _link(body: str) -> str:
    """Name of the link in our robot of a body of the suite's."""
    for side, finger in (("left", "1"), ("right", "2")):
        if body in (f"gripper0_{side}finger", f"gripper0_finger_joint{finger}_tip"):
            return f"libero_finger{finger}"
    if body.startswith("robot0_link"):
        return body.replace("robot0_link", "panda_link")
    return HAND if body.startswith(("gripper0_", "robot0_right_hand")) else "panda_link0"


def _vector(values: Sequence[float] | Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _rounded(values: Sequence[float] | Array) -> Vector:
    """Rounded to a tenth of a micrometre, so that equal things in different places have equal insides."""
    x, y, z = (round(float(value), 7) for value in values)
    return x, y, z
