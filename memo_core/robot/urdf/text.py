"""Writing URDF text: links and joints of robots that are described in code, with shapes made of primitives.

Metres, kilograms, radians. URDF has no capsules: a visual one is written as a cylinder and two spheres, a collision one
as a cylinder that its link's ``<collision_checking>`` marks as a capsule (Pinocchio's extension, which
``memo_core.robot.urdf.reading`` reads too).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Literal
from xml.etree import ElementTree

import attrs

Vector = tuple[float, float, float]


@attrs.frozen
class Solid:
    """A primitive in its link's frame. ``size``: box x, y, z; sphere radius; cylinder and capsule radius and (straight)
    length along z. ``colour`` is the name of a material of the document."""

    kind: Literal["box", "sphere", "cylinder", "capsule"]
    size: tuple[float, ...]
    position: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    colour: str = "white"


@attrs.frozen
class Inertia:
    """kg, m, kg m2 about the centre of mass (xx, yy, zz, xy, xz, yz)."""

    mass: float
    centre: Vector
    tensor: tuple[float, float, float, float, float, float]


def between(
    kind: Literal["cylinder", "capsule"], radius: float, start: Vector, end: Vector, colour: str = "white"
) -> Solid:
    """Cylinder or capsule between two points.

    Args:
        kind: shape; the caps of a capsule lie beyond the two points.
        radius: in m.
        start: centre of one end, shape (3,), m, in the link's frame.
        end: centre of the other end, different from ``start``.
        colour: name of a material of the document.

    Returns:
        The shape, posed in the link's frame.
    """
    dx, dy, dz = (b - a for a, b in zip(start, end, strict=True))
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, (start[2] + end[2]) / 2)
    rpy = (0.0, math.acos(max(-1.0, min(1.0, dz / length))), math.atan2(dy, dx))
    return Solid(kind, (radius, length), middle, rpy, colour)


def box_inertia(mass: float, size: Vector, centre: Vector = (0.0, 0.0, 0.0)) -> Inertia:
    """Inertia of a solid box of uniform density, its sides along the link's axes.

    Args:
        mass: in kg.
        size: side lengths (x, y, z), m.
        centre: centre of the box in the link's frame, m.

    Returns:
        Mass, centre of mass, and tensor (kg m2) about the centre of mass.
    """
    x, y, z = size
    part = mass / 12
    tensor = (part * (y * y + z * z), part * (x * x + z * z), part * (x * x + y * y), 0.0, 0.0, 0.0)
    return Inertia(mass, centre, tensor)


def rod_inertia(mass: float, radius: float, length: float, axis: Literal["x", "y", "z"], centre: Vector) -> Inertia:
    """Inertia of a solid cylinder of uniform density.

    Args:
        mass: in kg.
        radius: in m.
        length: in m.
        axis: axis of the link's frame that the cylinder lies along.
        centre: centre of the cylinder in the link's frame, m.

    Returns:
        Mass, centre of mass, and tensor (kg m2) about the centre of mass.
    """
    across = mass * (3 * radius * radius + length * length) / 12
    moments = [across, across, across]
    moments["xyz".index(axis)] = mass * radius * radius / 2
    return Inertia(mass, centre, (moments[0], moments[1], moments[2], 0.0, 0.0, 0.0))


def link_text(
    name: str, inertia: Inertia | None = None, visuals: Sequence[Solid] = (), collisions: Sequence[Solid] = ()
) -> str:
    """URDF text of a ``<link>``.

    Args:
        name: name of the link.
        inertia: mass and inertia; None: a massless link, as for a frame.
        visuals: shapes to show, in the link's frame.
        collisions: shapes to collide, in the link's frame; numbered ``NAME_0``, ``NAME_1``, ….

    Returns:
        The element, indented by two spaces.
    """
    if inertia is None and not visuals and not collisions:
        return f'  <link name="{name}"/>'
    lines = [f'  <link name="{name}">']
    if inertia is not None:
        keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        tensor = " ".join(f'{key}="{value!r}"' for key, value in zip(keys, inertia.tensor, strict=True))
        lines.append(
            f'    <inertial><origin xyz="{numbers(inertia.centre)}" rpy="0 0 0"/><mass value="{inertia.mass}"/>'
            f"<inertia {tensor}/></inertial>"
        )
    for shape in visuals:
        lines += [f'    <visual>{_solid(piece)}<material name="{piece.colour}"/></visual>' for piece in _pieces(shape)]
    marks = []
    for number, shape in enumerate(collisions):
        label = f"{name}_{number}"
        lines.append(f'    <collision name="{label}">{_solid(shape)}</collision>')
        if shape.kind == "capsule":
            marks.append(f'<capsule name="{label}"/>')
    if marks:
        lines.append(f"    <collision_checking>{''.join(marks)}</collision_checking>")
    lines.append("  </link>")
    return "\n".join(lines)


def joint_text(
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Vector = (0.0, 0.0, 0.0),
    rpy: Vector = (0.0, 0.0, 0.0),
    axis: str = "",
    limit: str = "",
) -> str:
    """URDF text of a ``<joint>``.

    Args:
        name: name of the joint.
        kind: URDF's joint type, such as ``fixed``, ``revolute`` or ``prismatic``.
        parent: name of the parent link.
        child: name of the child link.
        xyz: origin of the child's frame in the parent's at position 0, m.
        rpy: roll, pitch, yaw of the child's frame in the parent's at position 0, rad.
        axis: axis in the child's frame, such as ``"0 0 1"``; empty: neither axis nor limit is written.
        limit: whole ``<limit …/>`` element, and any further elements of the joint.

    Returns:
        The element, indented by two spaces.
    """
    turning = f'<axis xyz="{axis}"/>{limit}' if axis else ""
    return (
        f'  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/>{turning}</joint>'
    )


def with_fixed(urdf: str, joints: Sequence[str]) -> str:
    """The URDF text with these joints fixed at position 0."""
    root = ElementTree.fromstring(urdf)
    for joint in root.findall("joint"):
        if joint.get("name") in joints:
            joint.set("type", "fixed")
            for follower in joint.findall("mimic"):
                joint.remove(follower)
    return ElementTree.tostring(root, encoding="unicode")


def without_links(urdf: str, links: Collection[str], shapeless: Collection[str]) -> str:
    """The URDF text without these links and the joints that lead to them, and without the shapes of ``shapeless``."""
    root = ElementTree.fromstring(urdf)
    for joint in root.findall("joint"):
        child = joint.find("child")
        if child is not None and child.get("link") in links:
            root.remove(joint)
    for link in root.findall("link"):
        if link.get("name") in links:
            root.remove(link)
        elif link.get("name") in shapeless:
            for shape in (*link.findall("visual"), *link.findall("collision")):
                link.remove(shape)
    return ElementTree.tostring(root, encoding="unicode")


def materials_text(colours: dict[str, str]) -> str:
    """URDF text of a document's materials.

    Args:
        colours: colour as ``"r g b a"``, each 0 to 1, by the material's name.

    Returns:
        One ``<material>`` a line.
    """
    return "\n".join(f'  <material name="{name}"><color rgba="{rgba}"/></material>' for name, rgba in colours.items())


def numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _pieces(shape: Solid) -> tuple[Solid, ...]:
    if shape.kind != "capsule":
        return (shape,)
    radius, length = shape.size
    _, pitch, yaw = shape.rpy
    half = (
        math.cos(yaw) * math.sin(pitch) * length / 2,
        math.sin(yaw) * math.sin(pitch) * length / 2,
        math.cos(pitch) * length / 2,
    )
    x, y, z = shape.position
    ends = tuple(
        Solid("sphere", (radius,), (x + sign * half[0], y + sign * half[1], z + sign * half[2]), colour=shape.colour)
        for sign in (-1, 1)
    )
    return (attrs.evolve(shape, kind="cylinder"), *ends)


def _solid(shape: Solid) -> str:
    origin = f'<origin xyz="{numbers(shape.position)}" rpy="{numbers(shape.rpy)}"/>'
    if shape.kind == "box":
        solid = f'<box size="{numbers(shape.size)}"/>'
    elif shape.kind == "sphere":
        solid = f'<sphere radius="{shape.size[0]!r}"/>'
    else:
        solid = f'<cylinder radius="{shape.size[0]!r}" length="{shape.size[1]!r}"/>'
    return f"{origin}<geometry>{solid}</geometry>"
