"""Trees of links as URDF text, the one form in which Bullet takes bodies of any number of shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

import attrs
import numpy as np

from memo_core.plugin import (
    Array,
    Body,
    Free,
    Geom,
    Hinge,
    Material,
    Pose,
    RobotDescription,
    Slide,
    Urdf,
    UrdfLink,
    UrdfShape,
    Vector,
    masses,
    quaternion_from_rotation,
)
from memo_sim_pybullet.friction import Frictions, Surface

ROBOT = "robot/"
_SURFACE, _ANCHOR = "/surface ", "/anchor"  # of links that are a part of a body
_LINK_COLOUR = (0.8, 0.8, 0.82, 1.0)
_LEAST_INERTIA = 1e-7  # kg m2; Bullet divides by it
# m, least radius of gyration of loose things. Bullet's solver goes from contact to contact, and a hundred rounds are
# not enough where two fingers of an arm hold what turns as easily as a bottle's cap (12 mm): it tips by some degrees
# in a grip that would hold it. With 40 mm it stays within 0.1 degrees.
_LEAST_GYRATION = 0.04


@attrs.frozen
class JointSpec:
    """How a link hangs on its parent: ``kind`` as in URDF, ``axis`` in the link's frame, limits rad or m."""

    name: str
    kind: str = "fixed"
    axis: Vector = (1.0, 0.0, 0.0)
    lower: float = 0.0
    upper: float = 0.0
    armature: float = 0.0  # kg m2 about the axis of a hinge, which Bullet has no word for: added to the link's inertia


@attrs.frozen(eq=False)
class LinkSpec:
    """One link, its frame at its joint. ``frame``: the link's frame in that of the body it stands for.
    ``surface``: what it collides with (``memo_sim_pybullet.friction``)."""

    name: str
    parent: str | None
    pose: Pose  # in the parent link's frame at joint position 0
    joint: JointSpec
    shapes: tuple[Geom, ...]  # posed in the link's frame
    mass: float
    centre: Array  # (3,) m, in the link's frame
    inertia: Array  # (3, 3) kg m2 about the centre of mass, in the link's axes
    material: Material = Material()
    frame: Pose = Pose()
    surface: Surface = "plain"
    seen: bool = True
    gyration: float = 0.0  # m, its least radius of gyration


def body_of(link: str) -> str:
    """The scene's body, or the robot's link, that a link of this name is or is a part of."""
    return link.split(_SURFACE)[0].removesuffix(_ANCHOR)


@attrs.frozen(eq=False)
class Tree:
    """One multibody. ``fixed``: its first link does not move."""

    links: tuple[LinkSpec, ...]
    pose: Pose
    fixed: bool
    body: Body | None = None


def scene_tree(root: Body, mesh_volume: Callable[[str], float], frictions: Frictions) -> Tree:
    """A body of the scene with all that hangs on it."""
    links: list[LinkSpec] = []
    moves = isinstance(root.joint, (Hinge, Slide))
    if moves:
        nothing = (np.zeros(3), np.zeros((3, 3)))
        links.append(LinkSpec(f"{root.name}{_ANCHOR}", None, Pose(), JointSpec(""), (), 0.0, *nothing))
    pose = Pose() if moves else root.pose
    parent, at = (f"{root.name}{_ANCHOR}", root.pose) if moves else (None, Pose())
    _add(links, root, parent, at, mesh_volume, frictions)
    return Tree(tuple(links), pose, not isinstance(root.joint, Free), root)


def _add(
    links: list[LinkSpec],
    body: Body,
    parent: str | None,
    pose: Pose,
    mesh_volume: Callable[[str], float],
    frictions: Frictions,
) -> None:
    """``pose``: the body's frame in its parent link's. A hinge's link has its frame at the anchor."""
    anchor = body.joint.anchor if isinstance(body.joint, Hinge) else (0.0, 0.0, 0.0)
    frame = Pose(anchor)
    back = frame.inverse()
    shapes = tuple(attrs.evolve(geom, pose=back * geom.pose) for geom in body.geoms)
    weights = masses(body, mesh_volume)
    materials = list(dict.fromkeys(geom.material for geom in body.geoms if geom.collides)) or [Material()]
    surfaces: list[LinkSpec] = []
    gyration = _LEAST_GYRATION if isinstance(body.joint, Free) and not _rolls(body) else 0.0
    for material in materials:
        chosen = [n for n, geom in enumerate(shapes) if (geom.material if geom.collides else materials[0]) == material]
        own, heavy = tuple(shapes[n] for n in chosen), tuple(weights[n] for n in chosen)
        surface = LinkSpec("", "", Pose(), JointSpec(""), own, *_mass_properties(own, heavy), material, frame)
        surface = attrs.evolve(surface, gyration=gyration)
        whole, *copies = frictions.copies(material)
        surfaces.append(attrs.evolve(surface, surface=whole))
        massless = attrs.evolve(surface, mass=0.0, inertia=np.zeros((3, 3)), seen=False)
        surfaces += [attrs.evolve(massless, surface=copy) for copy in copies]
    first, *others = surfaces
    links.append(attrs.evolve(first, name=body.name, parent=parent, pose=pose * frame, joint=_joint(body)))
    for number, surface in enumerate(others, 1):
        # Bullet has one material a link: the body's other surfaces are links fixed to its first.
        name = f"{body.name}{_SURFACE}{number}"
        links.append(attrs.evolve(surface, name=name, parent=body.name, joint=JointSpec(f"{name}/fixed")))
    for child in body.bodies:
        _add(links, child, body.name, back * child.pose, mesh_volume, frictions)


def _rolls(body: Body) -> bool:
    """How something rolls is seen from its inertia."""
    return any(geom.shape == "sphere" or geom.material.contact_dimensions == 6 for geom in body.geoms if geom.collides)


def _joint(body: Body) -> JointSpec:
    joint = body.joint
    if isinstance(joint, Hinge):
        return JointSpec(joint.name, "revolute", _unit(joint.axis), *joint.range, joint.armature)
    if isinstance(joint, Slide):
        return JointSpec(joint.name, "prismatic", _unit(joint.axis), *joint.range)
    return JointSpec(f"{body.name}/fixed")


def robot_tree(urdf: Urdf, robot: RobotDescription, frictions: Frictions) -> Tree:
    """The robot, its base fixed at the world's origin; names as ``robot/LINK``."""
    driven = {joint.name: joint for joint in robot.joints}
    hanging = {joint.child: joint for joint in urdf.joints}
    links = []
    for name in (urdf.root, *(joint.child for joint in urdf.joints)):
        link, joint = urdf.links[name], hanging.get(name)
        spec = JointSpec("")
        if joint is not None:
            described = driven.get(joint.name)
            limits = (described.lower, described.upper) if described else (joint.lower, joint.upper)
            limits = (0.0, 0.0) if joint.kind == "fixed" else limits
            armature = described.armature if described and joint.kind == "revolute" else 0.0
            spec = JointSpec(ROBOT + joint.name, joint.kind, joint.axis, *limits, armature)
        pad = name in robot.gripper.pads
        on_common = robot.gripper.friction_on(frictions.common)
        material = Material(friction=on_common, torsional=0.01) if pad else Material(friction=0.5)
        parent = ROBOT + joint.parent if joint is not None else None
        pose = joint.origin if joint is not None else Pose()
        centre, inertia = np.array(link.centre.position), _tensor(link)
        shapes = tuple(_shapes(link))
        surface: Surface = "pad" if pad else "plain"
        parts = (shapes, link.mass, centre, inertia, material)
        links.append(LinkSpec(ROBOT + name, parent, pose, spec, *parts, surface=surface))
    return Tree(tuple(links), Pose(), True)


def _shapes(link: UrdfLink) -> Iterator[Geom]:
    for shape in link.collisions:
        yield _geom(shape)


def _geom(shape: UrdfShape) -> Geom:
    if shape.shape == "mesh":
        return Geom("mesh", shape.size, shape.pose, shape.colour or _LINK_COLOUR, mesh=shape.mesh)
    return Geom(shape.shape, shape.size, shape.pose, shape.colour or _LINK_COLOUR)


def _tensor(link: UrdfLink) -> Array:
    xx, yy, zz, xy, xz, yz = link.inertia
    rotation = link.centre.rotation
    return rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T


def _mass_properties(shapes: tuple[Geom, ...], weights: tuple[float, ...]) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) and inertia (3, 3) about it of solid shapes of these masses."""
    mass = sum(weights)
    if mass <= 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = (
        sum((weight * np.array(geom.pose.position) for geom, weight in zip(shapes, weights, strict=True)), np.zeros(3))
        / mass
    )
    inertia = np.zeros((3, 3))
    for geom, weight in zip(shapes, weights, strict=True):
        rotation = geom.pose.rotation
        away = np.array(geom.pose.position) - centre
        own = rotation @ np.diag(_solid(geom, weight)) @ rotation.T
        inertia += own + weight * (away @ away * np.eye(3) - np.outer(away, away))
    return mass, centre, inertia


def _solid(geom: Geom, mass: float) -> tuple[float, float, float]:
    """Moments of inertia of a solid about its own centre and axes; a capsule counts as the cylinder of its length."""
    size = geom.size
    if geom.shape == "sphere":
        return (0.4 * mass * size[0] ** 2,) * 3
    if geom.shape in ("cylinder", "capsule"):
        length = size[1] + (2 * size[0] if geom.shape == "capsule" else 0.0)
        across = mass * (3 * size[0] ** 2 + length**2) / 12
        return (across, across, mass * size[0] ** 2 / 2)
    x, y, z = size if geom.shape == "box" else (0.1 * size[0],) * 3
    return (mass * (y * y + z * z) / 12, mass * (x * x + z * z) / 12, mass * (x * x + y * y) / 12)


def principal(link: LinkSpec) -> tuple[list[float], Array]:
    """Principal moments of inertia (kg m2) of a link as Bullet gets them, its joint's armature included, and their axes
    as columns."""
    moments, axes = np.linalg.eigh(link.inertia + link.joint.armature * np.outer(link.joint.axis, link.joint.axis))
    least = max(link.mass * link.gyration**2, _LEAST_INERTIA)
    return [max(float(value), least) for value in moments], axes * np.sign(np.linalg.det(axes))


def urdf_text(tree: Tree, name: str) -> str:
    """The tree as a URDF document whose links are called by their place in ``tree.links``."""
    root = ElementTree.Element("robot", name=name)
    places = {link.name: str(number) for number, link in enumerate(tree.links)}
    for link in tree.links:
        _write_link(root, link, places[link.name], tree.fixed and link.parent is None)
        if link.parent is not None:
            _write_joint(root, link, places[link.name], places[link.parent])
    ElementTree.indent(root)  # Bullet cuts long lines
    return ElementTree.tostring(root, encoding="unicode")


def _write_link(root: ElementTree.Element, link: LinkSpec, place: str, fixed: bool) -> None:
    element = ElementTree.SubElement(root, "link", name=place)
    inertial = ElementTree.SubElement(element, "inertial")
    moments, axes = principal(link)
    _origin(inertial, Pose(tuple(link.centre), quaternion_from_rotation(axes)))
    # Bullet computes nothing from a massless link that moves.
    mass = 0.0 if fixed else max(link.mass, 1e-4)
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    # A ball's inertia for now: Bullet refuses what no rigid body has, such as an armature about one axis.
    xx = yy = zz = repr(max(moments)) if mass else "0"
    ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    for number, geom in enumerate(link.shapes):
        if link.seen:
            visual = ElementTree.SubElement(element, "visual")
            _origin(visual, geom.pose)
            _shape(visual, geom)
            colour = ElementTree.SubElement(visual, "material", name=f"{place}/{number}")
            ElementTree.SubElement(colour, "color", rgba=" ".join(map(repr, geom.colour)))
        if geom.collides:
            collision = ElementTree.SubElement(element, "collision")
            _origin(collision, geom.pose)
            _shape(collision, geom)


def _write_joint(root: ElementTree.Element, link: LinkSpec, place: str, parent: str) -> None:
    joint = link.joint
    element = ElementTree.SubElement(root, "joint", name=place, type=joint.kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=place)
    _origin(element, link.pose)
    if joint.kind != "fixed":
        ElementTree.SubElement(element, "axis", xyz=" ".join(map(repr, joint.axis)))
        ElementTree.SubElement(
            element, "limit", lower=repr(joint.lower), upper=repr(joint.upper), effort="100000", velocity="100"
        )


def _origin(element: ElementTree.Element, pose: Pose) -> None:
    xyz = " ".join(repr(float(v)) for v in pose.position)
    rpy = " ".join(repr(v) for v in _roll_pitch_yaw(pose.rotation))
    ElementTree.SubElement(element, "origin", xyz=xyz, rpy=rpy)


def _roll_pitch_yaw(rotation: Array) -> tuple[float, float, float]:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll), URDF's convention."""
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if math.hypot(rotation[0, 0], rotation[1, 0]) < 1e-9:
        return (0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1]))
    return (math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0]))


def _shape(element: ElementTree.Element, geom: Geom) -> None:
    geometry = ElementTree.SubElement(element, "geometry")
    size = [repr(float(value)) for value in geom.size]
    if geom.shape == "box":
        ElementTree.SubElement(geometry, "box", size=" ".join(size))
    elif geom.shape == "sphere":
        ElementTree.SubElement(geometry, "sphere", radius=size[0])
    elif geom.shape == "mesh":
        ElementTree.SubElement(geometry, "mesh", filename=str(geom.mesh), scale=" ".join((size * 3)[:3]))
    else:
        ElementTree.SubElement(geometry, geom.shape, radius=size[0], length=size[1])


def _unit(axis: Vector) -> Vector:
    length = math.sqrt(sum(value * value for value in axis))
    return (axis[0] / length, axis[1] / length, axis[2] / length)
