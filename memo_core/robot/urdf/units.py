"""Numbers in a URDF that can hardly be in its units, which are rad, m, kg, kg m2, Nm and N.

Degrees, millimetres and grams make a URDF that every parser accepts and that no simulator moves as the arm moves.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import Urdf, UrdfLink

_ANGLE = 4 * math.pi  # rad, the largest limit of a turning joint
_TURN = 2 * math.pi + 1e-3  # rad, the largest angle of an <origin>
_SPEED = 30.0  # rad/s of an arm joint; the quickest wrists turn by 26
_STROKE, _SLIDE = 1.0, 20.0  # m, of a finger, of a slide of the arm
_LENGTH = 10.0  # m, of all links in a row
_CENTRE = 5.0  # m from a link's frame to its centre of mass
_MASS = 200.0  # kg of a link that moves; pedestals are heavier
# A body of mass m whose points are within a diagonal L has moments of inertia below m L2 / 4.
_HEAVY_TURNING = 1e3 / 4
_DOT = 1e-3  # m; a shape smaller than that is a placeholder
_UNKNOWN = 1.0  # m that a link without primitive shapes may measure


def implausible_units(text: str, urdf: Urdf, fingers: Collection[str] = ()) -> tuple[str, ...]:
    """What looks as if written in other units, a line a cause, naming its joints or links. ``text``: the URDF that
    ``urdf`` was read from; ``fingers``: the names of the gripper's joints."""
    steps = [math.dist((0, 0, 0), joint.origin.position) for joint in urdf.joints if joint.kind != "fixed"]
    if sum(steps[1:]) > _LENGTH:
        return (f"its joints are {sum(steps[1:]):.0f} m apart, added up: probably millimetres; URDF lengths are in m",)
    found = [*_angles(text, urdf, fingers), *_slides(urdf, fingers)]
    far = {
        name: distance
        for name, link in urdf.links.items()
        if (distance := math.dist((0, 0, 0), link.centre.position)) > _CENTRE
    }
    if far:
        places = [f"{value:g} m from {name!r}" for name, value in far.items()]
        found.append(f"centres of mass {_some(places)}: probably millimetres; URDF lengths are in m")
    moved: set[str] = set()
    for joint in urdf.joints:  # parents come first
        if joint.kind != "fixed" or joint.parent in moved:
            moved.add(joint.child)
    heavy = {name: mass for name in urdf.links if name in moved and (mass := urdf.links[name].mass) > _MASS}
    if heavy:
        found.append(f"link {_some(_of(heavy, 'kg'))}: probably grams; URDF masses are in kg")
    found += _inertias(urdf, {*far, *heavy})
    return tuple(found)


def check_units(text: str, urdf: Urdf, fingers: Collection[str] = ()) -> None:
    """Raise ``InvalidArgument`` for a turning joint or slide without ``<limit>``, and for numbers that look as if in
    other units than URDF's."""
    for element in ElementTree.fromstring(text).findall("joint"):
        name, kind = element.get("name", ""), element.get("type")
        limit = element.find("limit")
        if kind not in ("revolute", "prismatic"):
            continue
        missing = [key for key in ("effort", "velocity") if limit is not None and limit.get(key) is None]
        if limit is not None and not missing:
            continue
        unit = "rad" if kind == "revolute" else "m"
        right = f'<limit lower="…" upper="…" velocity="…" effort="…"/>, lower and upper in {unit}'
        if limit is not None:
            problem = f"its <limit> has no {' and no '.join(missing)}"
            right = f'{" ".join(f"{key}=…" for key in missing)} as URDF requires, "0" where it is not known'
        elif kind == "revolute":
            problem = "is revolute and has no <limit>, which URDF requires"
            right += ', or type="continuous" where it turns without end'
        else:
            problem = "slides without limits"
        raise InvalidArgument(f"URDF joint {name!r}", problem, right)
    found = implausible_units(text, urdf, fingers)
    if found:
        raise InvalidArgument(f"URDF of {urdf.name!r}", "; ".join(found), "rad, m, kg and kg m2 throughout")


def _angles(text: str, urdf: Urdf, fingers: Collection[str]) -> list[str]:
    found = []
    limits, speeds = {}, {}
    for joint in urdf.joints:
        if joint.kind != "revolute":
            continue
        ends = [abs(end) for end in (joint.lower, joint.upper) if math.isfinite(end)]
        if ends and max(ends) > _ANGLE:
            limits[joint.name] = max(joint.lower, joint.upper, key=abs)
        if joint.name not in fingers and _SPEED < joint.velocity < math.inf:
            speeds[joint.name] = joint.velocity
    if limits:
        values = _some(_of(limits, "rad"))
        right = "URDF limits are in rad (a joint without an end is continuous)"
        found.append(f"limits of joint {values}: looks like degrees; {right}")
    if speeds:
        values = _some(_of(speeds, "rad/s"))
        right = "URDF velocities are in rad/s (0 is taken as not stated)"
        found.append(f"velocity of joint {values}: looks like deg/s or rpm; {right}")
    turned = []
    for element in ElementTree.fromstring(text):
        for origin in element.iter("origin"):
            angles = [float(value) for value in (origin.get("rpy") or "").split()]
            if angles and max(map(abs, angles)) > _TURN:
                turned.append(f"{element.tag} {element.get('name')!r} has rpy={origin.get('rpy')!r}")
    if turned:
        found.append(f"{_some(list(dict.fromkeys(turned)))}: looks like degrees; URDF angles are in rad")
    return found


def _slides(urdf: Urdf, fingers: Collection[str]) -> list[str]:
    long = {}
    for joint in urdf.joints:
        length = joint.upper - joint.lower
        most = _STROKE if joint.name in fingers else _SLIDE
        if joint.kind == "prismatic" and most < length < math.inf:
            long[joint.name] = length
    if not long:
        return []
    return [f"joint {_some(_of(long, 'm'))} from end to end: probably millimetres; URDF slides are in m"]


def _inertias(urdf: Urdf, known: Collection[str]) -> list[str]:
    """Links whose inertia no body of their mass and size has, by a factor of 1000; ``known`` are wrong already."""
    wrong = []
    for name, link in urdf.links.items():
        if link.mass <= 0 or name in known:
            continue
        xx, yy, zz, xy, xz, yz = link.inertia
        largest = float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[2])
        size = _size(urdf, link)
        if largest > _HEAVY_TURNING * link.mass * size**2:
            wrong.append(f"{name!r} ({largest:.3g} kg m2 for {link.mass:.3g} kg within {size:.2g} m)")
    if not wrong:
        return []
    return [f"inertia of link {_some(wrong)}: probably kg mm2 or g mm2; URDF inertias are in kg m2"]


def _size(urdf: Urdf, link: UrdfLink) -> float:
    """m, the diagonal of the box about a link's shapes, or as far as the next joint where that is more."""
    shapes = [*link.visuals, *link.collisions]
    corners = []
    for shape in shapes:
        if shape.shape == "mesh":
            return _UNKNOWN
        if shape.shape == "box":
            half = np.array(shape.size) / 2
        else:
            radius = shape.size[0]
            length = 0.0 if shape.shape == "sphere" else shape.size[1]
            ends = 0.0 if shape.shape == "cylinder" else radius
            half = np.array([radius, radius, length / 2 + ends])
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners.append(shape.pose.apply(signs * half))
    if not corners:
        return _UNKNOWN
    points = np.concatenate(corners)
    onwards = [math.dist((0, 0, 0), joint.origin.position) for joint in urdf.joints if joint.parent == link.name]
    size = max([float(np.linalg.norm(np.ptp(points, axis=0))), *onwards])
    return size if size > _DOT else _UNKNOWN


def _of(values: dict[str, float], unit: str) -> list[str]:
    return [f"{name!r} ({value:g} {unit})" for name, value in values.items()]


def _some(items: Sequence[str]) -> str:
    rest = f" and {len(items) - 3} more" if len(items) > 3 else ""
    return ", ".join(items[:3]) + rest
