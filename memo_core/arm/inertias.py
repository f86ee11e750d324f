"""Inertias of links that a URDF does not state, or states as no solid body has them.

``memo_core.arm.description_from_urdf`` writes them into the description's copy of the URDF, each told as a guess.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np

from memo_core.arm.collision import convex_hull
from memo_core.arm.home_and_gains import Guess
from memo_core.arm.meshes import mesh_vertices
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import Urdf, UrdfLink, UrdfShape
from memo_core.robot.urdf.text import numbers
from memo_core.scene.pose import Array

_NEAR = 0.25  # share by which a moment may exceed the other two together and still be lowered to their sum
_KEYS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def with_possible_inertias(text: str, urdf: Urdf, guesses: list[Guess]) -> str:
    """The URDF text with each largest principal moment that exceeds the other two together by a little lowered to
    their sum, since simulators refuse it."""
    changed = {}
    for name, link in urdf.links.items():
        xx, yy, zz, xy, xz, yz = link.inertia
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        least = moments[0] + moments[1]
        if moments[0] > 0 and least < moments[2] <= (1 + _NEAR) * least:
            why = f"the URDF's {moments[2]:.4g} is {moments[2] / least - 1:.1%} more than the other two together"
            moments[2] = least * (1 - 1e-6)
            value = f"principal moments {', '.join(f'{one:.4g}' for one in moments)} kg m2"
            guesses.append(Guess(f"{name}.inertia", value, f"{why}, which no solid body has"))
            changed[name] = (axes * moments) @ axes.T
    if not changed:
        return text
    root = ElementTree.fromstring(text)
    for element in root.findall("link"):
        if element.get("name") in changed and (stated := element.find("inertial/inertia")) is not None:
            stated.attrib.update(_tensor(changed[str(element.get("name"))]))
    return ElementTree.tostring(root, encoding="unicode")


def with_guessed_masses(text: str, urdf: Urdf, total_mass: float, guesses: list[Guess]) -> str:
    """The URDF text with an ``<inertial>`` for each link that has shapes and no mass: solid, of the same density.

    Args:
        text: the URDF that ``urdf`` was read from.
        urdf: links and shapes; collision shapes count, visual ones where a link has no others, meshes as their hulls.
        total_mass: mass of all links together, kg; the part that no link states is divided by volume.
        guesses: receives a line with the masses.

    Returns:
        The changed text.

    Raises:
        InvalidArgument: if all links with shapes state a mass, or ``total_mass`` is not more than what they state.
    """
    import pinocchio as pin

    solid = {}
    for name, link in urdf.links.items():
        if link.mass <= 0 and (shapes := link.collisions or link.visuals):
            solid[name] = sum((_solid(link, shape) for shape in shapes), pin.Inertia.Zero())
    if not solid:
        raise InvalidArgument("--total-mass", "each link with a shape states its mass", "to leave the option out")
    rest = total_mass - urdf.total_mass
    if not 0 < rest < math.inf:
        problem = f"{total_mass:g} kg, and links of the URDF state {urdf.total_mass:g} kg"
        raise InvalidArgument("--total-mass", problem, "the mass of the whole arm, more than that")
    density = rest / sum(one.mass for one in solid.values())
    root = ElementTree.fromstring(text)
    for element in root.findall("link"):
        if (name := element.get("name", "")) not in solid:
            continue
        for stated in element.findall("inertial"):
            element.remove(stated)
        inertial = ElementTree.SubElement(element, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=numbers(solid[name].lever))
        ElementTree.SubElement(inertial, "mass", value=f"{density * solid[name].mass:.6g}")
        ElementTree.SubElement(inertial, "inertia", _tensor(density * solid[name].inertia))
    masses = ", ".join(f"{name} {density * one.mass:.2g} kg" for name, one in solid.items())
    guesses.append(Guess("inertials", masses, "the total mass, divided by volume: solid shapes of one density"))
    return ElementTree.tostring(root, encoding="unicode")


def _solid(link: UrdfLink, shape: UrdfShape) -> Any:
    """Inertia of a shape at a density of 1 kg/m3, in the link's frame."""
    import coal
    import pinocchio as pin

    kinds = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
    if shape.mesh is None:
        geometry = kinds[shape.shape](*shape.size)
    else:
        geometry = convex_hull(mesh_vertices(shape.mesh, shape.size, f"URDF link {link.name!r}"))
    own = pin.Inertia(geometry.computeVolume(), geometry.computeCOM(), geometry.computeMomentofInertiaRelatedToCOM())
    return pin.SE3(shape.pose.matrix).act(own)


def _tensor(inertia: Array) -> dict[str, str]:
    places: Sequence[tuple[int, int]] = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return {key: f"{inertia[place]:.9g}" for key, place in zip(_KEYS, places, strict=True)}
