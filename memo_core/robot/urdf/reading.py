"""Reading URDF, the robot format that Pinocchio and every simulator build from.

Covers what a serial arm with a gripper needs: links with inertias, visual and collision shapes, fixed, revolute,
continuous and prismatic joints. Lengths in metres, angles in radians, inertias in kg m2 about the centre of mass.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import attrs

from memo_core.errors import InvalidArgument, close_match
from memo_core.scene.pose import Pose, multiply_quaternions, quaternion_from_axis_angle

Vector = tuple[float, float, float]
Colour = tuple[float, float, float, float]
Tensor = tuple[float, float, float, float, float, float]
_NO_INERTIA: Tensor = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
JointKind = Literal["fixed", "revolute", "prismatic"]
_MIMIC = {"multiplier": 1.0, "offset": 0.0}
_KINDS: dict[str, JointKind] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


@attrs.frozen
class UrdfShape:
    """A shape posed in its link's frame. ``size`` as in ``memo_core.scene.description.Geom``; ``mesh`` a file path and
    ``size`` its scale (x, y, z)."""

    shape: Literal["box", "cylinder", "sphere", "capsule", "mesh"]
    size: tuple[float, ...]
    pose: Pose = attrs.field(factory=Pose)
    colour: Colour | None = None
    mesh: str | None = None


@attrs.frozen
class UrdfLink:
    """``inertia`` is (xx, yy, zz, xy, xz, yz) in the axes of ``centre``, whose origin is the centre of mass."""

    name: str
    mass: float = 0.0  # kg
    centre: Pose = attrs.field(factory=Pose)
    inertia: Tensor = _NO_INERTIA
    visuals: tuple[UrdfShape, ...] = ()
    collisions: tuple[UrdfShape, ...] = ()


@attrs.frozen
class Mimic:
    """A joint that follows another: its position is ``multiplier`` times the other's, plus ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0  # rad or m


@attrs.frozen
class Units:
    """What a joint's numbers are in."""

    position: str  # its limits; speeds are per s, accelerations per s2
    effort: str
    stiffness: str
    inertia: str


_TURNING, _SLIDING = Units("rad", "Nm", "Nm/rad", "kg m2"), Units("m", "N", "N/m", "kg")


@attrs.frozen
class UrdfJoint:
    """``origin`` is the child's frame in the parent's at position 0. ``lower``/``upper`` are infinite where the URDF
    states no limits (continuous joints)."""

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Pose = attrs.field(factory=Pose)
    axis: Vector = (1.0, 0.0, 0.0)
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf  # rad/s or m/s
    effort: float = math.inf  # Nm or N
    mimic: Mimic | None = None

    @property
    def units(self) -> Units:
        return _SLIDING if self.kind == "prismatic" else _TURNING


@attrs.frozen
class Urdf:
    """A tree of links. ``joints`` stand in an order in which parents come before their children."""

    name: str
    root: str
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]

    def joint(self, name: str) -> UrdfJoint:
        """The joint with this name. Raises ``InvalidArgument``, which names the existing joints, if there is none."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        names = [joint.name for joint in self.joints]
        problem = f"no joint {name!r}{close_match(name, names)}"
        raise InvalidArgument(f"URDF of {self.name!r}", problem, f"one of {', '.join(names)}")

    @property
    def total_mass(self) -> float:
        """kg of all links."""
        return sum(link.mass for link in self.links.values())


def link_poses(urdf: Urdf, positions: dict[str, float]) -> dict[str, Pose]:
    """Forward kinematics of all links.

    Args:
        urdf: the robot's links and joints.
        positions: joint positions (rad or m) by name; joints not named, mimics included, stand at 0.

    Returns:
        Pose of each link by name, in the frame of the root link.
    """
    poses = {urdf.root: Pose()}
    for joint in urdf.joints:
        value = positions.get(joint.name, 0.0)
        motion = Pose()
        if joint.kind == "revolute":
            motion = Pose(orientation=quaternion_from_axis_angle(joint.axis, value))
        elif joint.kind == "prismatic":
            motion = Pose(tuple(value * v for v in joint.axis))
        poses[joint.child] = poses[joint.parent] * joint.origin * motion
    return poses


def read_urdf(text: str, mesh_folder: str | None = None) -> Urdf:
    """Parse URDF text.

    Args:
        text: the XML text, with xacro already expanded.
        mesh_folder: folder below which mesh files are looked up; ``package://NAME/…`` also in a folder NAME that
            contains it or lies next to it. A path that does not exist falls back on its longest tail that exists
            there or in a folder above. None: paths are used as they stand.

    Returns:
        Links, and joints with parents before children.

    Raises:
        InvalidArgument: naming the element that is wrong, or the mesh that was not found.
    """
    root = _parsed(text)
    for element in root.iter():
        if "xacro}" in element.tag or any("${" in value or "$(" in value for value in element.attrib.values()):
            raise _not_expanded(f"<{element.tag.rpartition('}')[2]}>")
    name = root.get("name", "robot")
    named = {str(material.get("name")): _colour(material) for material in root.findall("material")}
    colours = {key: colour for key, colour in named.items() if colour is not None}
    for tag in ("link", "joint"):
        _check_names(tag, [element.get("name", "") for element in root.findall(tag)])
    links = {link.name: link for link in (_link(element, colours, mesh_folder) for element in root.findall("link"))}
    joints = [_joint(element) for element in root.findall("joint")]
    children: dict[str, str] = {}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                problem = f"names the link {end!r}, which does not exist"
                raise InvalidArgument(f"URDF joint {joint.name!r}", problem, "a <link>")
        if joint.child in children:
            problem = f"has two parents, by {children[joint.child]!r} and {joint.name!r}"
            raise InvalidArgument(f"URDF link {joint.child!r}", problem, "a tree")
        children[joint.child] = joint.name
    roots = [link for link in links if link not in children]
    if not links:
        raise InvalidArgument(f"URDF of {name!r}", "has no links", "a file that xacro expanded with all its arguments")
    if len(roots) != 1:
        raise InvalidArgument(f"URDF of {name!r}", f"has {len(roots)} root links ({', '.join(roots)})", "exactly one")
    known = {joint.name for joint in joints}
    for joint in joints:
        if joint.mimic is not None and joint.mimic.joint not in known:
            problem = f"mimics {joint.mimic.joint!r}, which does not exist"
            raise InvalidArgument(f"URDF joint {joint.name!r}", problem, f"one of {', '.join(sorted(known))}")
    return Urdf(name, roots[0], links, _parents_first(roots[0], joints))


def _parsed(text: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if "<xacro:" in text:
            raise _not_expanded("<xacro:…>") from error
        raise InvalidArgument("URDF", f"is not well-formed XML ({error})", "a <robot> document") from error
    if root.tag != "robot":
        raise InvalidArgument("URDF", f"its root element is <{root.tag}>", "<robot>")
    return root


def _check_names(tag: str, names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        if not name:
            raise InvalidArgument(f"URDF <{tag}>", "has no name", 'name="…"')
        if name in names[:number]:
            raise InvalidArgument(f"URDF {tag} {name!r}", "is there twice", f"a name for each {tag}")


def _not_expanded(where: str) -> InvalidArgument:
    return InvalidArgument("URDF", f"{where} is xacro; expand it first: xacro x.xacro > x.urdf", "a <robot> document")


def _parents_first(root: str, joints: list[UrdfJoint]) -> tuple[UrdfJoint, ...]:
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    ordered: list[UrdfJoint] = []
    stack = list(reversed(below.get(root, [])))
    while stack:
        joint = stack.pop()
        ordered.append(joint)
        stack.extend(reversed(below.get(joint.child, [])))
    return tuple(ordered)


def _link(element: ElementTree.Element, colours: dict[str, Colour], folder: str | None) -> UrdfLink:
    name = element.get("name", "")
    where = f"URDF link {name!r}"
    # Pinocchio's extension: cylinders named here are capsules of the same straight length.
    capsules = {capsule.get("name") for capsule in element.findall("collision_checking/capsule")}
    mass, centre, inertia = 0.0, Pose(), _NO_INERTIA
    inertial = element.find("inertial")
    if inertial is not None:
        mass = _number(where, inertial.find("mass"), "value")
        centre = _origin(where, inertial)
        tensor = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (_number(where, tensor, key) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        inertia = (xx, yy, zz, xy, xz, yz)
    visuals = (_shape(where, visual, colours, folder, set()) for visual in element.findall("visual"))
    collisions = (_shape(where, collision, colours, folder, capsules) for collision in element.findall("collision"))
    # Shapes of size 0 0 0 are placeholders.
    seen, solid = (tuple(shape for shape in shapes if any(shape.size)) for shapes in (visuals, collisions))
    return UrdfLink(name, mass, centre, inertia, seen, solid)


def _shape(
    where: str,
    element: ElementTree.Element,
    colours: dict[str, Colour],
    folder: str | None,
    capsules: set[str | None],
) -> UrdfShape:
    geometry = element.find("geometry")
    if geometry is None or len(geometry) == 0:
        raise InvalidArgument(where, f"a <{element.tag}> has no <geometry>", "box, cylinder, sphere, capsule or mesh")
    solid = geometry[0]
    pose = _origin(where, element)
    material = element.find("material")
    colour = None if material is None else _colour(material) or colours.get(str(material.get("name")))
    if solid.tag == "box":
        return UrdfShape("box", _vector(where, solid, "size"), pose, colour)
    if solid.tag == "sphere":
        return UrdfShape("sphere", (_number(where, solid, "radius"),), pose, colour)
    if solid.tag in ("cylinder", "capsule"):
        round_ends = solid.tag == "capsule" or (element.tag == "collision" and element.get("name") in capsules)
        size = (_number(where, solid, "radius"), _number(where, solid, "length"))
        return UrdfShape("capsule" if round_ends else "cylinder", size, pose, colour)
    if solid.tag == "mesh":
        scale = _vector(where, solid, "scale") if solid.get("scale") else (1.0, 1.0, 1.0)
        return UrdfShape("mesh", scale, pose, colour, str(find_mesh(where, solid.get("filename", ""), folder)))
    raise InvalidArgument(where, f"unknown shape <{solid.tag}>", "box, cylinder, sphere, capsule or mesh")


def find_mesh(where: str, filename: str, folder: str | None) -> Path:
    """The file that a mesh's ``filename`` means. Raises ``InvalidArgument``, ``where`` naming the link, if there is
    none."""
    named = _named(filename, folder)
    found = next((path for path in named if path.is_file()), None) or _by_tail(filename, [folder] if folder else [])
    if found is not None:
        return found
    looked = ", ".join(map(str, named[:2]))
    if folder is not None:
        *above, _ = _parts(filename)
        looked += f", and in each folder above in {'/'.join(above)} or the last parts of it" if above else ""
    right = "a mesh_folder that holds it (memo new robot: --mesh-folder DIR)"
    raise InvalidArgument(where, f"mesh {filename!r} not found (looked at {looked})", right)


@attrs.frozen
class MeshesFound:
    """URDF ``text`` whose meshes can be found: ``moved`` are those that lie elsewhere than it said (name, file);
    ``unseen`` and ``untouched`` name those that lie nowhere, of visuals and of collisions that were left out."""

    text: str
    moved: tuple[tuple[str, Path], ...] = ()
    unseen: tuple[str, ...] = ()
    untouched: tuple[str, ...] = ()


def with_meshes_found(text: str, folders: Sequence[str], skip_missing: bool = False) -> MeshesFound:
    """The URDF with each mesh that does not lie where it says in the first of ``folders`` named by where it lies in any
    of them. Raises ``InvalidArgument`` for collision meshes that lie nowhere, unless they are to be skipped."""
    root = _parsed(text)
    moved: dict[str, Path] = {}
    missing: dict[str, dict[str, None]] = {"visual": {}, "collision": {}}
    for link in root.iter("link"):
        for element in (*link.findall("visual"), *link.findall("collision")):
            mesh = element.find("geometry/mesh")
            filename = "" if mesh is None else mesh.get("filename", "")
            if mesh is None or any(path.is_file() for path in _named(filename, folders[0])):
                continue
            found = _by_tail(filename, folders)
            if found is not None:
                mesh.set("filename", f"file://{found.resolve()}")
                moved[filename] = found.resolve()
                continue
            missing[element.tag][filename] = None
            link.remove(element)
    if missing["collision"] and not skip_missing:
        raise _meshes_missing(root.get("name", "robot"), list(missing["collision"] | missing["visual"]))
    changed = bool(moved or missing["visual"] or missing["collision"])
    text = ElementTree.tostring(root, encoding="unicode") if changed else text
    return MeshesFound(text, tuple(moved.items()), tuple(missing["visual"]), tuple(missing["collision"]))


def _meshes_missing(robot: str, names: Sequence[str]) -> InvalidArgument:
    by_folder: dict[str, dict[str, None]] = {}
    for name in names:
        folder, _, file = name.rpartition("/")
        by_folder.setdefault(folder.rstrip("/"), {})[file] = None
    told = "; ".join(f"of {folder}: {', '.join(files)}" for folder, files in by_folder.items())
    problem = f"meshes are neither there nor near the URDF ({told})"
    right = (
        "--mesh-folder DIR for each folder that holds some, or --skip-missing-meshes: no collisions with those parts"
    )
    return InvalidArgument(f"URDF of {robot!r}", problem, right)


def _named(filename: str, folder: str | None) -> list[Path]:
    """Places of a mesh whose name is right: that path, or below ``folder``, with or without a package's name, or in a
    package that the folder is in or next to."""
    path = _without_scheme(filename)
    if folder is None or Path(path).is_absolute():
        return [Path(path)]
    below = [Path(folder) / path, Path(folder) / "/".join(path.split("/")[1:])]
    above = Path(folder).resolve().parents if Path(folder).is_dir() else ()
    return [*below, *(parent / path for parent in above)]


def _by_tail(filename: str, folders: Sequence[str]) -> Path | None:
    """The longest tail of a path that exists in one of ``folders`` or above it."""
    parts = _parts(filename)
    near = [Path(folder).resolve() for folder in folders if Path(folder).is_dir()]
    for start in range(len(parts)):
        # A bare file name is too little to go by outside the folders themselves.
        places = [place for one in near for place in ((one, *one.parents) if start < len(parts) - 1 else (one,))]
        for place in places:
            if (candidate := place.joinpath(*parts[start:])).is_file():
                return candidate
    return None


def _parts(filename: str) -> list[str]:
    return [part for part in _without_scheme(filename).split("/") if part not in ("", ".", "..")]


def _without_scheme(filename: str) -> str:
    return re.sub(r"^(package|file|model)://", "", filename)


def _joint(element: ElementTree.Element) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    where = f"URDF joint {name!r}"
    if kind not in _KINDS:
        raise InvalidArgument(where, f"has the type {kind!r}", ", ".join(_KINDS))
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        if end is None or not end.get("link"):
            raise InvalidArgument(where, f"has no <{tag} link=…>", f'<{tag} link="…"/>')
        ends.append(str(end.get("link")))
    axis = element.find("axis")
    limit = element.find("limit")
    limits = {}
    if limit is not None:
        keys = ("velocity", "effort") if kind == "continuous" else ("lower", "upper", "velocity", "effort")
        limits = {key: _number(where, limit, key) for key in keys if limit.get(key) is not None}
        for key in ("velocity", "effort"):
            if limits.get(key, 0.0) < 0:
                raise InvalidArgument(where, f"its <limit> has {key}={limit.get(key)!r}", "0 (not stated) or more")
    direction = (1.0, 0.0, 0.0) if axis is None else _vector(where, axis, "xyz")
    length = math.sqrt(sum(v * v for v in direction))
    if kind != "fixed" and length < 1e-9:
        raise InvalidArgument(where, "its axis has no length", "a direction such as 0 0 1")
    unit = tuple(v / length for v in direction) if length > 0 else (1.0, 0.0, 0.0)
    joint = UrdfJoint(name, _KINDS[kind], ends[0], ends[1], _origin(where, element), unit, **limits)  # type: ignore[arg-type]
    return attrs.evolve(joint, mimic=_mimic(where, element))


def _mimic(where: str, element: ElementTree.Element) -> Mimic | None:
    mimic = element.find("mimic")
    if mimic is None:
        return None
    if not mimic.get("joint"):
        raise InvalidArgument(where, "its <mimic> names no joint", '<mimic joint="…"/>')
    values = [_number(where, mimic, key) if mimic.get(key) else usual for key, usual in _MIMIC.items()]
    return Mimic(str(mimic.get("joint")), *values)


def _origin(where: str, element: ElementTree.Element) -> Pose:
    origin = element.find("origin")
    if origin is None:
        return Pose()
    position = _vector(where, origin, "xyz") if origin.get("xyz") else (0.0, 0.0, 0.0)
    roll, pitch, yaw = _vector(where, origin, "rpy") if origin.get("rpy") else (0.0, 0.0, 0.0)
    about_z, about_y, about_x = (
        quaternion_from_axis_angle(axis, angle)
        for axis, angle in (((0, 0, 1), yaw), ((0, 1, 0), pitch), ((1, 0, 0), roll))
    )
    return Pose(position, multiply_quaternions(multiply_quaternions(about_z, about_y), about_x))


def _colour(material: ElementTree.Element) -> Colour | None:
    colour = material.find("color")
    if colour is None:
        return None
    try:
        r, g, b, a = (float(v) for v in str(colour.get("rgba")).split())
    except ValueError:
        where = f"URDF material {material.get('name')!r}"
        raise InvalidArgument(where, f"<color rgba={colour.get('rgba')!r}>", "four numbers") from None
    return (r, g, b, a)


def _vector(where: str, element: ElementTree.Element, key: str) -> Vector:
    try:
        x, y, z = (float(v) for v in str(element.get(key)).split())
    except ValueError:
        x = y = z = math.nan
    if math.isnan(x + y + z):
        raise InvalidArgument(where, f"<{element.tag} {key}={element.get(key)!r}>", "three numbers")
    return (x, y, z)


def _number(where: str, element: ElementTree.Element | None, key: str) -> float:
    value = None if element is None else element.get(key)
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if math.isnan(number):
        tag = "inertial" if element is None else element.tag
        raise InvalidArgument(where, f"<{tag}> has {key}={value!r}", "a number")
    return number
