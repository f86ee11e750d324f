"""The scene description, from which every simulator builds; it has no simulator-specific terms.

The world frame is the robot's base frame: x forward, y left, z up; metres, kilograms, radians, newtons. Boxes are given
by their *full* extents. Models and teachers never see it; they see the scene graph.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import attrs

from memo_core.errors import InvalidArgument
from memo_core.scene.mechanisms import Mechanism
from memo_core.scene.pose import Pose

Vector = tuple[float, float, float]
Colour = tuple[float, float, float, float]


def _is_tuple(owner: Any, attribute: attrs.Attribute[Any], value: Any) -> None:
    """Refuse ``(x)`` where ``(x,)`` is meant, while the author's line is in the traceback."""
    if not isinstance(value, (tuple, list)):
        where = f"{type(owner).__name__}.{attribute.name}"
        raise InvalidArgument(where, f"is a {type(value).__name__}", "a tuple; of one thing it has a comma: (x,)")


@attrs.frozen
class Material:
    """Contact properties of a surface. The defaults are measured so that parallel grippers hold small objects. For two
    surfaces in contact, the larger sliding, torsional and rolling friction applies, and the larger number of contact
    dimensions; the softer surface determines the softness of the contact. A gripper's pads slide as both surfaces allow
    (``GripperDescription.friction_on``).
    """

    friction: float = 0.8  # sliding coefficient
    torsional: float = 0.005  # m
    rolling: float = 0.0001  # m
    contact_dimensions: Literal[3, 4, 6] = 4  # 3 sliding, 4 + torsion, 6 + rolling
    softness_s: float = 0.005  # time constant of the contact (s); 0.02 is soft


@attrs.frozen
class Geom:
    """One solid primitive, posed in its body's frame.

    ``size``: box (x, y, z full extents); cylinder and capsule (radius, length along z, for a capsule without the caps);
    sphere (radius,); mesh: (scale,) with ``mesh`` a path to an .stl or .obj file.
    """

    shape: Literal["box", "cylinder", "sphere", "capsule", "mesh"]
    size: tuple[float, ...] = attrs.field(validator=_is_tuple)
    pose: Pose = Pose()
    colour: Colour = (0.7, 0.7, 0.7, 1.0)
    mass: float | None = None  # kg; None: the body's mass is shared by volume
    material: Material = Material()
    collides: bool = True
    mesh: str | None = None


@attrs.frozen
class Free:
    """The body moves freely. ``damping`` (1/s) lets rolling objects come to rest."""

    damping: float = 0.0


@attrs.frozen
class Hinge:
    """The body turns about ``axis`` through ``anchor``, both in the body's own frame."""

    name: str
    axis: Vector
    anchor: Vector = (0.0, 0.0, 0.0)
    range: tuple[float, float] = (0.0, 1.5708)  # rad; 0 is the pose the body is described in
    friction: float = 0.0  # Nm, dry
    damping: float = 0.0  # Nm s/rad
    stiffness: float = 0.0  # Nm/rad, towards ``rest``
    rest: float = 0.0  # rad
    initial: float = 0.0  # rad
    armature: float = 0.005  # kg m2


@attrs.frozen
class Slide:
    """The body slides along ``axis`` of its own frame."""

    name: str
    axis: Vector
    range: tuple[float, float] = (0.0, 0.2)  # m
    friction: float = 0.0  # N, dry
    damping: float = 0.0  # N s/m
    stiffness: float = 0.0  # N/m, towards ``rest``
    rest: float = 0.0  # m
    initial: float = 0.0  # m
    armature: float = 0.01  # kg


Joint = Free | Hinge | Slide


@attrs.frozen
class Latch:
    """A catch that holds a hinge or slide near ``position`` (magnet, ball catch): pulls towards it with at most
    ``effort`` (Nm or N) while the joint is within ``width`` (rad or m) of it, nothing beyond."""

    joint: str
    position: float
    effort: float
    width: float


@attrs.frozen
class Part:
    """A visible part of a body that a person would name: a handle, a rim, a cap. A box in the body's frame."""

    id: str
    label: str
    pose: Pose
    size: Vector  # full extents
    made_of: str = ""  # what it is seen to be made of, if one can see that: "steel", "wood"


@attrs.frozen
class Cavity:
    """The hollow inside of a body, into which objects can be put. A box in the body's frame.

    ``opening``: outward direction of its open face, in the body's frame. ``door``: name of the joint that closes it;
    it counts as closed while that joint is within ``closed_within`` (rad or m) of its ``closed_at`` position.
    Perception reports what is inside, and the inside itself, only while it is not closed.
    """

    id: str
    label: str
    pose: Pose
    size: Vector
    opening: Vector
    door: str | None = None
    closed_at: float = 0.0
    closed_within: float = 0.12


@attrs.frozen
class Body:
    """A rigid body, its joint to its parent (None: fixed), and the bodies attached to it.

    ``label`` is what a person calls it; an empty label means it is not an object by itself (perception ignores it, but
    not over its parts and children). Many small bodies with one common word (marbles, salt) have that word as ``heap``
    and no label: perception reports them as one object where most of them lie together.
    """

    name: str
    geoms: tuple[Geom, ...] = attrs.field(validator=_is_tuple)
    pose: Pose = Pose()
    joint: Joint | None = None
    mass: float | None = None  # kg, without children; None: from the geoms' masses or density 500 kg/m3
    label: str = ""
    parts: tuple[Part, ...] = attrs.field(default=(), validator=_is_tuple)
    cavities: tuple[Cavity, ...] = attrs.field(default=(), validator=_is_tuple)
    bodies: tuple[Body, ...] = attrs.field(default=(), validator=_is_tuple)
    fixture: bool = False  # furniture: seen, but not something one picks up
    heap: str = ""
    made_of: str = ""  # what it is seen to be made of, without its parts: "wood", "glass"; "": nothing one would say


@attrs.frozen
class Camera:
    """A camera; pose in the OpenCV convention (+z forward, +y down), vertical field of view in radians.

    ``link``: the robot link (its name in the URDF) that carries it, such as a wrist camera's hand; ``pose`` is then in
    that link's frame, otherwise in the world's.
    """

    name: str
    pose: Pose
    field_of_view: float = 0.8
    resolution: tuple[int, int] = (640, 480)  # width, height in pixels
    link: str = ""


@attrs.frozen
class SceneDescription:
    """Everything in a scene except the robot. ``table_height`` is the z of the table's top (m).

    Simulators add a solid floor 0.75 m below it and, unless a body is called ``table``, a table whose top (1.6 x 1.6 m,
    x -0.35 to 1.25) is at that height. Bodies joined by a hinge or slide do not collide with each other (nor do bodies
    that are rigidly attached to either); the joint's range limits their motion.
    """

    bodies: tuple[Body, ...] = attrs.field(validator=_is_tuple)
    cameras: tuple[Camera, ...] = attrs.field(default=(), validator=_is_tuple)
    latches: tuple[Latch, ...] = attrs.field(default=(), validator=_is_tuple)
    # Locks and springs that conditions set and release.
    mechanisms: tuple[Mechanism, ...] = attrs.field(default=(), validator=_is_tuple)
    table_height: float = 0.0
    label: str = "table"  # how a person would name the scene; entries carry it
    gravity: float = 9.81  # m/s2
    only_in: str = ""  # the simulator that alone can build it, with the robot it needs, as settings; "": any

    def walk(self) -> Iterator[tuple[Body, Body | None]]:
        """Every body with its parent, parents first."""
        stack: list[tuple[Body, Body | None]] = [(body, None) for body in reversed(self.bodies)]
        while stack:
            body, parent = stack.pop()
            yield body, parent
            stack.extend((child, body) for child in reversed(body.bodies))

    def body(self, name: str) -> Body:
        """The body with this name. Raises ``KeyError`` if there is none."""
        for body, _ in self.walk():
            if body.name == name:
                return body
        raise KeyError(name)
