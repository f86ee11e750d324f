"""The furniture of the tasks: cabinets with a door on one of their edges, a chest with a drawer, a stand.

A piece stands with the middle of its front's lower edge at ``place`` and faces the robot: its own x axis points away
from the robot, y to the left. Dimensions were chosen so that a Panda can use them (see docs/tasks.md).
"""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.plugin import Body, Cavity, Colour, Geom, Hinge, Material, Part, Pose, Slide, Vector, bar, inside, shell

WALL = 0.012  # m
PANEL = 0.018  # m, thickness of doors and drawer fronts
GAP = 0.003  # m around a closed door, so that it rubs neither on the shell nor on what the furniture stands on
BAR_RADIUS = 0.009  # m
WHITE: Colour = (0.93, 0.93, 0.92, 1.0)
STEEL: Colour = (0.62, 0.64, 0.67, 1.0)
DARK: Colour = (0.20, 0.21, 0.24, 1.0)
WOOD: Colour = (0.62, 0.45, 0.29, 1.0)

GLASS: Colour = (0.06, 0.08, 0.11, 1.0)

Edge = Literal["left", "right", "bottom"]


@attrs.frozen
class Handle:
    """A round bar before a door or drawer front. ``inset`` is from the edge opposite the hinge to the bar's axis."""

    length: float
    distance: float  # m, from the bar's axis to the face
    inset: float = 0.03
    height: float | None = None  # m, of the bar's middle above the lower edge; None: the middle of an upright door
    radius: float = BAR_RADIUS
    friction: float = 0.8


@attrs.frozen
class DoorHinge:
    """The hinge of a door: edge, friction and damping."""

    edge: Edge
    opens_to: float  # rad
    friction: float = 1.0  # Nm, dry
    damping: float = 1.0  # Nm s/rad
    mass: float = 1.0  # kg of the door
    window: bool = False


def cabinet(
    name: str,
    place: Vector,
    yaw: float,
    size: Vector,
    hinge: DoorHinge,
    handle: Handle,
    colour: Colour,
    door_colour: Colour,
    made_of: str = "",
) -> Body:
    """A hollow box with a door in front, both ``made_of`` one material. ``size`` is (depth, width, height); its hinge
    joint is ``NAME/hinge``."""
    centre, extents, opening = inside(size, WALL)
    joint = f"{name}/hinge"
    return Body(
        name=name,
        label=name,
        fixture=True,
        geoms=shell(size, WALL, colour=colour),
        pose=Pose.from_yaw(place, yaw),
        cavities=(Cavity(f"{name}/inside", f"{name} inside", Pose(centre), extents, opening, joint),),
        bodies=(attrs.evolve(_door(name, size, hinge, handle, joint, door_colour), made_of=made_of),),
        made_of=made_of,
    )


def _door(name: str, size: Vector, hinge: DoorHinge, handle: Handle, joint: str, colour: Colour) -> Body:
    """The door's frame lies in the middle of its hinged edge, just before the shell's front."""
    _, width, height = size
    extents = (PANEL, width, height - 2 * GAP)
    if hinge.edge == "bottom":
        pose, axis = Pose((-GAP, 0.0, 0.0)), (0.0, -1.0, 0.0)
        panel = Pose((-PANEL / 2, 0.0, height / 2))
        grip, along = (0.0, height - handle.inset), "y"
    else:
        sign = 1.0 if hinge.edge == "right" else -1.0  # towards the free edge
        pose, axis = Pose((-GAP, -sign * width / 2, 0.0)), (0.0, 0.0, sign)
        panel = Pose((-PANEL / 2, sign * width / 2, height / 2))
        middle = height / 2 if handle.height is None else handle.height
        grip, along = (sign * (width - handle.inset), middle), "z"
    centre = (-PANEL - handle.distance, *grip)
    thick = 2 * handle.radius
    box = (thick, handle.length, thick) if along == "y" else (thick, thick, handle.length)
    rod = bar(centre, handle.length, along, handle.distance, handle.radius, material=Material(friction=handle.friction))  # type: ignore[arg-type]
    return Body(
        name=f"{name}/door",
        label=f"{name} door",
        geoms=(
            Geom("box", extents, panel, colour),
            *rod,
            *(_window(extents, panel, handle, along) if hinge.window else ()),
        ),
        pose=pose,
        joint=Hinge(joint, axis, range=(0.0, hinge.opens_to), friction=hinge.friction, damping=hinge.damping),
        mass=hinge.mass,
        parts=(Part(f"{name}/handle", f"{name} handle", Pose(centre), box, "metal"),),
    )


def _window(panel: Vector, pose: Pose, handle: Handle, along: str) -> tuple[Geom, ...]:
    """A dark pane on the door's outer face, for appearance only."""
    room = 2 * handle.inset + 0.06
    width, height = (panel[1] - room, panel[2] - 0.10) if along == "z" else (panel[1] - 0.10, panel[2] - room)
    x, y, z = pose.position
    return (Geom("box", (0.002, width, height), Pose((x - panel[0] / 2, y, z)), GLASS, collides=False),)


def chest(name: str, place: Vector, yaw: float, size: Vector, plinth: float, handle: Handle, opens_to: float) -> Body:
    """A chest with one drawer that fills it, on a plinth of this height (m) below ``place``; the slide joint is called
    ``NAME/slide``."""
    depth, width, height = size
    gap = 0.002
    tray = (depth - WALL - 0.004, width - 2 * WALL - 2 * gap, height - 2 * WALL - 2 * gap - 0.01)
    centre, extents, opening = inside(tray, WALL, "top")
    front = Geom("box", (PANEL, width, height), Pose((-PANEL / 2, 0.0, height / 2 - WALL - gap)), WOOD)
    grip = (-PANEL - handle.distance, 0.0, (height / 2 if handle.height is None else handle.height) - WALL - gap)
    thick = 2 * handle.radius
    rod = bar(grip, handle.length, "y", handle.distance, handle.radius, material=Material(friction=handle.friction))
    joint = f"{name}/slide"
    base = Geom("box", (depth, width, plinth), Pose((depth / 2, 0.0, -plinth / 2)), DARK)
    drawer = Body(
        name=f"{name}/drawer",
        label="drawer",
        geoms=(*shell(tray, WALL, "top", colour=(0.85, 0.75, 0.6, 1.0)), front, *rod),
        pose=Pose((0.0, 0.0, WALL + gap)),
        joint=Slide(joint, (-1.0, 0.0, 0.0), range=(0.0, opens_to), friction=1.5, damping=8.0),
        mass=0.8,
        parts=(Part(f"{name}/handle", "drawer handle", Pose(grip), (thick, handle.length, thick), "metal"),),
        cavities=(
            Cavity(f"{name}/inside", "drawer inside", Pose(centre), extents, opening, joint, closed_within=0.03),
        ),
        made_of="wood",
    )
    return Body(
        name=name,
        label=name,
        fixture=True,
        geoms=(*shell(size, WALL, colour=WOOD), base),
        pose=Pose.from_yaw((place[0], place[1], place[2] + plinth), yaw),
        bodies=(drawer,),
        made_of="wood",
    )


def stand(name: str, place: Vector, yaw: float, size: Vector) -> Body:
    """A solid block to put furniture on; ``place`` is the middle of its front's lower edge."""
    depth, _, height = size
    geom = Geom("box", size, Pose((depth / 2, 0.0, height / 2)), (0.45, 0.42, 0.40, 1.0))
    return Body(name=name, label=name, fixture=True, geoms=(geom,), pose=Pose.from_yaw(place, yaw))
