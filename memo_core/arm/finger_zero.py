"""Finger slides counted from where they are shut.

The simulators and the gripper's opening want slides that are shut at 0 and open with growing positions. URDFs also have
them open at 0, or closing as their positions grow. Which way a finger opens is told by the pads' shapes: away from the
others'. Then the URDF is rewritten: the joint's origin moves to where the finger is shut, its axis points outwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree

import attrs
import numpy as np

from memo_core.robot.urdf.reading import Urdf, UrdfJoint, link_poses
from memo_core.scene.pose import Array

NEARLY_SHUT = 5e-4  # m that a slide may be off 0 when shut
_TELLING = 1e-4  # m between two pads across, from which on it can be told which way they part


@attrs.frozen
class Slide:
    """One finger: its joint's positions (m) where it is shut and where it is open, by the URDF as it stands."""

    joint: UrdfJoint
    shut: float
    open: float

    @property
    def counted_from_shut(self) -> bool:
        return abs(self.shut) <= NEARLY_SHUT and self.open > self.shut


def finger_slides(urdf: Urdf, fingers: Sequence[UrdfJoint], shapes: dict[str, Array]) -> tuple[Slide, ...]:
    """Where the finger joints are shut and open. ``shapes``: link -> points (k, 3) of its collision shapes in its
    frame, m. Empty for fingers that are no slides, and where the shapes do not tell."""
    if len(fingers) < 2 or any(joint.kind != "prismatic" for joint in fingers):
        return ()
    spans = {joint.name: _span(urdf, joint) for joint in fingers}
    if not all(math.isfinite(end) for span in spans.values() for end in span):
        return ()
    half = {name: sum(span) / 2 for name, span in spans.items()}
    poses, middles = link_poses(urdf, half), []
    for joint in fingers:
        solid = [poses[link].apply(shapes[link]) for link in fixed_to(urdf, joint.child) if link in shapes]
        if not solid:
            return ()
        middles.append(np.concatenate(solid).mean(axis=0))
    found = []
    for number, joint in enumerate(fingers):
        others = np.mean([middle for other, middle in enumerate(middles) if other != number], axis=0)
        outwards = float((poses[joint.child].rotation @ np.array(joint.axis)) @ (middles[number] - others))
        if abs(outwards) < _TELLING:
            return ()
        low, high = sorted(spans[joint.name])
        found.append(Slide(joint, low, high) if outwards > 0 else Slide(joint, high, low))
    by_name = {one.joint.name: one for one in found}
    for one in found:
        mimic = one.joint.mimic
        if mimic is not None:
            if mimic.joint not in by_name:
                return ()
            follows = mimic.multiplier * by_name[mimic.joint].shut + mimic.offset
            if abs(follows - one.shut) > NEARLY_SHUT:
                return ()  # one opens while the other closes
    return tuple(found)


def counted_from_shut(text: str, slides: Sequence[Slide]) -> str:
    """The URDF text with these joints shut at 0 and opening with growing positions; nothing is anywhere else than
    before."""
    root = ElementTree.fromstring(text)
    lengths = {one.joint.name: abs(one.open - one.shut) for one in slides}
    for one in slides:
        element = next(joint for joint in root.findall("joint") if joint.get("name") == one.joint.name)
        axis = np.array(one.joint.axis)
        place = np.array(one.joint.origin.apply(axis * one.shut))
        origin = element.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(element, "origin")
        origin.set("xyz", _numbers(place))
        stated = element.find("axis")
        if stated is None:
            stated = ElementTree.SubElement(element, "axis")
        stated.set("xyz", _numbers(axis if one.open > one.shut else -axis))
        limit = element.find("limit")
        if limit is not None:
            limit.set("lower", "0")
            limit.set("upper", f"{lengths[one.joint.name]:.9g}")
        mimic = element.find("mimic")
        if mimic is not None and one.joint.mimic is not None:
            mimic.set("multiplier", f"{lengths[one.joint.name] / lengths[one.joint.mimic.joint]:.9g}")
            mimic.set("offset", "0")
    return ElementTree.tostring(root, encoding="unicode")


def fixed_to(urdf: Urdf, link: str) -> tuple[str, ...]:
    """The link and those below it over fixed joints."""
    links = [link]
    for joint in urdf.joints:
        if joint.kind == "fixed" and joint.parent in links:
            links.append(joint.child)
    return tuple(links)


def _span(urdf: Urdf, joint: UrdfJoint) -> tuple[float, float]:
    """m, both ends of what a joint moves over; one that follows another, where that one takes it."""
    if joint.mimic is None:
        return joint.lower, joint.upper
    driver = urdf.joint(joint.mimic.joint)
    multiplier, offset = joint.mimic.multiplier, joint.mimic.offset
    return multiplier * driver.lower + offset, multiplier * driver.upper + offset


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in np.round(values, 9) + 0.0)
